//! A finished recording from any time on, by its index; a chunk at a time is in memory.

use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::sans_io::indexed_reader::{IndexedReadEvent, IndexedReader, IndexedReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use mcap::{McapResult, Summary};
use tractrix_core::Time;

use crate::error::RecordingError;
use crate::topic::TOPICS;

/// Longest chunk and record, bytes.
const MAX_BYTES: usize = 64 * 1024 * 1024;
/// Topics that are not latched have a message at least this often: what is older is not shown.
const LOOK_BACK_NS: i64 = 2_000_000_000;
/// Messages of a latched topic that are kept for who comes late, at most: the newest, which are the
/// pieces of a long road.
pub const MOST_LATCHED: usize = 256;

/// A channel of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlayedChannel {
    /// Number in the file.
    pub id: u16,
    /// Name of its topic.
    pub topic: String,
    /// Encoding of its messages (`cdr`).
    pub encoding: String,
    /// Name, encoding and text of its type's definition.
    pub schema: Option<(String, String, Vec<u8>)>,
    /// All its messages stay good, not the last one alone.
    pub is_latched: bool,
}

/// A message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlayedMessage {
    /// Number of its channel.
    pub channel: u16,
    /// Simulation time.
    pub time: Time,
    /// Its bytes as they are in the file.
    pub data: Vec<u8>,
}

/// An open recording.
pub struct Player {
    path: PathBuf,
    file: File,
    summary: Summary,
    span: [Time; 2],
    reader: IndexedReader,
    chunk: Vec<u8>,
}

impl Player {
    /// Opens a file at its first message.
    ///
    /// # Errors
    /// [`RecordingError::Read`]: it is no recording, has no end (its run drives still, or was torn),
    /// or no message.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let wrong = |why: &dyn std::fmt::Display| RecordingError::read(path, why);
        let mut file = File::open(path).map_err(|e| wrong(&e))?;
        let bytes = file.metadata().map_err(|e| wrong(&e))?.len();
        let no_end = "it has no end: its run is under way, or `sim-server recover` makes a whole \
                      file of it";
        let summary = match summary(&mut file, bytes) {
            Ok(Some(summary)) => summary,
            Ok(None) | Err(mcap::McapError::UnexpectedEof) => return Err(wrong(&no_end)),
            Err(mcap::McapError::BadMagic) if begins_as_one(&mut file) => {
                return Err(wrong(&no_end));
            }
            Err(e) => return Err(wrong(&e)),
        };
        let time = |ns: u64| Time(i64::try_from(ns).unwrap_or(i64::MAX));
        let span = match &summary.stats {
            Some(s) if s.message_count > 0 => [s.message_start_time, s.message_end_time].map(time),
            _ => return Err(wrong(&"it has no messages")),
        };
        let reader = IndexedReader::new_with_options(&summary, options()).map_err(|e| wrong(&e))?;
        Ok(Self { path: path.to_owned(), file, summary, span, reader, chunk: Vec::new() })
    }

    /// Its channels, by their topics.
    #[must_use]
    pub fn channels(&self) -> Vec<PlayedChannel> {
        let channel = |c: &std::sync::Arc<mcap::Channel<'static>>| PlayedChannel {
            id: c.id,
            topic: c.topic.clone(),
            encoding: c.message_encoding.clone(),
            is_latched: is_latched(&c.topic),
            schema: c
                .schema
                .as_ref()
                .map(|s| (s.name.clone(), s.encoding.clone(), s.data.to_vec())),
        };
        let mut all: Vec<_> = self.summary.channels.values().map(channel).collect();
        all.sort_by(|a, b| a.topic.cmp(&b.topic));
        all
    }

    /// Times of the first and the last message.
    #[must_use]
    pub const fn span(&self) -> [Time; 2] {
        self.span
    }

    /// The next message by its time, then by its place in the file; none at the end.
    ///
    /// # Errors
    /// [`RecordingError::Read`]: the file is damaged or cannot be read any more.
    pub fn next_message(&mut self) -> Result<Option<PlayedMessage>, RecordingError> {
        let Self { path, file, reader, chunk, .. } = self;
        next(file, reader, chunk).map_err(|e| RecordingError::read(path, e))
    }

    /// Goes on behind a time, and says what is to be seen then, by time: of every topic its last
    /// message up to this time, of latched ones all that are still good.
    ///
    /// # Errors
    /// As [`Self::next_message`].
    pub fn seek(&mut self, time: Time) -> Result<Vec<PlayedMessage>, RecordingError> {
        let at = |time: Time| u64::try_from(time.0).unwrap_or_default();
        let seen = options().ending_at(at(time));
        let mut kept = BTreeMap::new();
        let latched = self.channels().into_iter().filter(|c| c.is_latched).map(|c| c.topic);
        let latched: Vec<_> = latched.collect();
        if !latched.is_empty() {
            kept = self.newest(seen.clone().include_topics(latched), MOST_LATCHED)?;
        }
        let lately = Time(time.0.saturating_sub(LOOK_BACK_NS));
        for (channel, newest) in self.newest(seen.starting_at(at(lately)), 1)? {
            kept.entry(channel).or_insert(newest);
        }
        let behind = options().starting_after(at(time));
        let behind = IndexedReader::new_with_options(&self.summary, behind);
        self.reader = behind.map_err(|e| RecordingError::read(&self.path, e))?;
        let mut all: Vec<_> = kept.into_values().flatten().collect();
        all.sort_by_key(|message| message.time);
        Ok(all)
    }

    /// The newest messages of each channel, so many at most.
    fn newest(
        &mut self,
        wanted: IndexedReaderOptions,
        most: usize,
    ) -> Result<BTreeMap<u16, VecDeque<PlayedMessage>>, RecordingError> {
        let Self { path, file, summary, chunk, .. } = self;
        let wrong = |e| RecordingError::read(path, e);
        let mut reader = IndexedReader::new_with_options(summary, wanted).map_err(wrong)?;
        let mut newest: BTreeMap<u16, VecDeque<PlayedMessage>> = BTreeMap::new();
        while let Some(message) = next(file, &mut reader, chunk).map_err(wrong)? {
            let of_channel = newest.entry(message.channel).or_default();
            if of_channel.len() == most {
                of_channel.pop_front();
            }
            of_channel.push_back(message);
        }
        Ok(newest)
    }
}

