//! A whole file from one torn by a crash: everything up to the tear, in order, newly indexed.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Attachment, McapResult, Writer, parse_record};
use serde::Serialize;

use super::file::write_options;
use crate::failure::Failure;

/// What was kept.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct Recovered {
    /// The new file.
    pub(crate) file: PathBuf,
    pub(crate) schemas: u64,
    pub(crate) channels: u64,
    pub(crate) messages: u64,
    pub(crate) attachments: u64,
    pub(crate) metadata_records: u64,
    /// Time of the last kept message, s.
    pub(crate) last_message_time_s: f64,
    /// The file had no end: what came after the last kept record is lost.
    pub(crate) was_torn: bool,
}

/// Writes `NAME.recovered.mcap` beside `NAME.mcap`.
///
/// # Errors
/// [`Failure::Input`] when the file cannot be read, is no MCAP file, or the new one exists or
/// cannot be created; [`Failure::Work`] when writing fails.
pub(crate) fn recover(path: &Path) -> Result<Recovered, Failure> {
    let input = File::open(path).map_err(|e| Failure::file(path, e))?;
    let bytes = input.metadata().map_err(|e| Failure::file(path, e))?.len();
    let mut reader = Records::new(BufReader::new(input), bytes);
    match reader.next_record().map_err(|e| Failure::file(path, e))? {
        Some((op::HEADER, _)) => {}
        _ => return Err(Failure::file(path, "not an MCAP file")),
    }
    let target = path.with_extension("recovered.mcap");
    let output = File::create_new(&target).map_err(|e| Failure::writing(&target, &e))?;
    let failed = |e: mcap::McapError| {
        let _ = std::fs::remove_file(&target);
        Failure::writing(&target, &e)
    };
    let writer = write_options().create(BufWriter::new(output)).map_err(failed)?;
    let mut copy = Copy { writer, kept: Recovered { file: target.clone(), ..Default::default() } };
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

/// The records of a file in order, chunks opened.
pub(crate) struct Records<R> {
    input: R,
    reader: LinearReader,
}

impl<R: Read> Records<R> {
    /// Reads a file of so many bytes.
    pub(crate) fn new(input: R, file_bytes: u64) -> Self {
        let limit = usize::try_from(file_bytes).unwrap_or(usize::MAX);
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_record_length_limit(limit.max(MAX_CHUNKED_RECORD_BYTES));
        Self { input, reader: LinearReader::new_with_options(options) }
    }

    /// The next record's code and body; none at the end of the file.
    pub(crate) fn next_record(&mut self) -> McapResult<Option<(u8, Vec<u8>)>> {
        while let Some(event) = self.reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(bytes) => {
                    let got = self.input.read(self.reader.insert(bytes))?;
                    self.reader.notify_read(got);
                }
                LinearReadEvent::Record { data, opcode } => {
                    return Ok(Some((opcode, data.to_vec())));
                }
            }
        }
        Ok(None)
    }
}

/// A record inside a compressed chunk may be larger than a small file.
const MAX_CHUNKED_RECORD_BYTES: usize = 64 * 1024 * 1024;

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

/// Whether the lengths inside an attachment record fit the record: two times, name, media type,
/// data, CRC. The crate's parser relies on it.
pub(crate) fn attachment_is_whole(body: &[u8]) -> bool {
    let length_at = |at: usize, bytes: usize| -> Option<usize> {
        let field = body.get(at..at.checked_add(bytes)?)?;
        let value = field.iter().rev().fold(0_u64, |acc, &b| (acc << 8) | u64::from(b));
        usize::try_from(value).ok()
    };
    let end = || {
        let name = 16;
        let media_type = length_at(name, 4)?.checked_add(name + 4)?;
        let data = length_at(media_type, 4)?.checked_add(media_type + 4)?;
        length_at(data, 8)?.checked_add(data + 8)?.checked_add(4)
    };
    end().is_some_and(|end| end <= body.len())
}
