//! The inputs of the stack and of its bus out of a recording, in order.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use tractrix_core::{Neighbour, Stamped, Time, VehicleLimits};

use super::bus::{self, BusCall, SentFrame, frame_of, wish_of};
use super::scene::SceneReader;
use super::step::GivenStep;
use crate::error::RecordingError;
use crate::records::{Records, attachment_is_whole};
use crate::ros::input::{BusTick, CanFrame};
use crate::topic::{CAN_FRAMES, CAN_TICKS, CHANGES, INPUT, LIMITS, Topic, VEHICLES};
use crate::writer::GAP_RECORD;

/// Record of names and values about the bus, and its key of what the driver is set up with.
pub(crate) const BUS_RECORD: &str = "bus";
pub(crate) const DRIVER_KEY: &str = "driver";

/// What a recording says about its run.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct About {
    /// Records of names and values by their names: `run`, and `bus` of a drive over one.
    pub metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// Attached files by their names.
    pub files: BTreeMap<String, Vec<u8>>,
}

impl About {
    /// A value of a record.
    #[must_use]
    pub fn value(&self, record: &str, key: &str) -> Option<&str> {
        self.metadata.get(record)?.get(key).map(String::as_str)
    }

    /// What the truck's driver on its bus was set up with (JSON); none: it was not driven over one.
    #[must_use]
    pub fn driver_json(&self) -> Option<&str> {
        self.value(BUS_RECORD, DRIVER_KEY)
    }

    /// An attached text.
    #[must_use]
    pub fn text(&self, file: &str) -> Option<&str> {
        std::str::from_utf8(self.files.get(file)?).ok()
    }
}

/// What a channel of the file carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Input,
    Vehicles,
    Limits,
    Changes,
    Frames,
    Ticks,
}

/// An open recording.
pub struct Inputs {
    path: PathBuf,
    records: Records<BufReader<File>>,
    about: About,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Kind>,
    with_bus: bool,
    is_at_end: bool,
    gap_notes: u64,
    scenes: SceneReader,
    vehicles: Vec<Neighbour>,
    limits: Option<Box<VehicleLimits>>,
    changes: Vec<String>,
    call: BusCall,
    steps: VecDeque<GivenStep>,
    calls: VecDeque<BusCall>,
}

