//! Reading a recording: chosen fields of chosen topics, and what is attached, in the file's order.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use tractrix_core::Time;

use crate::error::RecordingError;
use crate::layout::Layout;
use crate::records::{Records, attachment_is_whole};

/// Fields of a topic that a reader wants.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// Name of the topic.
    pub topic: &'a str,
    /// Names of scalar fields (`pose.pose.position.x`) in the order of the message.
    pub fields: &'a [&'a str],
}

/// What a recording holds at one place.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A message of a wanted topic.
    Values {
        /// Index of the topic among those wanted.
        wanted: usize,
        /// Simulation time of the message.
        time: Time,
        /// Values of the wanted fields.
        values: Vec<f64>,
    },
    /// An attached file.
    Attachment {
        /// Its name.
        name: String,
        /// What is in it.
        data: Vec<u8>,
    },
    /// A record of names and values (`run` says what was driven).
    Record {
        /// Its name.
        name: String,
        /// Its values.
        values: BTreeMap<String, String>,
    },
}

/// An open recording.
pub struct Reader<'a> {
    path: PathBuf,
    records: Records<BufReader<File>>,
    wanted: &'a [Wanted<'a>],
    layouts: BTreeMap<u16, Layout>,
    channels: BTreeMap<u16, Channel>,
    is_at_end: bool,
}

/// A channel of the file that carries a wanted topic.
struct Channel {
    wanted: usize,
    layout: Layout,
    fields: Vec<usize>,
}

impl<'a> Reader<'a> {
    /// Opens a file for these fields; a topic that lacks one of its fields has no entries.
    ///
    /// # Errors
    /// [`RecordingError::Read`] when the file cannot be opened.
    pub fn open(path: &Path, wanted: &'a [Wanted<'a>]) -> Result<Self, RecordingError> {
        let input = File::open(path).map_err(|e| RecordingError::read(path, e))?;
        let bytes = input.metadata().map_err(|e| RecordingError::read(path, e))?.len();
        Ok(Self {
            path: path.to_owned(),
            records: Records::new(BufReader::new(input), bytes),
            wanted,
            layouts: BTreeMap::new(),
            channels: BTreeMap::new(),
            is_at_end: false,
        })
    }

    /// The next entry; none at the end of the data.
    ///
    /// # Errors
    /// [`RecordingError::Read`] when the file is no recording, or a record is damaged.
    pub fn next_entry(&mut self) -> Result<Option<Entry>, RecordingError> {
        while !self.is_at_end {
            let read = self.records.next_record();
            let Some((code, body)) = read.map_err(|e| RecordingError::read(&self.path, e))? else {
                break;
            };
            self.is_at_end = code == op::DATA_END;
            let is_damaged = code == op::ATTACHMENT && !attachment_is_whole(&body);
            let record = if is_damaged { None } else { mcap::parse_record(code, &body).ok() };
            let Some(record) = record else {
                return Err(RecordingError::read(&self.path, "a record is damaged"));
            };
            if let Some(entry) = self.take(record) {
                return Ok(Some(entry));
            }
        }
        Ok(None)
    }

    fn take(&mut self, record: Record<'_>) -> Option<Entry> {
        match record {
            Record::Schema { header, data } => {
                self.layouts.insert(header.id, Layout::of(&String::from_utf8_lossy(&data)));
                None
            }
            Record::Channel(c) => {
                let wanted = self.wanted.iter().position(|w| w.topic == c.topic)?;
                let layout = self.layouts.get(&c.schema_id)?.clone();
                let names = self.wanted.get(wanted)?.fields.iter();
                let fields = names.map(|name| layout.index(name)).collect::<Option<Vec<_>>>()?;
                self.channels.insert(c.id, Channel { wanted, layout, fields });
                None
            }
            Record::Message { header, data } => {
                let channel = self.channels.get(&header.channel_id)?;
                let values = channel.layout.read(&data, &channel.fields)?;
                let time = Time(i64::try_from(header.log_time).unwrap_or(i64::MAX));
                Some(Entry::Values { wanted: channel.wanted, time, values })
            }
            Record::Attachment { header, data, .. } => {
                Some(Entry::Attachment { name: header.name, data: data.into_owned() })
            }
            Record::Metadata(m) => Some(Entry::Record { name: m.name, values: m.metadata }),
            _ => None,
        }
    }
}
