//! The recorder of the main job: owned ticks over a bounded channel to the writer's thread.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use road::Road;
use tractrix_core::{EgoState, Plan, Recorder, Scene, Tick, Time};

use super::file::{Channel, McapFile};
use super::ros::marker::MarkerArray;
use super::ros::standard::{Clock, NavSatFix, Odometry, Path as RosPath, TfMessage};
use super::ros::truck::{PlanState, Scene as RosScene, TruckState};
use super::telemetry::{self, Combination, Geodesy, Scenery};
use crate::failure::Failure;
use crate::output::note;

/// What a recording says about its run.
pub(crate) struct RunHeader {
    /// Name and value: seed, version, revision, start of the run.
    pub(crate) metadata: BTreeMap<String, String>,
    /// The scenario as it was run.
    pub(crate) scenario_toml: String,
    /// The road that was driven.
    pub(crate) road: Arc<Road>,
    /// The ego's lengths.
    pub(crate) combination: Combination,
}

/// Ticks in flight to the writer; the world waits when the writer is this far behind.
const QUEUE_TICKS: usize = 512;
/// Scene, path and markers are recorded at most this often.
const SCENE_PERIOD: Time = Time(100_000_000);
/// Chunks are closed this often (simulated).
const FLUSH_PERIOD: Time = Time(1_000_000_000);

/// The lane lines around the truck are repeated this often, for viewers that join or jump.
const LANES_PERIOD: Time = Time(10_000_000_000);
/// At the start they are written for so much of the road, m: 2.4 MB of points for two lanes.
const LANES_AT_START_M: f64 = 100_000.0;
/// How far around the truck they are repeated, m.
const LANES_BEHIND_M: f64 = 500.0;
const LANES_AHEAD_M: f64 = 1500.0;

/// One tick on its way to the writer.
struct Record {
    now: Time,
    ego: EgoState,
    /// Without its speed profile, and without its path except at the scene's rate.
    plan: Plan,
    /// At the scene's rate.
    scene: Option<Scene>,
}

impl Record {
    /// The tick; its scene is empty between those that are recorded.
    fn tick(&self) -> Tick<'_> {
        static NONE: Scene = Scene { time: Time::ZERO, neighbours: Vec::new() };
        let scene = self.scene.as_ref().unwrap_or(&NONE);
        Tick { now: self.now, ego: &self.ego, scene, plan: &self.plan }
    }
}

/// A recording under way.
pub(crate) struct Recording {
    sender: SyncSender<Record>,
    path: PathBuf,
    thread: JoinHandle<(McapFile, Time, Result<(), Failure>)>,
    broken: bool,
    scene_due: Time,
}

impl Recording {
    /// Creates the file, writes what is known before the first tick, and starts the writer.
    ///
    /// # Errors
    /// [`Failure`] when the file cannot be created.
    pub(crate) fn create(path: &Path, header: RunHeader) -> Result<Self, Failure> {
        let mut file = McapFile::create(path)?;
        file.metadata("run", header.metadata)?;
        file.attach("scenario.toml", "application/toml", header.scenario_toml.as_bytes())?;
        let geodesy = Geodesy::of(&header.road).unwrap_or_else(|why| {
            note(&format!("{}: {why}: no /fix in the recording", header.road.name()));
            None
        });
        let scenery = Scenery { road: header.road, combination: header.combination, geodesy };
        let tracks = Tracks::open(file, scenery)?;
        let (sender, receiver) = sync_channel(QUEUE_TICKS);
        let thread = spawn(move || tracks.run(&receiver))?;
        let path = path.to_owned();
        Ok(Self { sender, path, thread, broken: false, scene_due: Time::ZERO })
    }

    /// Whether the writer has given up; the run must end, [`Self::finish`] says why.
    pub(crate) const fn is_broken(&self) -> bool {
        self.broken
    }

    /// Waits until everything is written, attaches the summary and closes the file.
    ///
    /// # Errors
    /// [`Torn`] with the file and what went wrong, at whatever tick it did.
    pub(crate) fn finish(self, summary_json: &str) -> Result<(), Torn> {
        drop(self.sender);
        let path = self.path;
        let Ok((mut file, kept, written)) = self.thread.join() else {
            let why = Failure::Work("the recording thread panicked".to_owned());
            return Err(Torn { why, path, kept_s: 0.0 });
        };
        written
            .and_then(|()| file.attach("summary.json", "application/json", summary_json.as_bytes()))
            .and_then(|()| file.finish())
            .map_err(|why| Torn { why, path, kept_s: kept.seconds() })
    }
}

/// A recording without an end.
#[derive(Debug)]
pub(crate) struct Torn {
    why: Failure,
    path: PathBuf,
    /// Simulated time up to which it is whole, s.
    pub(crate) kept_s: f64,
}

impl Torn {
    /// Why, and what helps.
    pub(crate) fn into_failure(self) -> Failure {
        if self.kept_s <= 0.0 {
            return self.why;
        }
        let (path, kept_s) = (self.path.display(), self.kept_s);
        self.why.hint(&format!("its first {kept_s:.0} s are saved by `sim-server recover {path}`"))
    }
}

