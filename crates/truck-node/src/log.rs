//! The recording of a drive, if one is wanted.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use planner::StackConfig;
use recording::{Backlog, Combination, Geodesy, Recording, RunHeader, Scenery};
use road::Road;
use tractrix_core::{Recorder, Step, Tick, VehicleLimits};

use crate::failure::Failure;
use crate::output;

/// Name of the recording in its folder.
const FILE: &str = "run.mcap";
/// A truck is not kept waiting by its disk; nor is who ends the program, for longer than this, s.
const BACKLOG: Backlog = Backlog::Drop { end_within_s: 5.0 };

/// Where a recording goes.
///
/// # Errors
/// [`Failure::Input`] for a folder that holds a recording.
pub(crate) fn free(folder: &Path, overwrite: bool) -> Result<PathBuf, Failure> {
    let file = folder.join(FILE);
    if file.exists() && !overwrite {
        let file = file.display();
        return Err(Failure::Input(format!("--out {file}: a recording is there; --overwrite")));
    }
    Ok(file)
}

/// The recording, or nothing.
pub(crate) struct Log(Option<Recording>);

impl Log {
    /// Begins a recording in a folder, which is made.
    ///
    /// # Errors
    /// [`Failure::Input`] for a folder that holds a recording or cannot be written.
    pub(crate) fn begin(
        folder: Option<&Path>,
        overwrite: bool,
        road: &Arc<Road>,
        limits: &VehicleLimits,
        stack: &StackConfig,
        set_up: BTreeMap<String, String>,
    ) -> Result<Self, Failure> {
        let Some(folder) = folder else { return Ok(Self(None)) };
        let file = free(folder, overwrite)?;
        std::fs::create_dir_all(folder).map_err(|e| Failure::file(folder, &e))?;
        let geodesy = Geodesy::of(road).map_err(Failure::input)?;
        let scenery =
            Scenery { road: Arc::clone(road), combination: Combination::new(limits), geodesy };
        let mut metadata = set_up;
        metadata.extend([
            ("schema".to_owned(), "1".to_owned()),
            ("program".to_owned(), "truck-node".to_owned()),
            ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("started_unix_s".to_owned(), format!("{:.3}", unix_s())),
        ]);
        let stack_toml = toml::to_string(stack).map_err(Failure::work)?;
        let header = RunHeader { metadata, scenario_toml: None, stack_toml, scenery, bus: None };
        Ok(Self(Some(Recording::create(&file, header, BACKLOG).map_err(Failure::input)?)))
    }

    /// Whether a recording was wanted and has failed: driving goes on without.
    pub(crate) fn is_broken(&self) -> bool {
        self.0.as_ref().is_some_and(Recording::is_broken)
    }

    /// Notes of ticks that were left out, because the disk was slower than the loop.
    pub(crate) fn dropped(&self) -> u64 {
        self.0.as_ref().map_or(0, Recording::dropped)
    }

    /// Writes the end of the recording.
    pub(crate) fn finish(self, summary: &serde_json::Value) -> Result<(), Failure> {
        let Some(recording) = self.0 else { return Ok(()) };
        recording.finish(&summary.to_string()).map_err(|torn| {
            if torn.kept_s > 0.0 {
                let kept = format!("whole up to {:.1} s; sim-server recover", torn.kept_s);
                output::note(&kept);
            }
            Failure::work(format!("{}: {}", torn.path.display(), torn.why))
        })
    }
}

impl Recorder for Log {
    fn record(&mut self, tick: &Tick<'_>) {
        if let Some(recording) = &mut self.0 {
            recording.record(tick);
        }
    }

    fn step(&mut self, step: &Step<'_>) {
        if let Some(recording) = &mut self.0 {
            recording.step(step);
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}
