//! The runs of a session, one after the other: each with its world, its folder, its recording and
//! its summary.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use recording::{
    Backlog, BusHeader, Combination, Geodesy, Listener, Recording, RunHeader, Scenery,
};
use road::Road;
use sim::{RunReport, Scenario, WallClock, World};
use tokio::runtime::Runtime;
use tokio::sync::Notify;
use tractrix_core::Vehicle;

use super::Args;
use crate::dashboard::{self, Publisher, Setting, Shared};
use crate::failure::Failure;
use crate::listeners::Listeners;
use crate::out_folder::OutFolder;
use crate::output;
use crate::progress::Progress;
use crate::provenance::{GIT_REVISION, Provenance, VERSION};
use crate::session::{
    Acted, Asked, Command, Drive, Ended, Handle, Job, Next, Pace, Refused, Reply, State,
};

/// What is written.
pub(super) const RESULTS: &[&str] = &["run.mcap", "summary.json", "traffic.manifest.toml", "sumo"];
/// Longest report that the dashboard serves.
const MAX_REPORT_BYTES: u64 = 64 << 20;
/// Runs of one session in one folder, at most.
const MAX_RUNS: u32 = 10_000;

/// What all runs of a session share.
pub(super) struct Runs<'a> {
    pub(super) args: &'a Args,
    pub(super) listeners: Listeners,
    pub(super) shared: Option<Arc<Shared>>,
    pub(super) handle: Handle,
    pub(super) stop: Arc<AtomicBool>,
}

/// A run about to begin.
pub(super) struct Begin {
    pub(super) world: World,
    pub(super) seed: u64,
    pub(super) state: State,
    pub(super) out: OutFolder,
    /// Who waits for it.
    pub(super) waiting: Option<Reply>,
}

/// A run that is ready to be driven.
pub(super) struct Prepared {
    job: Job,
    out: OutFolder,
    provenance: Provenance,
    waiting: Option<Reply>,
}

/// The last run's summary, as JSON too, and its folder.
pub(super) type Outcome = (RunReport, String, PathBuf);