impl Recorder for Recording {
    fn record(&mut self, tick: &Tick<'_>) {
        let scene_due = tick.now >= self.scene_due;
        if scene_due {
            self.scene_due = tick.now.plus_nanos(SCENE_PERIOD.0);
        }
        let p = tick.plan;
        let record = Record {
            now: tick.now,
            ego: *tick.ego,
            plan: Plan {
                path: if scene_due { p.path.clone() } else { Vec::new() },
                speed: Vec::new(),
                guard: p.guard.clone(),
                maneuver: p.maneuver,
                reason: p.reason,
                refusal: p.refusal,
                speed_status: p.speed_status,
                reference_speed_m_s: p.reference_speed_m_s,
                target_speed_m_s: p.target_speed_m_s,
                target_accel_m_s2: p.target_accel_m_s2,
                target_d_m: p.target_d_m,
                lateral_error_m: p.lateral_error_m,
                lane: p.lane,
                following: p.following,
                held_up: p.held_up,
                command: p.command,
            },
            scene: scene_due.then(|| tick.scene.clone()),
        };
        if !self.broken {
            self.broken = self.sender.send(record).is_err();
        }
    }
}

#[expect(clippy::disallowed_methods, reason = "the shell owns the writer's thread")]
fn spawn<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, Failure> {
    Ok(std::thread::spawn(work))
}

/// The open topics.
struct Tracks {
    file: McapFile,
    scenery: Scenery,
    flush_due: Time,
    lanes_due: Time,
    clock: Channel<Clock>,
    tf: Channel<TfMessage>,
    odometry: Channel<Odometry>,
    truck: Channel<TruckState>,
    plan: Channel<PlanState>,
    path: Channel<RosPath>,
    scene: Channel<RosScene>,
    markers: Channel<MarkerArray>,
    lanes: Channel<MarkerArray>,
    /// Where the road has a geo reference.
    fix: Option<Channel<NavSatFix>>,
}

impl Tracks {
    /// Opens the topics and writes what does not change: frames and the lines of the whole road.
    fn open(mut file: McapFile, scenery: Scenery) -> Result<Self, Failure> {
        let frames = file.latched("/tf_static")?;
        file.write(&frames, Time::ZERO, &telemetry::static_transforms(&scenery))?;
        let fix = scenery.geodesy.is_some().then(|| file.channel("/fix")).transpose()?;
        let mut tracks = Self {
            clock: file.channel("/clock")?,
            tf: file.channel("/tf")?,
            odometry: file.channel("/odom")?,
            truck: file.channel("/truck/state")?,
            plan: file.channel("/truck/plan")?,
            path: file.channel("/plan/path")?,
            scene: file.channel("/scene")?,
            markers: file.channel("/markers")?,
            lanes: file.latched("/road/lanes")?,
            fix,
            file,
            scenery,
            flush_due: FLUSH_PERIOD,
            lanes_due: LANES_PERIOD,
        };
        let length_m = tracks.scenery.road.length_m();
        tracks.write_lanes(Time::ZERO, &(0.0..length_m.min(LANES_AT_START_M)))?;
        if length_m > LANES_AT_START_M {
            tracks.lanes_due = Time::ZERO;
        }
        tracks.file.flush()?;
        Ok(tracks)
    }

    /// Writes until the sender is gone; also says up to when the file is whole.
    fn run(mut self, records: &Receiver<Record>) -> (McapFile, Time, Result<(), Failure>) {
        let mut kept = Time::ZERO;
        let written = self.write_all(records, &mut kept);
        (self.file, kept, written)
    }

    fn write_all(&mut self, records: &Receiver<Record>, kept: &mut Time) -> Result<(), Failure> {
        while let Ok(record) = records.recv() {
            self.write(&record)?;
            if record.now >= self.flush_due {
                self.flush_due = record.now.plus_nanos(FLUSH_PERIOD.0);
                self.file.flush()?;
                *kept = record.now;
            }
        }
        Ok(())
    }

    fn write(&mut self, record: &Record) -> Result<(), Failure> {
        let (now, tick, world) = (record.now, record.tick(), &self.scenery);
        let file = &mut self.file;
        file.write(&self.clock, now, &telemetry::clock(now))?;
        file.write(&self.tf, now, &telemetry::transforms(&tick, world))?;
        file.write(&self.odometry, now, &telemetry::odometry(&tick, world))?;
        file.write(&self.truck, now, &telemetry::truck_state(&tick, world))?;
        file.write(&self.plan, now, &telemetry::plan_state(&tick))?;
        if record.scene.is_none() {
            return Ok(());
        }
        file.write(&self.path, now, &telemetry::path(&tick, world))?;
        file.write(&self.scene, now, &telemetry::scene(&tick))?;
        file.write(&self.markers, now, &telemetry::markers(&tick, world))?;
        if let (Some(channel), Some(fix)) = (&self.fix, telemetry::fix(&tick, world)) {
            file.write(channel, now, &fix)?;
        }
        if now >= self.lanes_due {
            self.lanes_due = now.plus_nanos(LANES_PERIOD.0);
            let s_m = tick.ego.s_m;
            self.write_lanes(now, &(s_m - LANES_BEHIND_M..s_m + LANES_AHEAD_M))?;
        }
        Ok(())
    }

    /// The lane lines of a part of the road.
    fn write_lanes(&mut self, now: Time, stations_m: &Range<f64>) -> Result<(), Failure> {
        for message in telemetry::lane_markers(now, stations_m, &self.scenery) {
            self.file.write(&self.lanes, now, &message)?;
        }
        Ok(())
    }
}
