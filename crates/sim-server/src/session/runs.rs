//! The runs of a session, one after the other: each with its world, its folder, its recording and
//! its summary.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use recording::Combination;
use road::Road;
use sim::{RunReport, Scenario, TrafficKind, World};
use tractrix_core::Vehicle;

use super::DEFAULT;
use super::record::{finish, run_id, start_recording, unix_time};
use super::{
    Acted, Asked, Command, Controls, Drive, Ended, Handle, Job, Next, Pace, Refused, Reply, State,
};
use crate::dashboard::{self, Publisher, Setting, Shared};
use crate::failure::Failure;
use crate::listeners::Listeners;
use crate::out_folder::OutFolder;
use crate::output;
use crate::progress::Progress;
use crate::provenance::Provenance;

/// What is written.
pub(crate) const RESULTS: &[&str] = &["run.mcap", "summary.json", "traffic.manifest.toml", "sumo"];
/// Longest report that the dashboard serves.
const MAX_REPORT_BYTES: u64 = 64 << 20;
/// Runs of one name in one folder, at most.
const MAX_RUNS: u32 = 10_000;
/// Letters of a scenario's name in that of a folder, at most.
const MAX_NAME: usize = 60;
/// Behind the end of a run, the session looks this often whether it is to end.
const LOOK: Duration = Duration::from_millis(50);

/// Where runs leave what they write.
pub(crate) enum Place {
    /// The first in a folder that was named; later ones in `run-2`, `run-3`, ... in it.
    Named(PathBuf),
    /// Each in a folder of its own here: `SCENARIO-SEED`, `SCENARIO-SEED-2`, ...
    In(PathBuf),
}

/// What all runs of a session share.
pub(crate) struct Runs {
    pub(crate) place: Place,
    /// How the stack reaches the truck, as `--vehicle` says.
    pub(crate) vehicle: String,
    pub(crate) pace: Pace,
    /// The session stays behind the end of a run, for another one.
    pub(crate) stays: bool,
    pub(crate) listeners: Listeners,
    pub(crate) shared: Option<Arc<Shared>>,
    pub(crate) handle: Handle,
    pub(crate) stop: Arc<AtomicBool>,
}

/// A run about to begin.
pub(crate) struct Begin {
    pub(crate) world: World,
    pub(crate) seed: u64,
    pub(crate) state: State,
    pub(crate) out: OutFolder,
    /// Who waits for it.
    pub(crate) waiting: Option<Reply>,
}

/// A run that is ready to be driven.
pub(crate) struct Prepared {
    job: Job,
    out: OutFolder,
    provenance: Provenance,
    waiting: Option<Reply>,
}

/// The last run's summary, as JSON too, and its folder.
pub(crate) type Outcome = (RunReport, String, PathBuf);

impl Runs {
    /// Starts the recording, and shows the run.
    ///
    /// # Errors
    /// [`Failure`]: the bus, or a file that cannot be written.
    pub(crate) fn prepare(
        &self,
        begin: Begin,
        asked: Receiver<Asked>,
    ) -> Result<Prepared, Failure> {
        let Begin { mut world, seed, state, out, waiting } = begin;
        let bus = super::vehicle::connect(&mut world, &self.vehicle, self.handle.bus())?;
        warn_of_road(world.road());
        let (provenance, started) = (Provenance::of_seed(seed), unix_time());
        let recording =
            start_recording(&out, started, seed, &world, bus, self.listeners.listener())?;
        self.handle.note_world(&world, seed, &out.path());
        self.handle.note_controls(Controls::of(&world, self.pace));
        let publisher = self.shared.as_ref().map(|shared| {
            shared.begin(setting(&world));
            let (road, run_id) = (Arc::clone(world.road()), run_id(started));
            Publisher::new(Arc::clone(shared), provenance, run_id, world.scenario(), road)
        });
        let job = Job {
            recording,
            progress: if self.is_default() { Progress::of_run(&world) } else { Progress::hidden() },
            world,
            state,
            pace: self.pace,
            publisher,
            handle: self.handle.clone(),
            asked,
            stop: Arc::clone(&self.stop),
        };
        Ok(Prepared { job, out, provenance, waiting })
    }

