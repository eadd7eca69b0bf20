//! Writing the MCAP file: channels, messages, chunks.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use tractrix_core::Time;

use crate::error::RecordingError;
use crate::topic::{Topic, TopicMessage};

/// Options of every file that this program writes; one place, so that a recovered file is alike.
pub(crate) fn write_options() -> WriteOptions {
    WriteOptions::new()
        .profile("ros2")
        .library(format!("tractrix {}", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES))
}

const CHUNK_BYTES: u64 = 1024 * 1024;

/// Quality of service of a latched topic in rosbag2's words (`rmw_qos_profile_t`): keep the last,
/// reliable, transient local, no deadlines.
const LATCHED: &str = "\
- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
";

/// An open topic.
struct Channel {
    id: u16,
    sequence: u32,
}

/// What a recording is written to.
pub(crate) trait Disk: Write + Seek + Send {
    /// Returns when everything is on the disk.
    fn sync(&mut self) -> std::io::Result<()>;
}

impl Disk for BufWriter<File> {
    fn sync(&mut self) -> std::io::Result<()> {
        self.flush()?;
        match self.get_ref().sync_all() {
            // A pipe or device has nothing to sync.
            Err(e) if e.kind() != std::io::ErrorKind::InvalidInput => Err(e),
            _ => Ok(()),
        }
    }
}

/// An MCAP file under construction.
pub(crate) struct McapFile {
    path: PathBuf,
    writer: Writer<Box<dyn Disk>>,
    channels: BTreeMap<&'static str, Channel>,
    /// The file itself, where it is one.
    handle: Option<File>,
    /// How long it was when its last chunk was closed.
    whole_bytes: u64,
}

impl McapFile {
    /// Creates the file; it must be possible to write there.
    pub(crate) fn create(path: &Path) -> Result<Self, RecordingError> {
        let file = File::create(path).map_err(|e| RecordingError::write(path, e))?;
        let handle = file.try_clone().map_err(|e| RecordingError::write(path, e))?;
        let mut made = Self::on(path, Box::new(BufWriter::new(file)))?;
        made.handle = Some(handle);
        Ok(made)
    }

    /// The file on a disk.
    pub(crate) fn on(path: &Path, disk: Box<dyn Disk>) -> Result<Self, RecordingError> {
        let writer = write_options().create(disk).map_err(|e| RecordingError::write(path, e))?;
        Ok(Self {
            path: path.to_owned(),
            writer,
            channels: BTreeMap::new(),
            handle: None,
            whole_bytes: 0,
        })
    }

    /// Opens a topic.
    pub(crate) fn open(&mut self, topic: &Topic) -> Result<(), RecordingError> {
        self.open_as(topic, topic.name)
    }

    /// Opens a topic under a name that only this file has.
    pub(crate) fn open_as(&mut self, topic: &Topic, name: &str) -> Result<(), RecordingError> {
        let mut metadata = BTreeMap::new();
        if topic.is_latched {
            metadata.insert("offered_qos_profiles".to_owned(), LATCHED.to_owned());
        }
        let id = self
            .writer
            .add_schema(topic.type_name, "ros2msg", topic.schema().as_bytes())
            .and_then(|schema| self.writer.add_channel(schema, name, "cdr", &metadata))
            .map_err(|e| self.failed(e))?;
        self.channels.insert(topic.name, Channel { id, sequence: 0 });
        Ok(())
    }

    /// Writes one message at a simulation time; its topic must be open.
    pub(crate) fn write(
        &mut self,
        time: Time,
        message: &TopicMessage,
    ) -> Result<(), RecordingError> {
        let name = message.topic.name;
        let Some(channel) = self.channels.get_mut(name) else {
            return Err(RecordingError::Encode { topic: name, why: "it is not open".to_owned() });
        };
        channel.sequence = channel.sequence.wrapping_add(1);
        let time_ns = u64::try_from(time.0).unwrap_or_default();
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer
            .write_to_known_channel(&header, &message.cdr)
            .map_err(|e| RecordingError::write(&self.path, e))
    }

    /// Writes a record of names and values.
    pub(crate) fn metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), RecordingError> {
        let record = Metadata { name: name.to_owned(), metadata };
        self.writer.write_metadata(&record).map_err(|e| self.failed(e))
    }

    /// Attaches a file.
    pub(crate) fn attach(
        &mut self,
        name: &str,
        kind: &str,
        data: &[u8],
    ) -> Result<(), RecordingError> {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: kind.to_owned(),
            data: data.into(),
        };
        self.writer.attach(&attachment).map_err(|e| self.failed(e))
    }

    /// Closes the chunk and hands everything to the operating system.
    pub(crate) fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(|e| self.failed(e))?;
        self.whole_bytes = length_of(self.handle.as_ref(), &self.path)?;
        Ok(())
    }

    /// Cuts off what was written behind the last whole chunk: a full disk gets room for a summary.
    pub(crate) fn cut(self) {
        drop(self.writer);
        if let Some(file) = self.handle
            && self.whole_bytes > 0
        {
            // What cannot be cut is left out by `recover`
            let _ = file.set_len(self.whole_bytes);
        }
    }

    /// Writes the summary section; the file is whole after it.
    pub(crate) fn finish(mut self) -> Result<(), RecordingError> {
        self.writer.finish().map_err(|e| RecordingError::write(&self.path, e))?;
        self.writer.into_inner().sync().map_err(|e| RecordingError::write(&self.path, e))?;
        length_of(self.handle.as_ref(), &self.path).map(drop)
    }

    fn failed(&self, error: mcap::McapError) -> RecordingError {
        RecordingError::write(&self.path, error)
    }
}

/// Length of a file that is being written; 0 of what is none.
fn length_of(file: Option<&File>, path: &Path) -> Result<u64, RecordingError> {
    let Some(file) = file else { return Ok(0) };
    let now = file.metadata().map_err(|e| RecordingError::write(path, e))?;
    match now.is_file() && now.nlink() == 0 {
        true => Err(RecordingError::Gone { path: path.to_owned() }),
        false => Ok(now.len()),
    }
}
