//! From a scenario to a finished run: threads, server, signals, files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use sim::{RunReport, Scenario, WallClock, World};
use tractrix_core::Vehicle;

use super::Args;
use crate::dashboard::{self, Dashboard, Publisher, Shared};
use crate::driver::{self, ControlSender, Ended, Job, Pace, drive};
use crate::failure::Failure;
use crate::output;
use crate::progress::Progress;
use crate::provenance::{GIT_REVISION, Provenance, VERSION};
use crate::recording::{Combination, Recording, RunHeader};

/// Longest report that the dashboard serves.
const MAX_REPORT_BYTES: u64 = 64 << 20;
/// Viewers get this long to take the last frame before the server goes.
const LAST_FRAME_TIME: Duration = Duration::from_millis(200);

/// Drives the scenario as the options say.
pub(super) fn execute(args: &Args, seed: u64, scenario: &Scenario) -> Result<(), Failure> {
    let listener = if args.headless { None } else { Some(dashboard::bind(args.port)?) };
    let folder = out_folder(args, seed, scenario);
    let world = World::in_folder(scenario, seed, &folder.join("sumo")).map_err(Failure::input)?;
    let provenance = Provenance::of_seed(seed);
    let combination = Combination::new(world.truck().limits());
    let (controls, received) = driver::channel();
    let shared = listener.is_some().then(|| {
        let road = dashboard::road_json(world.road(), &combination);
        Shared::new(road, report_of(&scenario.truck.file), controls.clone())
    });
    let publisher = shared.as_ref().map(|shared| {
        let road = Arc::clone(world.road());
        Publisher::new(Arc::clone(shared), provenance, scenario, road)
    });
    let stop = Arc::new(AtomicBool::new(false));
    let pace = args.pace.unwrap_or(if args.headless { Pace::Max } else { Pace::REALTIME });
    let job = Job {
        recording: start_recording(&folder, seed, scenario, &world, combination)?,
        progress: Progress::of_run(&world),
        world,
        pace,
        publisher,
        controls: received,
        stop: Arc::clone(&stop),
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(Failure::work)?;
    if let (Some(listener), Some(shared)) = (listener, shared) {
        let address = listener.local_addr().map_err(Failure::work)?;
        output::note(&format!("dashboard: http://{address}  (Ctrl-C ends the run)"));
        runtime.spawn(Dashboard::new(listener, shared).serve());
    }
    let keep_open = args.keep_open;
    let ended = runtime.block_on(wait_for_end(job, stop, controls))?;
    let result = finish(ended, provenance, pace, &folder);
    if !args.headless {
        runtime.block_on(async {
            tokio::time::sleep(LAST_FRAME_TIME).await;
            if keep_open && result.is_ok() {
                output::note("the run has ended; Ctrl-C closes the dashboard");
                stop_signal().await;
            }
        });
    }
    runtime.shutdown_background();
    let (summary, json) = result?;
    report(args.json, &summary, &json, &folder);
    Ok(())
}

/// The report of the diagnosis that wrote a truck file: it lies beside it.
fn report_of(truck: &str) -> Option<String> {
    let page = Path::new(truck).parent()?.join("report.html");
    let small = |m: &std::fs::Metadata| m.is_file() && m.len() <= MAX_REPORT_BYTES;
    let extended = truck.ends_with(".extended.toml") && page.metadata().as_ref().is_ok_and(small);
    extended.then(|| std::fs::read_to_string(page).ok()).flatten()
}

/// `--out`, or a folder that does not exist yet: `runs/SCENARIO-SEED`, `runs/SCENARIO-SEED-2`, …
fn out_folder(args: &Args, seed: u64, scenario: &Scenario) -> PathBuf {
    if let Some(out) = &args.out {
        return out.clone();
    }
    let base = format!("runs/{}-{seed}", scenario.name);
    let mut folder = PathBuf::from(&base);
    let mut number = 2_u32;
    while folder.exists() {
        folder = PathBuf::from(format!("{base}-{number}"));
        number += 1;
    }
    folder
}

#[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
fn start_recording(
    folder: &Path,
    seed: u64,
    scenario: &Scenario,
    world: &World,
    combination: Combination,
) -> Result<Recording, Failure> {
    let started_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
    let metadata = BTreeMap::from([
        ("schema".to_owned(), "1".to_owned()),
        ("seed".to_owned(), seed.to_string()),
        ("version".to_owned(), VERSION.to_owned()),
        ("git_revision".to_owned(), GIT_REVISION.to_owned()),
        ("scenario".to_owned(), scenario.name.clone()),
        ("started_unix_s".to_owned(), format!("{started_s:.3}")),
    ]);
    let scenario_toml = toml::to_string(scenario).map_err(Failure::work)?;
    std::fs::create_dir_all(folder).map_err(|e| Failure::file(folder, e))?;
    let road = Arc::clone(world.road());
    let header = RunHeader { metadata, scenario_toml, road, combination };
    Recording::create(&folder.join("run.mcap"), header)
}

/// Drives the job in the world's own thread; Ctrl-C and SIGTERM stop it between two ticks.
async fn wait_for_end(
    job: Job,
    stop: Arc<AtomicBool>,
    controls: ControlSender,
) -> Result<Ended, Failure> {
    let (sender, receiver) = tokio::sync::oneshot::channel();
    #[expect(clippy::disallowed_methods, reason = "the shell owns the world's thread")]
    let thread = std::thread::spawn(move || {
        let _ = sender.send(drive(job));
    });
    let signals = tokio::spawn(async move {
        stop_signal().await;
        stop.store(true, Ordering::Relaxed);
    });
    let ended = receiver.await.map_err(|_| Failure::Work("the world's thread panicked".to_owned()));
    signals.abort();
    drop(controls);
    let _ = thread.join();
    ended
}

/// Ctrl-C or SIGTERM.
async fn stop_signal() {
    use tokio::signal::unix::{SignalKind, signal};
    let Ok(mut terminate) = signal(SignalKind::terminate()) else {
        return std::future::pending().await;
    };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => {}
        _ = terminate.recv() => {}
    }
}

