//! From a scenario to a finished run: threads, server, signals, files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use planner::decider::DeciderKind;
use recording::{Backlog, BusHeader, Combination, Geodesy, Recording, RunHeader, Scenery};
use road::Road;
use sim::{BusFigures, EndReason, GhostReport, RunReport, Scenario, TrafficKind, WallClock, World};
use tokio::sync::Notify;
use tractrix_core::Vehicle;

use super::Args;
use crate::dashboard::{self, Dashboard, Publisher, Shared};
use crate::driver::{self, ControlSender, Ended, Job, Pace, drive};
use crate::failure::Failure;
use crate::out_folder::OutFolder;
use crate::output;
use crate::progress::Progress;
use crate::provenance::{GIT_REVISION, Provenance, VERSION};
use crate::signals::stop_signal;

/// What is written.
const RESULTS: &[&str] = &["run.mcap", "summary.json", "traffic.manifest.toml", "sumo"];
/// Longest report that the dashboard serves.
const MAX_REPORT_BYTES: u64 = 64 << 20;
/// Viewers get this long to take the last frame before the server goes.
const LAST_FRAME_TIME: Duration = Duration::from_millis(200);

/// Drives the scenario as the options say.
pub(super) fn execute(args: &Args, seed: u64, scenario: &Scenario) -> Result<(), Failure> {
    let listener = if args.headless { None } else { Some(dashboard::bind(args.port)?) };
    let out = OutFolder::new(out_folder(args, seed, scenario), args.overwrite, RESULTS)?;
    let sumo = match scenario.traffic.source {
        TrafficKind::Sumo => out.begin("sumo")?,
        _ => out.path().join("sumo"),
    };
    let mut world = World::in_folder(scenario, seed, &sumo).map_err(Failure::input)?;
    let bus = super::options::connect(&mut world, &args.vehicle)?;
    warn_of_road(world.road());
    let (provenance, started) = (Provenance::of_seed(seed), unix_time());
    let combination = Combination::new(world.truck().limits());
    let (controls, received) = driver::channel();
    let shared = listener.is_some().then(|| {
        let road = dashboard::road_json(world.road(), &combination);
        let external = scenario.stack.decider == DeciderKind::External;
        Shared::new(road, report_of(&scenario.truck.file), external, controls.clone())
    });
    let publisher = shared.as_ref().map(|shared| {
        let road = Arc::clone(world.road());
        Publisher::new(Arc::clone(shared), provenance, run_id(started), scenario, road)
    });
    let stop = Arc::new(AtomicBool::new(false));
    let pace = args.pace.unwrap_or(if args.headless { Pace::Max } else { Pace::REALTIME });
    let job = Job {
        recording: start_recording(&out, started, seed, &world, combination, bus)?,
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
    let asked = Arc::new(Notify::new());
    runtime.spawn(raise_at_signal(stop, Arc::clone(&asked)));
    let ended = runtime.block_on(wait_for_end(job, controls));
    // What was recorded before a panic can be recovered.
    let ended = ended.inspect_err(|_| out.keep())?;
    let interrupted = ended.reason == EndReason::Interrupted;
    let result = finish(ended, provenance, pace, &out);
    if !args.headless {
        runtime.block_on(async {
            tokio::time::sleep(LAST_FRAME_TIME).await;
            if keep_open && !interrupted && result.is_ok() {
                output::note("the run has ended; Ctrl-C closes the dashboard");
                asked.notified().await;
            }
        });
    }
    runtime.shutdown_background();
    let (summary, json) = result?;
    report(args.json, &summary, &json, &out.path())
}

/// What is odd about the road, on stderr: the first few, all are in `map check`.
fn warn_of_road(road: &Road) {
    const SHOWN: usize = 5;
    let findings = road.findings();
    for finding in findings.iter().take(SHOWN) {
        output::note(&format!("warning: road {}: {finding}", road.name()));
    }
    if let more @ 1.. = findings.len().saturating_sub(SHOWN) {
        output::note(&format!("warning: {more} more of them; see map check"));
    }
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

/// Time since 1970.
#[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
fn unix_time() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Tells runs apart that follow each other on a port.
fn run_id(started: Duration) -> String {
    format!("{:x}-{:x}", started.as_nanos(), std::process::id())
}

fn start_recording(
    out: &OutFolder,
    started: Duration,
    seed: u64,
    world: &World,
    combination: Combination,
    bus: Option<BusHeader>,
) -> Result<Recording, Failure> {
    let scenario = world.scenario();
    let metadata = BTreeMap::from([
        ("schema".to_owned(), "1".to_owned()),
        ("seed".to_owned(), seed.to_string()),
        ("version".to_owned(), VERSION.to_owned()),
        ("git_revision".to_owned(), GIT_REVISION.to_owned()),
        ("scenario".to_owned(), scenario.name.clone()),
        ("road".to_owned(), scenario.road.clone()),
        ("road_fingerprint".to_owned(), sim::road_fingerprint(world.road())),
        ("started_unix_s".to_owned(), format!("{:.3}", started.as_secs_f64())),
    ]);
    let files = BTreeMap::from([
        ("scenario.toml", toml::to_string(scenario).map_err(Failure::work)?),
        ("stack.toml", toml::to_string(world.stack().config()).map_err(Failure::work)?),
    ]);
    let road = Arc::clone(world.road());
    let geodesy = Geodesy::of(&road).unwrap_or_else(|why| {
        output::note(&format!("{}: {why}: no /fix in the recording", road.name()));
        None
    });
    let scenery = Scenery { road, combination, geodesy };
    let header = RunHeader { metadata, files, scenery, bus, listener: None };
    Ok(Recording::create(&out.begin("run.mcap")?, header, Backlog::Wait)?)
}

/// A signal stops the run between two ticks, and ends the waiting of whoever waits for it.
async fn raise_at_signal(stop: Arc<AtomicBool>, asked: Arc<Notify>) {
    loop {
        stop_signal().await;
        stop.store(true, Ordering::Relaxed);
        asked.notify_one();
    }
}

/// Drives the job in the world's own thread.
async fn wait_for_end(job: Job, controls: ControlSender) -> Result<Ended, Failure> {
    let (sender, receiver) = tokio::sync::oneshot::channel();
    #[expect(clippy::disallowed_methods, reason = "the shell owns the world's thread")]
    let thread = std::thread::spawn(move || {
        let _ = sender.send(drive(job));
    });
    let ended = receiver.await.map_err(|_| Failure::Work("the world's thread panicked".to_owned()));
    drop(controls);
    let _ = thread.join();
    ended
}

/// Closes the recording and writes the summary, also of a run that failed.
fn finish(
    ended: Ended,
    provenance: Provenance,
    pace: Pace,
    out: &OutFolder,
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
    if !matches!(&recorded, Err(torn) if torn.kept_s <= 0.0) {
        out.keep();
    }
    let summary_written = out.write("summary.json", &json);
    recorded.map_err(Failure::of_torn)?;
    summary_written?;
    let text = ended.world.traffic().manifest().to_toml().map_err(Failure::work)?;
    out.write("traffic.manifest.toml", text)?;
    if let Some(why) = ended.world.traffic().failure() {
        output::note(&format!("traffic: {why}; the native engine went on"));
    }
    match ended.failure {
        Some(failure) => Err(failure),
        None => Ok((summary, json)),
    }
}

/// The result on stdout.
fn report(as_json: bool, run: &RunReport, json: &str, folder: &Path) -> Result<(), Failure> {
    if as_json {
        return output::result(json);
    }
    let s = &run.summary;
    let litres_per_100_km = s.fuel_g / DIESEL_G_PER_L / (s.distance_m * 1e-5).max(1e-9);
    output::result(&format!(
        "{:.2} km in {:.1} s, {:.1} km/h, {:.2} kg fuel ({litres_per_100_km:.1} l/100 km), \
         {} collisions, {} lane changes, lateral error at most {:.3} m, guard {} ticks{}{}\n{}",
        s.distance_m * 1e-3,
        s.duration_s,
        s.mean_speed_m_s * 3.6,
        s.fuel_g * 1e-3,
        s.collisions,
        s.lane_changes,
        s.max_lateral_error_m,
        s.guard_activations,
        run.ghost.as_ref().map_or_else(String::new, against_ghost),
        run.bus.as_ref().map_or_else(String::new, over_bus),
        folder.display(),
    ))
}

/// What was saved against the ghost, and what traffic cost.
fn against_ghost(ghost: &GhostReport) -> String {
    let percent = |frac: Option<f64>| {
        frac.map_or("not known".to_owned(), |frac| format!("{:.1} %", 100.0 * frac))
    };
    let mut text = format!(
        "\nsaved against cruise control on an empty road, at equal time: {}",
        percent(ghost.saving_frac)
    );
    if ghost.held_up_s > 0.0 {
        text.push_str(&format!(
            " ({} where traffic did not hold the truck up; it did for {:.0} s, {:.2} km)",
            percent(ghost.free_saving_frac),
            ghost.held_up_s,
            ghost.held_up_m * 1e-3
        ));
    }
    text
}

/// How the bus between stack and truck did.
fn over_bus(bus: &BusFigures) -> String {
    format!(
        "\nover a bus at 250 kbit/s: load {:.1} % in the busiest second, {} ticks not driven, \
         {} demands refused",
        100.0 * bus.peak_load_frac,
        bus.ticks_not_driven,
        bus.refused
    )
}

/// Density of diesel fuel, g/l (EN 590, middle of 820 to 845).
const DIESEL_G_PER_L: f64 = 832.0;
