//! The recording of a drive, if one is wanted.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use j1939::bus::Bus;
use j1939::bus::tap::Tap;
use j1939::truck::DriverSetup;
use planner::StackConfig;
use recording::{
    Backlog, BusHeader, BusTrace, Combination, DriverWish, Geodesy, Recording, RunHeader, Scenery,
};
use road::Road;
use tractrix_core::{Recorder, Step, Tick};

use crate::cli::{Args, bus_name};
use crate::failure::Failure;
use crate::output;
use crate::sheet::Sheet;

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

/// The recording with what it is told of the bus, or nothing.
pub(crate) struct Log(Option<(Recording, BusTrace)>);

impl Log {
    /// Begins a recording in a folder, which is made.
    ///
    /// # Errors
    /// [`Failure::Input`] for a folder that holds a recording or cannot be written, and for a map
    /// that can no longer be read.
    pub(crate) fn begin(
        args: &Args,
        road: &Arc<Road>,
        sheet: &Sheet,
        stack: &StackConfig,
        setup: &DriverSetup,
    ) -> Result<Self, Failure> {
        let Some(folder) = &args.out else { return Ok(Self(None)) };
        let file = free(folder, args.overwrite)?;
        std::fs::create_dir_all(folder).map_err(|e| Failure::file(folder, &e))?;
        let geodesy = Geodesy::of(road).map_err(Failure::input)?;
        let combination = Combination::new(&sheet.limits);
        let scenery = Scenery { road: Arc::clone(road), combination, geodesy };
        let metadata = [
            ("schema", "1".to_owned()),
            ("program", "truck-node".to_owned()),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("started_unix_s", format!("{:.3}", unix_s())),
            ("road", args.map.clone()),
            ("truck", args.truck.display().to_string()),
        ];
        let mut files = BTreeMap::from([
            ("stack.toml", toml::to_string(stack).map_err(Failure::work)?),
            ("sheet.toml", sheet.text.clone()),
        ]);
        if !args.map.starts_with("builtin:") {
            let map = Path::new(&args.map);
            let text = std::fs::read_to_string(map).map_err(|e| Failure::file(map, &e))?;
            files.insert("road.xodr", text);
        }
        let driver_json = serde_json::to_string(setup).map_err(Failure::work)?;
        let trace = BusTrace::default();
        let bus = BusHeader { vehicle: bus_name(&args.can), driver_json, trace: trace.clone() };
        let metadata = metadata.map(|(key, value)| (key.to_owned(), value)).into();
        let header = RunHeader { metadata, files, scenery, bus: Some(bus), listener: None };
        let recording = Recording::create(&file, header, BACKLOG).map_err(Failure::input)?;
        Ok(Self(Some((recording, trace))))
    }

    /// A bus whose frames are recorded, if anything is.
    pub(crate) fn tapped<B: Bus + Send + Sync + 'static>(
        &self,
        bus: B,
    ) -> Box<dyn Bus + Send + Sync> {
        match &self.0 {
            Some((_, trace)) => Box::new(Tap::new(bus, trace.clone())),
            None => Box::new(bus),
        }
    }

    /// Something is wished of the driver of the truck before the next reading of the bus.
    pub(crate) fn wished(&self, wish: DriverWish) {
        if let Some((_, trace)) = &self.0 {
            trace.wished(wish);
        }
    }

    /// Whether a recording was wanted and has failed: driving goes on without.
    pub(crate) fn is_broken(&self) -> bool {
        self.0.as_ref().is_some_and(|(recording, _)| recording.is_broken())
    }

    /// Notes of ticks that were left out, because the disk was slower than the loop.
    pub(crate) fn dropped(&self) -> u64 {
        self.0.as_ref().map_or(0, |(recording, _)| recording.dropped())
    }

    /// Writes the end of the recording.
    pub(crate) fn finish(self, summary: &serde_json::Value) -> Result<(), Failure> {
        let Some((recording, _)) = self.0 else { return Ok(()) };
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
        if let Some((recording, _)) = &mut self.0 {
            recording.record(tick);
        }
    }

    fn step(&mut self, step: &Step<'_>) {
        if let Some((recording, _)) = &mut self.0 {
            recording.step(step);
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}