impl Inputs {
    /// Opens a file, with the readings of its bus or without.
    ///
    /// # Errors
    /// [`RecordingError::Read`] if it cannot be opened, is no recording of this program, or one
    /// without the stack's inputs.
    pub fn open(path: &Path, with_bus: bool) -> Result<Self, RecordingError> {
        let input = File::open(path).map_err(|e| RecordingError::read(path, e))?;
        let bytes = input.metadata().map_err(|e| RecordingError::read(path, e))?.len();
        let mut inputs = Self {
            path: path.to_owned(),
            records: Records::new(BufReader::new(input), bytes),
            about: About::default(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            with_bus,
            is_at_end: false,
            gap_notes: 0,
            scenes: SceneReader::default(),
            vehicles: Vec::new(),
            limits: None,
            changes: Vec::new(),
            call: BusCall::default(),
            steps: VecDeque::new(),
            calls: VecDeque::new(),
        };
        let first = inputs.records.next_record();
        if !matches!(first, Ok(Some((op::HEADER, _)))) {
            return Err(inputs.wrong("not an MCAP file"));
        }
        while inputs.steps.is_empty() && inputs.advance()? {}
        if !inputs.about.metadata.contains_key("run") {
            return Err(inputs.wrong("no recording of this program"));
        }
        if inputs.steps.is_empty() {
            return Err(inputs.wrong(
                "it has no /stack/input: it is of an earlier version, or nothing was driven",
            ));
        }
        Ok(inputs)
    }

    /// What the file says about its run.
    #[must_use]
    pub const fn about(&self) -> &About {
        &self.about
    }

    /// The next step of the stack; none at the end.
    ///
    /// # Errors
    /// [`RecordingError::Read`] if the file is damaged or torn.
    pub fn next_step(&mut self) -> Result<Option<GivenStep>, RecordingError> {
        while self.steps.is_empty() && self.advance()? {}
        Ok(self.steps.pop_front())
    }

    /// The next reading of the bus; none at the end.
    ///
    /// # Errors
    /// As [`Self::next_step`].
    pub fn next_call(&mut self) -> Result<Option<BusCall>, RecordingError> {
        while self.calls.is_empty() && self.advance()? {}
        Ok(self.calls.pop_front())
    }

    /// Notes that the recorder left out where the inputs end, because its disk was too slow; 0: they
    /// end with the drive.
    #[must_use]
    pub const fn gap_notes(&self) -> u64 {
        self.gap_notes
    }

    /// Takes the next record; false at the end.
    fn advance(&mut self) -> Result<bool, RecordingError> {
        if self.is_at_end {
            return Ok(false);
        }
        let Ok(Some((code, body))) = self.records.next_record() else {
            return Err(self.wrong("it is torn: `sim-server recover` saves what is whole"));
        };
        self.is_at_end = code == op::DATA_END;
        let is_damaged = code == op::ATTACHMENT && !attachment_is_whole(&body);
        match if is_damaged { None } else { mcap::parse_record(code, &body).ok() } {
            Some(record) => self.take(record)?,
            None => return Err(self.wrong("a record is damaged")),
        }
        Ok(!self.is_at_end)
    }

    fn wrong(&self, why: impl std::fmt::Display) -> RecordingError {
        RecordingError::read(&self.path, why)
    }

    fn take(&mut self, record: Record<'_>) -> Result<(), RecordingError> {
        match record {
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, String::from_utf8_lossy(&data).into_owned());
            }
            Record::Channel(channel) => {
                let Some((kind, topic)) = kind_of(&channel.topic) else { return Ok(()) };
                let schema = self.schemas.get(&channel.schema_id);
                if schema.is_none_or(|text| *text != topic.schema()) {
                    let name = &channel.topic;
                    return Err(self.wrong(format!("its {name} is of another version")));
                }
                self.channels.insert(channel.id, kind);
            }
            Record::Message { header, data } => {
                if let Some(kind) = self.channels.get(&header.channel_id).copied()
                    && self.message(kind, &data).is_none()
                {
                    let at_s = header.log_time as f64 * 1e-9;
                    return Err(self.wrong(format!("the message of {kind:?} at {at_s} s is wrong")));
                }
            }
            Record::Attachment { header, data, .. } => {
                self.about.files.insert(header.name, data.into_owned());
            }
            // The inputs after a gap are of a stack that has seen what is in it
            Record::Metadata(metadata) if metadata.name == GAP_RECORD => {
                self.is_at_end = true;
                let notes = metadata.metadata.get("notes").and_then(|n| n.parse().ok());
                self.gap_notes = notes.unwrap_or(u64::MAX);
            }
            Record::Metadata(metadata) => {
                self.about.metadata.insert(metadata.name, metadata.metadata);
            }
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, kind: Kind, cdr: &[u8]) -> Option<()> {
        match kind {
            Kind::Input => {
                let input = INPUT.decode(cdr)?;
                let step = input.step(&self.vehicles, self.limits.take())?;
                let changes = std::mem::take(&mut self.changes);
                self.steps.push_back(GivenStep { changes, ..step });
            }
            Kind::Vehicles => {
                self.vehicles = self.scenes.read(&VEHICLES.decode(cdr)?.differences)?;
            }
            Kind::Limits => {
                let sheet = LIMITS.decode(cdr)?.sheet_toml;
                self.limits = Some(Box::new(VehicleLimits::from_sheet("limits", &sheet).ok()?));
            }
            Kind::Changes => self.changes.push(CHANGES.decode(cdr)?.change_toml),
            Kind::Frames if self.with_bus => self.frame(&CAN_FRAMES.decode(cdr)?)?,
            Kind::Ticks if self.with_bus => self.end_call(CAN_TICKS.decode(cdr)?)?,
            Kind::Frames | Kind::Ticks => {}
        }
        Some(())
    }

    fn frame(&mut self, message: &CanFrame) -> Option<()> {
        let (frame, trouble) = frame_of(message)?;
        if message.header.frame_id == bus::SENT {
            self.call.sent.push(SentFrame { frame, trouble });
        } else {
            let heard = Stamped { time: message.header.stamp.time(), value: frame };
            self.call.received.push(trouble.map_or(Ok(heard), Err));
        }
        Some(())
    }

    /// Ends a reading, whose frames must all be there.
    fn end_call(&mut self, tick: BusTick) -> Option<()> {
        let call = std::mem::take(&mut self.call);
        let is_whole =
            call.received.len() == tick.received as usize && call.sent.len() == tick.sent as usize;
        let (now, wish) = (Time(tick.now_ns), wish_of(tick.wish)?);
        self.calls.push_back(BusCall { now, number: tick.number, wish, ..call });
        is_whole.then_some(())
    }
}

/// What a topic carries, and how it is defined.
fn kind_of(topic: &str) -> Option<(Kind, Topic)> {
    let of_bus = |end: &str| topic.starts_with("/can/") && topic.ends_with(end);
    let known = [
        (INPUT.topic, Kind::Input),
        (VEHICLES.topic, Kind::Vehicles),
        (LIMITS.topic, Kind::Limits),
        (CHANGES.topic, Kind::Changes),
    ];
    known
        .into_iter()
        .find(|(known, _)| known.name == topic)
        .or_else(|| of_bus("/frames").then_some((CAN_FRAMES.topic, Kind::Frames)))
        .or_else(|| of_bus("/ticks").then_some((CAN_TICKS.topic, Kind::Ticks)))
        .map(|(known, kind)| (kind, known))
}
