//! Recorded traffic: trajectories from files, resampled, matched to the road, replayed.
//!
//! [`load`] reads CSV (own, NGSIM, highD, mapped frames), CommonRoad XML and Parquet, plain or
//! gzipped; [`ReplayTraffic`] shows a recording around the ego. A replay does not react: the ego can
//! drive through a recorded vehicle. It ends with the recording unless repeating is asked for.

mod commonroad;
mod csv;
mod line;
mod parquet;
mod recording;
mod source;

pub use commonroad::read_commonroad;
pub use csv::{Carriageway, read_csv};
pub use line::road_of;
pub use parquet::{read_parquet, to_parquet};
pub(crate) use recording::class_of_length;
pub use recording::{Frame, Recording, Row, Sample, Track};
pub use source::{ReplayConfig, ReplayTraffic};

use std::io::Read;
use std::path::Path;

/// Largest file that is read, bytes, unpacked.
const LARGEST_FILE: u64 = 2 << 30;

/// Errors of recorded traffic.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The content is not what it should be.
    #[error("{name}: {why}")]
    Format {
        /// File.
        name: String,
        /// What is wrong, with line, row or column.
        why: String,
    },
    /// The file cannot be read or written.
    #[error("{path}: {why}")]
    File {
        /// File.
        path: String,
        /// What the system says.
        why: String,
    },
    /// No vehicle of the recording lies on the road.
    #[error(
        "none of the {tracks} tracks of `{name}` lies on road `{road}`; the road \
         `recording:LANES` is laid under the recording"
    )]
    NotOnRoad {
        /// Recording.
        name: String,
        /// Number of tracks.
        tracks: usize,
        /// Road.
        road: String,
    },
}

pub(crate) fn file_error(path: &Path, e: &std::io::Error) -> ReplayError {
    ReplayError::File { path: path.display().to_string(), why: e.to_string() }
}

/// Reads a recording and resamples it to `step_s`. The format is told from the name (`.parquet`,
/// `.xml`, `.csv`, each but the first also with `.gz`) and, for CSV, from the header.
///
/// # Errors
/// [`ReplayError`].
pub fn load(path: &Path, carriageway: Carriageway, step_s: f64) -> Result<Recording, ReplayError> {
    let name = path.display().to_string();
    let lower = name.to_ascii_lowercase();
    let (frame, rows) = if lower.ends_with(".parquet") {
        (Frame::Map, read_parquet(path)?)
    } else {
        let bytes = read_file(path, lower.ends_with(".gz"))?;
        if bytes.iter().all(u8::is_ascii_whitespace) {
            return Err(ReplayError::Format { name, why: "the file is empty".to_owned() });
        }
        if lower.trim_end_matches(".gz").ends_with(".xml") {
            let text = String::from_utf8(bytes)
                .map_err(|e| ReplayError::Format { name: name.clone(), why: e.to_string() })?;
            (Frame::Map, read_commonroad(&name, &text)?)
        } else {
            read_csv(&name, &bytes, carriageway)?
        }
    };
    Recording::from_rows(&name, frame, rows, step_s)
}

fn read_file(path: &Path, gzipped: bool) -> Result<Vec<u8>, ReplayError> {
    let file = std::fs::File::open(path).map_err(|e| file_error(path, &e))?;
    let mut bytes = Vec::new();
    let read = if gzipped {
        flate2::read::MultiGzDecoder::new(file).take(LARGEST_FILE).read_to_end(&mut bytes)
    } else {
        file.take(LARGEST_FILE).read_to_end(&mut bytes)
    };
    read.map_err(|e| file_error(path, &e))?;
    Ok(bytes)
}
