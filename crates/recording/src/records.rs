//! The records of an MCAP file one by one, also of a torn one.

use std::io::Read;

use mcap::McapResult;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

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
