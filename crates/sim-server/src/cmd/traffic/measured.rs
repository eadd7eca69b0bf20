//! Recordings to compare with: read, laid on a road each, looked at.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use road::Road;
use traffic_client::replay::{Carriageway, Frame, Recording, load, road_of};
use traffic_client::stats::{Quantity, Samples, observe_recording};

use super::Direction;
use crate::failure::Failure;

/// Recordings and their samples.
#[derive(Default)]
pub(super) struct Measured {
    pub(super) files: Vec<PathBuf>,
    pub(super) recordings: Vec<Recording>,
    pub(super) roads: Vec<Arc<Road>>,
    pub(super) each: Vec<Samples>,
    /// Speeds of each recording if everyone kept the speed that they were seen at first, m/s.
    pub(super) kept_m_s: Vec<Vec<f64>>,
    /// All samples together.
    pub(super) samples: Samples,
    /// Metres of lanes, mean of the recordings.
    pub(super) lanes_m: f64,
}

impl From<Direction> for Carriageway {
    fn from(direction: Direction) -> Self {
        match direction {
            Direction::Forward => Self::Forward,
            Direction::Backward => Self::Backward,
        }
    }
}

/// Recordings are resampled to this, s.
const STEP_S: f64 = 0.1;
/// Endings of files that are read from a folder.
const ENDINGS: [&str; 5] = [".csv", ".csv.gz", ".xml", ".xml.gz", ".parquet"];
/// Speed limit of a road under a recording, m/s; measured drivers do not ask for it.
const LIMIT_M_S: f64 = 60.0;

impl Measured {
    /// Reads files and folders of files.
    ///
    /// # Errors
    /// [`Failure::Input`] names the file and what is wrong in it.
    pub(super) fn read(
        paths: &[PathBuf],
        lanes: usize,
        direction: Direction,
    ) -> Result<Self, Failure> {
        let mut all = Self::default();
        for path in paths {
            if path.is_dir() {
                all.files.extend(files_in(path)?);
            } else {
                all.files.push(path.clone());
            }
        }
        for file in &all.files {
            let mut recording = load(file, direction.into(), STEP_S).map_err(Failure::input)?;
            // Station and offset are as good as x and y for a road of one's own.
            recording.frame = Frame::Map;
            let road = Arc::new(road_of(&recording, lanes, LIMIT_M_S).map_err(Failure::input)?);
            let mut samples = observe_recording(&road, &recording).map_err(Failure::input)?;
            // All speeds of the file, also those that our road could not take up.
            samples.replace(Quantity::Speed, recording.speeds_m_s().collect());
            let kept = recording.tracks.iter().filter_map(|t| Some((t.samples.first()?, t)));
            let kept = kept.flat_map(|(first, t)| t.samples.iter().map(|_| first.speed_m_s));
            all.kept_m_s.push(kept.collect());
            all.lanes_m += traffic_client::calibrate::lanes_m(&road);
            all.each.push(samples);
            all.roads.push(road);
            all.recordings.push(recording);
        }
        all.samples = Samples::pooled(&all.each);
        all.lanes_m /= all.each.len().max(1) as f64;
        Ok(all)
    }
}

/// Recordings of a folder, in order of their names.
fn files_in(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries = std::fs::read_dir(folder).map_err(|e| Failure::file(folder, e))?;
    let is_recording = |path: &PathBuf| {
        let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
        ENDINGS.iter().any(|ending| name.ends_with(ending))
    };
    let mut files: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(is_recording).collect();
    files.sort();
    if files.is_empty() {
        return Err(Failure::Input(format!("{}: no recordings in it", folder.display())));
    }
    Ok(files)
}
