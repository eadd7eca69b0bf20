//! The recorder of the main job: owned ticks over a bounded channel to the writer's thread.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use tractrix_core::{EgoState, Plan, Recorder, Scene, Tick, Time};

use crate::error::RecordingError;
use crate::file::McapFile;
use crate::schedule::{Due, Schedule};
use crate::telemetry::{Scenery, lanes_at_start, messages, static_frames};
use crate::topic::{FIX, TOPICS};

/// What a recording says about its run.
pub struct RunHeader {
    /// Name and value: seed, version, revision, start of the run.
    pub metadata: BTreeMap<String, String>,
    /// The scenario as it was run.
    pub scenario_toml: String,
    /// What does not change during the run.
    pub scenery: Scenery,
}

/// Ticks in flight to the writer; the world waits when the writer is this far behind.
const QUEUE_TICKS: usize = 512;
/// Chunks are closed this often (simulated).
const FLUSH_PERIOD: Time = Time(1_000_000_000);

/// One tick on its way to the writer.
struct Record {
    now: Time,
    ego: EgoState,
    /// Without its speed profile, and without its path where the scene is not due.
    plan: Plan,
    /// Empty where it is not due.
    scene: Scene,
    due: Due,
}

/// A recording under way.
pub struct Recording {
    sender: SyncSender<Record>,
    path: PathBuf,
    thread: JoinHandle<(McapFile, Time, Result<(), RecordingError>)>,
    broken: bool,
    schedule: Schedule,
}

impl Recording {
    /// Creates the file, writes what is known before the first tick, and starts the writer.
    ///
    /// # Errors
    /// [`RecordingError`] when the file cannot be created.
    pub fn create(path: &Path, header: RunHeader) -> Result<Self, RecordingError> {
        let mut file = McapFile::create(path)?;
        file.metadata("run", header.metadata)?;
        file.attach("scenario.toml", "application/toml", header.scenario_toml.as_bytes())?;
        let schedule = Schedule::new(&header.scenery.road);
        let writer = Writer::open(file, header.scenery)?;
        let (sender, receiver) = sync_channel(QUEUE_TICKS);
        #[expect(clippy::disallowed_methods, reason = "a recording owns its writer's thread")]
        let thread = std::thread::spawn(move || writer.run(&receiver));
        Ok(Self { sender, path: path.to_owned(), thread, broken: false, schedule })
    }

    /// Whether the writer has given up; the run must end, [`Self::finish`] says why.
    #[must_use]
    pub const fn is_broken(&self) -> bool {
        self.broken
    }

    /// Waits until everything is written, attaches the summary and closes the file.
    ///
    /// # Errors
    /// [`Torn`] with the file and what went wrong, at whatever tick it did.
    pub fn finish(self, summary_json: &str) -> Result<(), Torn> {
        drop(self.sender);
        let path = self.path;
        let Ok((mut file, kept, written)) = self.thread.join() else {
            return Err(Torn { why: RecordingError::Panicked, path, kept_s: 0.0 });
        };
        written
            .and_then(|()| file.attach("summary.json", "application/json", summary_json.as_bytes()))
            .and_then(|()| file.finish())
            .map_err(|why| Torn { why, path, kept_s: kept.seconds() })
    }
}

/// A recording without an end.
#[derive(Debug)]
pub struct Torn {
    /// What went wrong.
    pub why: RecordingError,
    /// The file.
    pub path: PathBuf,
    /// Simulated time up to which it is whole, s.
    pub kept_s: f64,
}

impl Recorder for Recording {
    fn record(&mut self, tick: &Tick<'_>) {
        let due = self.schedule.due(tick.now);
        let p = tick.plan;
        let record = Record {
            now: tick.now,
            ego: *tick.ego,
            plan: Plan {
                path: if due.scene { p.path.clone() } else { Vec::new() },
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
            scene: if due.scene { tick.scene.clone() } else { Scene::default() },
            due,
        };
        if !self.broken {
            self.broken = self.sender.send(record).is_err();
        }
    }
}

/// The writer's side.
struct Writer {
    file: McapFile,
    scenery: Scenery,
    flush_due: Time,
}

impl Writer {
    /// Opens the topics and writes what does not change: frames and the lines of the road. The
    /// frames' message comes before the other topics are opened.
    fn open(mut file: McapFile, scenery: Scenery) -> Result<Self, RecordingError> {
        let [frames, others @ ..] = &TOPICS;
        file.open(frames)?;
        file.write(Time::ZERO, &static_frames(&scenery)?)?;
        for topic in others.iter().filter(|t| scenery.geodesy.is_some() || **t != FIX.topic) {
            file.open(topic)?;
        }
        for message in lanes_at_start(&scenery)? {
            file.write(Time::ZERO, &message)?;
        }
        file.flush()?;
        Ok(Self { file, scenery, flush_due: FLUSH_PERIOD })
    }

    /// Writes until the sender is gone; also says up to when the file is whole.
    fn run(mut self, records: &Receiver<Record>) -> (McapFile, Time, Result<(), RecordingError>) {
        let mut kept = Time::ZERO;
        let written = self.write_all(records, &mut kept);
        (self.file, kept, written)
    }

    fn write_all(
        &mut self,
        records: &Receiver<Record>,
        kept: &mut Time,
    ) -> Result<(), RecordingError> {
        while let Ok(Record { now, ego, plan, scene, due }) = records.recv() {
            let tick = Tick { now, ego: &ego, scene: &scene, plan: &plan };
            for message in messages(&tick, &self.scenery, due)? {
                self.file.write(now, &message)?;
            }
            if now >= self.flush_due {
                self.flush_due = now.plus_nanos(FLUSH_PERIOD.0);
                self.file.flush()?;
                *kept = now;
            }
        }
        Ok(())
    }
}