/// Whether all messages of a topic stay good, not its last one alone.
fn is_latched(topic: &str) -> bool {
    TOPICS.iter().any(|known| known.name == topic && known.is_latched)
}

fn options() -> IndexedReaderOptions {
    IndexedReaderOptions::new().with_record_length_limit(MAX_BYTES)
}

/// Whether a file begins as a recording does.
fn begins_as_one(file: &mut File) -> bool {
    let mut first = [0; mcap::MAGIC.len()];
    file.rewind().and_then(|()| file.read_exact(&mut first)).is_ok() && first == *mcap::MAGIC
}

fn summary(file: &mut File, bytes: u64) -> McapResult<Option<Summary>> {
    let options = SummaryReaderOptions::default();
    let options = options.with_file_size(bytes).with_record_length_limit(MAX_BYTES);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            SummaryReadEvent::ReadRequest(bytes) => {
                let got = file.read(reader.insert(bytes))?;
                reader.notify_read(got);
            }
            SummaryReadEvent::SeekRequest(to) => reader.notify_seeked(file.seek(to)?),
        }
    }
    Ok(reader.finish())
}

fn next(
    file: &mut File,
    reader: &mut IndexedReader,
    chunk: &mut Vec<u8>,
) -> McapResult<Option<PlayedMessage>> {
    while let Some(event) = reader.next_event() {
        match event? {
            IndexedReadEvent::ReadChunkRequest { offset, length } => {
                file.seek(SeekFrom::Start(offset))?;
                chunk.resize(length, 0);
                file.read_exact(chunk)?;
                reader.insert_chunk_record_data(offset, chunk)?;
            }
            IndexedReadEvent::Message { header, data } => {
                let time = Time(i64::try_from(header.log_time).unwrap_or(i64::MAX));
                let channel = header.channel_id;
                return Ok(Some(PlayedMessage { channel, time, data: data.to_vec() }));
            }
        }
    }
    Ok(None)
}
