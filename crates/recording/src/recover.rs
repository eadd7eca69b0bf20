//! A whole file from one torn by a crash: everything up to the tear, in order, newly indexed.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::{Attachment, McapResult, Writer, parse_record};
use serde::Serialize;

use crate::error::RecordingError;
use crate::file::write_options;
use crate::records::{Records, attachment_is_whole};

/// What was kept.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Recovered {
    /// The new file.
    pub file: PathBuf,
    /// Message types.
    pub schemas: u64,
    /// Topics.
    pub channels: u64,
    /// Messages.
    pub messages: u64,
    /// Attached files.
    pub attachments: u64,
    /// Records of names and values.
    pub metadata_records: u64,
    /// Time of the last kept message, s.
    pub last_message_time_s: f64,
    /// The file had no end: what came after the last kept record is lost.
    pub was_torn: bool,
}

/// Writes `NAME.recovered.mcap` beside `NAME.mcap`.
///
/// # Errors
/// [`RecordingError::Read`] when the file cannot be read or is no MCAP file;
/// [`RecordingError::Write`] when the new one exists or cannot be written.
pub fn recover(path: &Path) -> Result<Recovered, RecordingError> {
    recover_into(path, &path.with_extension("recovered.mcap"))
}

/// As [`recover`], into a file of that name. The recording may still be written to.
///
/// # Errors
/// As [`recover`].
pub fn recover_into(path: &Path, target: &Path) -> Result<Recovered, RecordingError> {
    let input = File::open(path).map_err(|e| RecordingError::read(path, e))?;
    let bytes = input.metadata().map_err(|e| RecordingError::read(path, e))?.len();
    let mut reader = Records::new(BufReader::new(input), bytes);
    match reader.next_record().map_err(|e| RecordingError::read(path, e))? {
        Some((op::HEADER, _)) => {}
        _ => return Err(RecordingError::read(path, "not an MCAP file")),
    }
    let output = File::create_new(target).map_err(|e| RecordingError::write(target, e))?;
    let failed = |e: mcap::McapError| {
        let _ = std::fs::remove_file(target);
        RecordingError::write(target, e)
    };
    let writer = write_options().create(BufWriter::new(output)).map_err(failed)?;
    let mut copy =
        Copy { writer, kept: Recovered { file: target.to_owned(), ..Default::default() } };
    loop {
        match reader.next_record() {
            Ok(Some((op::DATA_END, _))) => break,
            Ok(Some((opcode, body))) => {
                if !copy.record(opcode, &body).map_err(failed)? {
                    copy.kept.was_torn = true;
                    break;
                }
            }
            Ok(None) | Err(_) => {
                copy.kept.was_torn = true;
                break;
            }
        }
    }
    copy.writer.finish().map_err(failed)?;
    Ok(copy.kept)
}

struct Copy {
    writer: Writer<BufWriter<File>>,
    kept: Recovered,
}

impl Copy {
    /// Copies one record; false when it is damaged.
    fn record(&mut self, opcode: u8, body: &[u8]) -> McapResult<bool> {
        if opcode == op::ATTACHMENT && !attachment_is_whole(body) {
            return Ok(false);
        }
        let Ok(record) = parse_record(opcode, body) else { return Ok(false) };
        match record {
            Record::Schema { header, data } => {
                let (name, encoding) = (&header.name, &header.encoding);
                self.writer.add_schema_with_id(header.id, name, encoding, &data)?;
                self.kept.schemas += 1;
            }
            Record::Channel(c) => {
                let encoding = &c.message_encoding;
                let (id, schema) = (c.id, c.schema_id);
                self.writer.add_channel_with_id(id, schema, &c.topic, encoding, &c.metadata)?;
                self.kept.channels += 1;
            }
            Record::Message { header, data } => {
                self.writer.write_to_known_channel(&header, &data)?;
                self.kept.messages += 1;
                self.kept.last_message_time_s = header.log_time as f64 * 1e-9;
            }
            Record::Attachment { header, data, .. } => {
                self.writer.attach(&Attachment {
                    log_time: header.log_time,
                    create_time: header.create_time,
                    name: header.name,
                    media_type: header.media_type,
                    data,
                })?;
                self.kept.attachments += 1;
            }
            Record::Metadata(metadata) => {
                self.writer.write_metadata(&metadata)?;
                self.kept.metadata_records += 1;
            }
            _ => {}
        }
        Ok(true)
    }
}
