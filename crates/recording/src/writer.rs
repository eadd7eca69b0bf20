//! The writer's side of a recording: notes from the run to messages in the file.

use std::sync::mpsc::Receiver;

use tractrix_core::{EgoState, Plan, Scene, Tick, Time};

use crate::error::RecordingError;
use crate::file::McapFile;
use crate::inputs::{BusCall, SceneWriter, StepNote, call_messages};
use crate::recorder::Listener;
use crate::ros::input::{StackChange, StackLimits, StackScene};
use crate::schedule::Due;
use crate::telemetry::{Scenery, lanes_at_start, messages, static_frames};
use crate::topic::{
    CAN_FRAMES, CAN_TICKS, CHANGES, FIX, INPUT, LIMITS, TOPICS, TopicMessage, VEHICLES,
};

/// Name of the record that says how many notes were left out at its place.
pub(crate) const GAP_RECORD: &str = "gap";
/// Chunks are closed this often (simulated).
const FLUSH_PERIOD: Time = Time(500_000_000);

/// A note in the queue.
pub(crate) struct Queued {
    /// Notes before it that the queue had no room for.
    pub(crate) gap_notes: u64,
    pub(crate) note: Note,
}

/// What is on its way to the writer.
pub(crate) enum Note {
    Tick(Box<Record>),
    Step(Time, Result<Box<StepNote>, RecordingError>),
    Calls(Vec<BusCall>),
    /// A change of the stack in words.
    Change(Time, String),
}

/// One tick on its way to the writer.
pub(crate) struct Record {
    pub(crate) now: Time,
    pub(crate) ego: EgoState,
    /// Without its speed profile, and without its path where the scene is not due.
    pub(crate) plan: Plan,
    /// Empty where it is not due.
    pub(crate) scene: Scene,
    pub(crate) due: Due,
}

/// What comes after the last note.
pub(crate) struct RunEnd {
    /// Notes after the last one that the queue had no room for.
    pub(crate) gap_notes: u64,
    pub(crate) summary_json: String,
}

/// The writer, in its thread.
pub(crate) struct Writer {
    file: McapFile,
    scenery: Scenery,
    flush_due: Time,
    scenes: SceneWriter,
    listener: Option<Listener>,
}

impl Writer {
    /// Opens the topics and writes what does not change: frames and the lines of the road. The
    /// frames' message comes before the other topics are opened.
    pub(crate) fn open(
        mut file: McapFile,
        scenery: Scenery,
        bus: Option<&str>,
        mut listener: Option<Listener>,
    ) -> Result<Self, RecordingError> {
        let [frames, others @ ..] = &TOPICS;
        let mut telling = |message: &TopicMessage| {
            if let Some(listener) = &mut listener {
                listener(Time::ZERO, message);
            }
        };
        file.open(frames)?;
        let message = static_frames(&scenery)?;
        file.write(Time::ZERO, &message)?;
        telling(&message);
        for topic in others.iter().filter(|t| scenery.geodesy.is_some() || **t != FIX.topic) {
            file.open(topic)?;
        }
        if let Some(name) = bus {
            file.open_as(&CAN_FRAMES.topic, &format!("/can/{name}/frames"))?;
            file.open_as(&CAN_TICKS.topic, &format!("/can/{name}/ticks"))?;
        }
        for message in lanes_at_start(&scenery)? {
            file.write(Time::ZERO, &message)?;
            telling(&message);
        }
        file.flush()?;
        let (flush_due, scenes) = (FLUSH_PERIOD, SceneWriter::default());
        Ok(Self { file, scenery, flush_due, scenes, listener })
    }

    /// Writes until the sender is gone, then the end if there is one; says up to when the file is
    /// whole.
    pub(crate) fn run(
        mut self,
        notes: &Receiver<Queued>,
        end: &Receiver<RunEnd>,
    ) -> (Time, Result<(), RecordingError>) {
        let mut kept = Time::ZERO;
        let written = self.write_all(notes, &mut kept);
        let written = match (written, end.try_recv()) {
            (Ok(()), Ok(end)) => self.finish(&end),
            (Err(why @ RecordingError::Write { .. }), _) => {
                self.file.cut();
                Err(why)
            }
            (written, _) => written,
        };
        let is_gone = matches!(written, Err(RecordingError::Gone { .. }));
        (if is_gone { Time::ZERO } else { kept }, written)
    }

    fn finish(mut self, end: &RunEnd) -> Result<(), RecordingError> {
        self.note_gap(end.gap_notes)?;
        self.file.attach("summary.json", "application/json", end.summary_json.as_bytes())?;
        self.file.finish()
    }

    /// Says that notes were left out here.
    fn note_gap(&mut self, gap_notes: u64) -> Result<(), RecordingError> {
        if gap_notes == 0 {
            return Ok(());
        }
        self.file.metadata(GAP_RECORD, [("notes".to_owned(), gap_notes.to_string())].into())
    }

    fn write_all(
        &mut self,
        notes: &Receiver<Queued>,
        kept: &mut Time,
    ) -> Result<(), RecordingError> {
        while let Ok(Queued { gap_notes, note }) = notes.recv() {
            self.note_gap(gap_notes)?;
            match note {
                Note::Calls(calls) => {
                    for call in &calls {
                        for message in call_messages(call)? {
                            self.file.write(call.now, &message)?;
                            if let Some(listener) = &mut self.listener
                                && message.topic == CAN_FRAMES.topic
                            {
                                listener(call.now, &message);
                            }
                        }
                    }
                }
                Note::Change(now, change_toml) => {
                    let message = CHANGES.encode(&StackChange { now_ns: now.0, change_toml })?;
                    self.file.write(now, &message)?;
                }
                Note::Step(now, note) => self.write_step(now, *note?)?,
                Note::Tick(record) => {
                    let Record { now, ego, plan, scene, due } = *record;
                    let tick = Tick { now, ego: &ego, scene: &scene, plan: &plan };
                    for message in messages(&tick, &self.scenery, due)? {
                        self.file.write(now, &message)?;
                        if let Some(listener) = &mut self.listener {
                            listener(now, &message);
                        }
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