    /// Drives a run and those that are asked for in its place; where the session stays, those that
    /// are asked for behind its end too.
    ///
    /// # Errors
    /// [`Failure`] of the first run that fails.
    pub(crate) fn drive_all(&self, first: Prepared) -> Result<Outcome, Failure> {
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
            let finished = finish(ended, provenance, &out);
            self.handle.note_written();
            let (summary, json) = finished?;
            let outcome = (summary, json, out.path());
            let Some(asked) = asked else { return Ok(outcome) };
            let (next, asked) = match next {
                Some(next) => (Some(next), asked),
                None if interrupted || !self.stays => (None, asked),
                None => {
                    output::note(&self.farewell());
                    self.next_one(asked)
                }
            };
            let Some((next, reply)) = next else { return Ok(outcome) };
            let Next { world, seed, state } = *next;
            let out = self.place.of_next(seed, world.scenario())?;
            prepared =
                self.prepare(Begin { world, seed, state, out, waiting: Some(reply) }, asked)?;
        }
    }

    /// Whether it is what the program was started for.
    fn is_default(&self) -> bool {
        self.shared.as_ref().is_none_or(|shared| shared.id() == DEFAULT)
    }

    fn farewell(&self) -> String {
        match self.shared.as_ref().map(|shared| shared.id()) {
            Some(id) if id != DEFAULT => format!("session {id}: its run has ended"),
            _ => "the run has ended; Ctrl-C closes the dashboard".to_owned(),
        }
    }

    /// Behind the end of a run: waits for another one. Everything else is refused.
    fn next_one(&self, asked: Receiver<Asked>) -> (Option<(Box<Next>, Reply)>, Receiver<Asked>) {
        while !self.stop.load(Ordering::Relaxed) {
            let Asked { command, reply, .. } = match asked.recv_timeout(LOOK) {
                Ok(asked) => asked,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => break,
            };
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
        (None, asked)
    }
}

impl Place {
    /// Claims the folder of a session's first run.
    ///
    /// # Errors
    /// [`Failure::Input`]: a run is in the named folder, or it cannot be made.
    pub(crate) fn of_first(
        &self,
        seed: u64,
        scenario: &Scenario,
        overwrite: bool,
    ) -> Result<OutFolder, Failure> {
        match self {
            Self::Named(folder) => OutFolder::new(folder.clone(), overwrite, RESULTS),
            Self::In(runs) => {
                let name = folder_name(scenario, seed);
                let others = (2..MAX_RUNS).map(|number| format!("{name}-{number}"));
                OutFolder::fresh(runs, std::iter::once(name.clone()).chain(others), RESULTS)
            }
        }
    }

    /// Claims a folder of its own for a run that follows another one.
    fn of_next(&self, seed: u64, scenario: &Scenario) -> Result<OutFolder, Failure> {
        match self {
            Self::Named(folder) => {
                let names = (2..MAX_RUNS).map(|number| format!("run-{number}"));
                OutFolder::fresh(folder, names, RESULTS)
            }
            Self::In(_) => self.of_first(seed, scenario, false),
        }
    }
}

/// A run's name: its scenario's, in letters that a path and a URL may have, and its seed.
fn folder_name(scenario: &Scenario, seed: u64) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
    let name: String = scenario.name.chars().map(plain).take(MAX_NAME).collect();
    format!("{name}-{seed}")
}

/// The world of a session's first run; SUMO writes into the run's folder.
///
/// # Errors
/// [`Failure::Input`] names what cannot be used.
pub(crate) fn first_world(
    scenario: &Scenario,
    seed: u64,
    out: &OutFolder,
) -> Result<World, Failure> {
    let sumo = match scenario.traffic.source {
        TrafficKind::Sumo => out.begin("sumo")?,
        _ => out.path().join("sumo"),
    };
    World::in_folder(scenario, seed, &sumo).map_err(Failure::input)
}

/// What the page shows of a world that does not change.
pub(crate) fn setting(world: &World) -> Setting {
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

/// Drives the job in the world's own thread.
fn in_own_thread(job: Job) -> Result<Ended, Failure> {
    #[expect(clippy::disallowed_methods, reason = "the shell owns the world's thread")]
    let thread = std::thread::spawn(move || Drive::new(job).run());
    thread.join().map_err(|_| Failure::Work("the world's thread panicked".to_owned()))
}
