//! Writing the MCAP file: channels, CDR, chunks.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use byteorder::LittleEndian;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use tractrix_core::Time;

use super::ros::Message;
use super::ros::schema::schema_text;
use crate::failure::Failure;
use crate::provenance::VERSION;

/// Options of every file that this program writes; one place, so that a recovered file is alike.
pub(super) fn write_options() -> WriteOptions {
    WriteOptions::new()
        .profile("ros2")
        .library(format!("tractrix {VERSION}"))
        .compression(Some(Compression::Zstd))
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES))
}

const CHUNK_BYTES: u64 = 1024 * 1024;
/// CDR, little endian, plain (OMG DDSI-RTPS 2.3, 10.5).
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

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

/// A topic with its message type, open for writing.
#[derive(Debug)]
pub(super) struct Channel<M> {
    id: u16,
    message: std::marker::PhantomData<fn(M)>,
}

/// An MCAP file under construction.
pub(super) struct McapFile {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    sequence: BTreeMap<u16, u32>,
    buffer: Vec<u8>,
}

impl McapFile {
    /// Creates the file; it must be possible to write there.
    pub(super) fn create(path: &Path) -> Result<Self, Failure> {
        let file = File::create(path).map_err(|e| Failure::writing(path, &e))?;
        let writer =
            write_options().create(BufWriter::new(file)).map_err(|e| Failure::writing(path, &e))?;
        Ok(Self { path: path.to_owned(), writer, sequence: BTreeMap::new(), buffer: Vec::new() })
    }

    /// Opens a topic.
    pub(super) fn channel<M: Message>(&mut self, topic: &str) -> Result<Channel<M>, Failure> {
        self.channel_with(topic, &BTreeMap::new())
    }

    /// Opens a topic whose last message a late subscriber gets.
    pub(super) fn latched<M: Message>(&mut self, topic: &str) -> Result<Channel<M>, Failure> {
        let profiles = ("offered_qos_profiles".to_owned(), LATCHED.to_owned());
        self.channel_with(topic, &BTreeMap::from([profiles]))
    }

    fn channel_with<M: Message>(
        &mut self,
        topic: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<Channel<M>, Failure> {
        let text = schema_text(M::DEFINITION)
            .ok_or_else(|| Failure::Work(format!("no definition of {}", M::DEFINITION)))?;
        let id = self
            .writer
            .add_schema(M::NAME, "ros2msg", text.as_bytes())
            .and_then(|schema| self.writer.add_channel(schema, topic, "cdr", metadata))
            .map_err(|e| self.failed(e))?;
        Ok(Channel { id, message: std::marker::PhantomData })
    }

    /// Writes one message at a simulation time.
    pub(super) fn write<M: Message>(
        &mut self,
        channel: &Channel<M>,
        time: Time,
        message: &M,
    ) -> Result<(), Failure> {
        self.buffer.clear();
        self.buffer.extend_from_slice(&ENCAPSULATION);
        cdr_encoding::to_writer::<M, LittleEndian, _>(&mut self.buffer, message)
            .map_err(|e| self.failed(e))?;
        let sequence = self.sequence.entry(channel.id).or_default();
        *sequence = sequence.wrapping_add(1);
        let time_ns = u64::try_from(time.0).unwrap_or_default();
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: *sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer.write_to_known_channel(&header, &self.buffer).map_err(|e| self.failed(e))
    }

    /// Writes a record of names and values.
    pub(super) fn metadata(
        &mut self,
        name: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<(), Failure> {
        let record = Metadata { name: name.to_owned(), metadata };
        self.writer.write_metadata(&record).map_err(|e| self.failed(e))
    }

    /// Attaches a file.
    pub(super) fn attach(&mut self, name: &str, kind: &str, data: &[u8]) -> Result<(), Failure> {
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
    pub(super) fn flush(&mut self) -> Result<(), Failure> {
        self.writer.flush().map_err(|e| self.failed(e))
    }

    /// Writes the summary section; the file is whole after it.
    pub(super) fn finish(mut self) -> Result<(), Failure> {
        self.writer.finish().map_err(|e| Failure::writing(&self.path, &e))?;
        let file = self.writer.into_inner().into_inner();
        let file = file.map_err(|e| Failure::writing(&self.path, e.error()))?;
        match file.sync_all() {
            // A pipe or device has nothing to sync.
            Err(e) if e.kind() != std::io::ErrorKind::InvalidInput => {
                Err(Failure::writing(&self.path, &e))
            }
            _ => Ok(()),
        }
    }

    fn failed(&self, error: impl std::error::Error + 'static) -> Failure {
        Failure::writing(&self.path, &error)
    }
}