/// Closes the recording and writes the summary, also of a run that failed.
fn finish(
    ended: Ended,
    provenance: Provenance,
    pace: Pace,
    folder: &Path,
) -> Result<(RunReport, String), Failure> {
    let wall = WallClock {
        missed_deadlines: ended.missed_deadlines,
        tick_time_us: ended.tick_time_us,
        pace: pace.to_string(),
        wall_time_s: ended.wall_time_s,
    };
    let summary = RunReport::new(provenance.into(), &ended.world, Some(ended.reason), wall);
    let json = serde_json::to_string_pretty(&summary).map_err(Failure::work)?;
    if let Some(publisher) = &ended.publisher {
        publisher.publish_summary(&json);
    }
    let recorded = ended.recording.finish(&json);
    let path = folder.join("summary.json");
    std::fs::write(&path, &json).map_err(|e| Failure::work_on(&path, &e))?;
    recorded?;
    let path = folder.join("traffic.manifest.toml");
    let text = ended.world.traffic().manifest().to_toml().map_err(Failure::work)?;
    std::fs::write(&path, text).map_err(|e| Failure::work_on(&path, &e))?;
    if let Some(why) = ended.world.traffic().failure() {
        output::note(&format!("traffic: {why}; the native engine went on"));
    }
    match ended.failure {
        Some(failure) => Err(failure),
        None => Ok((summary, json)),
    }
}

/// The result on stdout.
fn report(as_json: bool, run: &RunReport, json: &str, folder: &Path) {
    if as_json {
        return output::result(json);
    }
    let s = &run.summary;
    let litres_per_100_km = s.fuel_g / DIESEL_G_PER_L / (s.distance_m * 1e-5).max(1e-9);
    output::result(&format!(
        "{:.2} km in {:.1} s, {:.1} km/h, {:.2} kg fuel ({litres_per_100_km:.1} l/100 km), \
         {} collisions, {} lane changes, lateral error at most {:.3} m, guard {} ticks\n{}",
        s.distance_m * 1e-3,
        s.duration_s,
        s.mean_speed_m_s * 3.6,
        s.fuel_g * 1e-3,
        s.collisions,
        s.lane_changes,
        s.max_lateral_error_m,
        s.guard_activations,
        folder.display(),
    ));
}

/// Density of diesel fuel, g/l (EN 590, middle of 820 to 845).
const DIESEL_G_PER_L: f64 = 832.0;