impl Runs<'_> {
    /// Starts the recording, and shows the run.
    ///
    /// # Errors
    /// [`Failure`]: the bus, or a file that cannot be written.
    pub(super) fn prepare(
        &self,
        begin: Begin,
        asked: Receiver<Asked>,
    ) -> Result<Prepared, Failure> {
        let Begin { mut world, seed, state, out, waiting } = begin;
        let bus = super::options::connect(&mut world, &self.args.vehicle)?;
        warn_of_road(world.road());
        let (provenance, started) = (Provenance::of_seed(seed), unix_time());
        let recording =
            start_recording(&out, started, seed, &world, bus, self.listeners.listener())?;
        self.handle.note_world(&world, seed);
        let publisher = self.shared.as_ref().map(|shared| {
            shared.begin(setting(&world));
            let (road, run_id) = (Arc::clone(world.road()), run_id(started));
            Publisher::new(Arc::clone(shared), provenance, run_id, world.scenario(), road)
        });
        let usual = if self.args.headless { Pace::Max } else { Pace::REALTIME };
        let job = Job {
            recording,
            progress: Progress::of_run(&world),
            world,
            state,
            pace: self.args.pace.unwrap_or(usual),
            publisher,
            handle: self.handle.clone(),
            asked,
            stop: Arc::clone(&self.stop),
        };
        Ok(Prepared { job, out, provenance, waiting })
    }

    /// Drives a run and those that are asked for in its place; with `--keep-open` those that are
    /// asked for behind its end too.
    ///
    /// # Errors
    /// [`Failure`] of the first run that fails.
    pub(super) fn drive_all(
        &self,
        first: Prepared,
        runtime: &Runtime,
        ending: &Notify,
    ) -> Result<Outcome, Failure> {
        let mut prepared = first;
        loop {
            let Prepared { job, out, provenance, waiting } = prepared;
            let now = Acted { tick: 0, time_s: job.world.now().seconds(), state: job.state };
            if let Some(reply) = waiting {
                let _ = reply.send(Ok(now));
            }
            // What was recorded before a panic can be recovered
            let mut ended = in_own_thread(job).inspect_err(|_| out.keep())?;
            let (next, quits, asked) = (ended.next.take(), ended.quits, ended.asked.take());
            let interrupted = self.stop.load(Ordering::Relaxed) || quits;
            let (summary, json) = finish(ended, provenance, &out)?;
            let outcome = (summary, json, out.path());
            let Some(asked) = asked else { return Ok(outcome) };
            let (next, asked) = match next {
                Some(next) => (Some(next), asked),
                None if interrupted || !self.args.keep_open => (None, asked),
                None => {
                    output::note("the run has ended; Ctrl-C closes the dashboard");
                    runtime.block_on(self.next_one(asked, ending))
                }
            };
            let Some((next, reply)) = next else { return Ok(outcome) };
            let Next { world, seed, state } = *next;
            let folder = self.next_folder(seed, world.scenario())?;
            let out = OutFolder::new(folder, false, RESULTS)?;
            prepared =
                self.prepare(Begin { world, seed, state, out, waiting: Some(reply) }, asked)?;
        }
    }

    /// Behind the end of a run: waits for another one. Everything else is refused.
    async fn next_one(
        &self,
        asked: Receiver<Asked>,
        ending: &Notify,
    ) -> (Option<(Box<Next>, Reply)>, Receiver<Asked>) {
        const LOOK: Duration = Duration::from_millis(50);
        loop {
            while let Ok(Asked { command, reply }) = asked.try_recv() {
                match command {
                    Command::Begin(next) => return (Some((next, reply)), asked),
                    Command::Quit => {
                        self.handle.note_state(State::Quitting);
                        let now = Acted { tick: 0, time_s: 0.0, state: State::Quitting };
                        let _ = reply.send(Ok(now));
                        return (None, asked);
                    }
                    _ => {
                        let _ = reply.send(Err(Refused::Ended));
                    }
                }
            }
            if tokio::time::timeout(LOOK, ending.notified()).await.is_ok() {
                return (None, asked);
            }
        }
    }

    /// A folder of its own for a run that follows another one: `runs/SCENARIO-SEED-2`, or `run-2`
    /// in the folder that was asked for.
    fn next_folder(&self, seed: u64, scenario: &Scenario) -> Result<PathBuf, Failure> {
        let Some(out) = &self.args.out else { return Ok(out_folder(self.args, seed, scenario)) };
        let mut folders = (2..MAX_RUNS).map(|number| out.join(format!("run-{number}")));
        let free = folders.find(|folder| !folder.exists());
        free.ok_or_else(|| Failure::Work(format!("{}: too many runs", out.display())))
    }
}

/// What the page shows of a world that does not change.
pub(super) fn setting(world: &World) -> Setting {
    let scenario = world.scenario();
    let combination = Combination::new(world.truck().limits());
    Setting {
        road: dashboard::road_json(world.road(), &combination).into(),
        report: report_of(&scenario.truck.file).map(Arc::from),
    }
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
pub(super) fn out_folder(args: &Args, seed: u64, scenario: &Scenario) -> PathBuf {
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
    bus: Option<BusHeader>,
    listener: Option<Listener>,
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
    let combination = Combination::new(world.truck().limits());
    let scenery = Scenery { road, combination, geodesy };
    let header = RunHeader { metadata, files, scenery, bus, listener };
    Ok(Recording::create(&out.begin("run.mcap")?, header, Backlog::Wait)?)
}

/// Drives the job in the world's own thread.
fn in_own_thread(job: Job) -> Result<Ended, Failure> {
    #[expect(clippy::disallowed_methods, reason = "the shell owns the world's thread")]
    let thread = std::thread::spawn(move || Drive::new(job).run());
    thread.join().map_err(|_| Failure::Work("the world's thread panicked".to_owned()))
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
fn finish(
    ended: Ended,
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
    if let Some(publisher) = &ended.publisher {
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
