//! The recorder of the main job: owned ticks over a bounded channel to the writer's thread.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use tractrix_core::{EgoState, Plan, Recorder, Scene, Step, Tick, Time};

use crate::error::RecordingError;
use crate::file::McapFile;
use crate::inputs::{BusCall, BusTrace, SceneWriter, StepNote, StepNotes, call_messages};
use crate::ros::input::{StackLimits, StackScene};
use crate::schedule::{Due, Schedule};
use crate::telemetry::{Scenery, lanes_at_start, messages, static_frames};
use crate::topic::{CAN_FRAMES, CAN_TICKS, FIX, INPUT, LIMITS, TOPICS, VEHICLES};

/// What a recording says about its run.
pub struct RunHeader {
    /// Name and value: seed, version, revision, start of the run.
    pub metadata: BTreeMap<String, String>,
    /// The scenario as it was run, where there was one.
    pub scenario_toml: Option<String>,
    /// The stack's configuration.
    pub stack_toml: String,
    /// What does not change during the run.
    pub scenery: Scenery,
    /// The bus that the truck is driven over.
    pub bus: Option<BusHeader>,
}

/// What a recording says about the bus that the truck is driven over.
pub struct BusHeader {
    /// Its name: the frames are on `/can/NAME/frames`.
    pub name: String,
    /// Name and value: bit rate, configuration of the driver.
    pub metadata: BTreeMap<String, String>,
    /// What goes over it.
    pub trace: BusTrace,
}

/// Ticks and steps in flight to the writer; the world waits when the writer is this far behind.
const QUEUE: usize = 1024;
/// Chunks are closed this often (simulated).
const FLUSH_PERIOD: Time = Time(1_000_000_000);

/// What is on its way to the writer.
enum Note {
    Tick(Box<Record>),
    Step(Time, Result<Box<StepNote>, RecordingError>),
    Calls(Vec<BusCall>),
}

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
    sender: SyncSender<Note>,
    path: PathBuf,
    thread: JoinHandle<(McapFile, Time, Result<(), RecordingError>)>,
    broken: bool,
    schedule: Schedule,
    steps: StepNotes,
    trace: Option<BusTrace>,
}

impl Recording {
    /// Creates the file, writes what is known before the first tick, and starts the writer.
    ///
    /// # Errors
    /// [`RecordingError`] when the file cannot be created.
    pub fn create(path: &Path, header: RunHeader) -> Result<Self, RecordingError> {
        let mut file = McapFile::create(path)?;
        file.metadata("run", header.metadata)?;
        if let Some(scenario_toml) = &header.scenario_toml {
            file.attach("scenario.toml", "application/toml", scenario_toml.as_bytes())?;
        }
        file.attach("stack.toml", "application/toml", header.stack_toml.as_bytes())?;
        let schedule = Schedule::new(&header.scenery.road);
        let mut trace = None;
        if let Some(bus) = header.bus {
            file.metadata("bus", bus.metadata)?;
            trace = Some((bus.trace, bus.name));
        }
        let name = trace.as_ref().map(|(_, name)| name.as_str());
        let writer = Writer::open(file, header.scenery, name)?;
        let trace = trace.map(|(trace, _)| trace);
        let (sender, receiver) = sync_channel(QUEUE);
        #[expect(clippy::disallowed_methods, reason = "a recording owns its writer's thread")]
        let thread = std::thread::spawn(move || writer.run(&receiver));
        let (path, steps) = (path.to_owned(), StepNotes::default());
        Ok(Self { sender, path, thread, broken: false, schedule, steps, trace })
    }

    fn send(&mut self, note: Note) {
        if !self.broken {
            self.broken = self.sender.send(note).is_err();
        }
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
    pub fn finish(mut self, summary_json: &str) -> Result<(), Torn> {
        if let Some(trace) = self.trace.take() {
            self.send(Note::Calls(trace.take_all()));
        }
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
        self.send(Note::Tick(Box::new(record)));
    }

    fn step(&mut self, step: &Step<'_>) {
        let calls = self.trace.as_ref().map(BusTrace::take).filter(|calls| !calls.is_empty());
        if let Some(calls) = calls {
            self.send(Note::Calls(calls));
        }
        let note = self.steps.note(step).map(Box::new);
        self.send(Note::Step(step.now, note));
    }
}

/// The writer's side.
struct Writer {
    file: McapFile,
    scenery: Scenery,
    flush_due: Time,
    scenes: SceneWriter,
}

impl Writer {
    /// Opens the topics and writes what does not change: frames and the lines of the road. The
    /// frames' message comes before the other topics are opened.
    fn open(
        mut file: McapFile,
        scenery: Scenery,
        bus: Option<&str>,
    ) -> Result<Self, RecordingError> {
        let [frames, others @ ..] = &TOPICS;
        file.open(frames)?;
        file.write(Time::ZERO, &static_frames(&scenery)?)?;
        for topic in others.iter().filter(|t| scenery.geodesy.is_some() || **t != FIX.topic) {
            file.open(topic)?;
        }
        if let Some(name) = bus {
            file.open_as(&CAN_FRAMES.topic, &format!("/can/{name}/frames"))?;
            file.open_as(&CAN_TICKS.topic, &format!("/can/{name}/ticks"))?;
        }
        for message in lanes_at_start(&scenery)? {
            file.write(Time::ZERO, &message)?;
        }
        file.flush()?;
        Ok(Self { file, scenery, flush_due: FLUSH_PERIOD, scenes: SceneWriter::default() })
    }

    /// Writes until the sender is gone; also says up to when the file is whole.
    fn run(mut self, notes: &Receiver<Note>) -> (McapFile, Time, Result<(), RecordingError>) {
        let mut kept = Time::ZERO;
        let written = self.write_all(notes, &mut kept);
        (self.file, kept, written)
    }

    fn write_all(&mut self, notes: &Receiver<Note>, kept: &mut Time) -> Result<(), RecordingError> {
        while let Ok(note) = notes.recv() {
            match note {
                Note::Calls(calls) => {
                    for call in &calls {
                        for message in call_messages(call)? {
                            self.file.write(call.now, &message)?;
                        }
                    }
                }
                Note::Step(now, note) => self.write_step(now, *note?)?,
                Note::Tick(record) => {
                    let Record { now, ego, plan, scene, due } = *record;
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
            }
        }
        Ok(())
    }

    /// The step's messages: what it refers to comes before it.
    fn write_step(&mut self, now: Time, note: StepNote) -> Result<(), RecordingError> {
        let now_ns = now.0;
        if let Some(sheet_toml) = note.sheet_toml {
            self.file.write(now, &LIMITS.encode(&StackLimits { now_ns, sheet_toml })?)?;
        }
        if let Some(vehicles) = note.vehicles {
            let differences = self.scenes.write(&vehicles);
            self.file.write(now, &VEHICLES.encode(&StackScene { now_ns, differences })?)?;
        }
        self.file.write(now, &INPUT.encode(&note.input)?)
    }
}
