//! A run's recording and summary: how they begin and how they end.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use recording::{
    Backlog, BusHeader, Combination, Geodesy, Listener, Recording, RunHeader, Scenery,
};
use sim::{RunReport, WallClock, World};
use tractrix_core::Vehicle;

use super::Ended;
use crate::failure::Failure;
use crate::out_folder::OutFolder;
use crate::output;
use crate::provenance::{GIT_REVISION, Provenance, VERSION};

/// Time since 1970.
#[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
pub(super) fn unix_time() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Tells runs apart that follow each other on a port.
pub(super) fn run_id(started: Duration) -> String {
    format!("{:x}-{:x}", started.as_nanos(), std::process::id())
}

pub(super) fn start_recording(
    out: &OutFolder,
    started: Duration,
    seed: u64,
    world: &World,
    bus: Option<BusHeader>,
    listener: Option<Listener>,
) -> Result<Recording, Failure> {
    let scenario = world.scenario();
    let mut metadata = BTreeMap::from([
        ("schema".to_owned(), "1".to_owned()),
        ("seed".to_owned(), seed.to_string()),
        ("version".to_owned(), VERSION.to_owned()),
        ("git_revision".to_owned(), GIT_REVISION.to_owned()),
        ("scenario".to_owned(), scenario.name.clone()),
        ("road".to_owned(), scenario.road.clone()),
        ("road_fingerprint".to_owned(), sim::road_fingerprint(world.road())),
        ("started_unix_s".to_owned(), format!("{:.3}", started.as_secs_f64())),
    ]);
    let begins_s = world.now().seconds();
    if begins_s > 0.0 {
        // Its stack was not new at the first tick
        metadata.insert("continues_at_s".to_owned(), begins_s.to_string());
    }
    let files = BTreeMap::from([
        ("scenario.toml", toml::to_string(&world.scenario_now()).map_err(Failure::work)?),
        ("stack.toml", toml::to_string(world.stack().config()).map_err(Failure::work)?),
    ]);
    let road = Arc::clone(world.road());
    let geodesy = Geodesy::of(&road).unwrap_or_else(|why| {
        output::note(&format!("{}: {why}: no /fix in the recording", road.name()));
        None
    });
    let combination = Combination::new(world.truck().limits());
    let scenery = Scenery { road, combination, geodesy };
    let header = RunHeader { metadata, files, scenery, bus, listener };
    Ok(Recording::create(&out.begin("run.mcap")?, header, Backlog::Wait)?)
}

/// Where a summary goes that its folder does not take: the folder for temporary files.
fn keep_elsewhere(json: &str) -> Option<PathBuf> {
    let name = format!("sim-server-summary-{}.json", run_id(unix_time()));
    let path = std::env::temp_dir().join(name);
    let mut file = File::create_new(&path).ok()?;
    if file.write_all(json.as_bytes()).is_err() {
        let _ = std::fs::remove_file(&path);
        return None;
    }
    Some(path)
}

/// Closes the recording and writes the summary, also of a run that failed.
pub(super) fn finish(
    mut ended: Ended,
    provenance: Provenance,
    out: &OutFolder,
) -> Result<(RunReport, String), Failure> {
    let wall = WallClock {
        missed_deadlines: ended.missed_deadlines,
        tick_time_us: ended.tick_time_us,
        pace: ended.pace.to_string(),
        wall_time_s: ended.wall_time_s,
    };
    let summary = RunReport::new(provenance.into(), &ended.world, Some(ended.reason), wall);
    let json = serde_json::to_string_pretty(&summary).map_err(Failure::work)?;
    if let Some(publisher) = &mut ended.publisher {
        publisher.publish_summary(&json);
    }
    let recorded = ended.recording.finish(&json);
    if !matches!(&recorded, Err(torn) if torn.kept_s <= 0.0) {
        out.keep();
    }
    let summary_written = out.write("summary.json", &json);
    let elsewhere = summary_written.as_ref().err().and_then(|_| keep_elsewhere(&json));
    if let Err(failure) = recorded.map_err(Failure::of_torn).and(summary_written) {
        return Err(match elsewhere {
            Some(file) => failure.under_way().hint(&format!("summary: {}", file.display())),
            None => failure.under_way(),
        });
    }
    let text = ended.world.traffic().manifest().to_toml().map_err(Failure::work)?;
    out.write("traffic.manifest.toml", text).map_err(Failure::under_way)?;
    if let Some(why) = ended.world.traffic().failure() {
        output::note(&format!("traffic: {why}; the native engine went on"));
    }
    match ended.failure {
        Some(failure) => Err(failure),
        None => Ok((summary, json)),
    }
}
