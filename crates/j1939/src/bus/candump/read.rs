//! Reads a log line by line.

use std::io::{BufRead, Read};

use tractrix_core::{Stamped, Time};

use super::line::{self, What};
use crate::Frame;
use crate::bus::BusError;

/// Longest line, bytes: candump writes 120 at most.
const LINE_BYTES: usize = 256;
/// Channels in a log.
const CHANNELS: usize = 64;

/// A frame of a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// Index in [`Reader::channels`].
    pub channel: usize,
    /// The frame with its time in the log. A line without a time has that of the line before.
    pub heard: Stamped<Frame>,
}

/// What a log has besides J1939 frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Skipped {
    /// Frames with 11-bit identifiers.
    pub standard: u64,
    /// Remote frames.
    pub remote: u64,
    /// Error frames of the controller.
    pub error: u64,
}

/// The frames of a log in the order of the file, whatever their times are. After an error there is
/// nothing more.
#[derive(Debug)]
pub struct Reader<R> {
    input: R,
    line: u64,
    bytes: Vec<u8>,
    latest: Time,
    channels: Vec<String>,
    skipped: Skipped,
    over: bool,
}

impl<R: BufRead> Reader<R> {
    /// A reader at the start of a log.
    pub fn new(input: R) -> Self {
        let skipped = Skipped { standard: 0, remote: 0, error: 0 };
        let (bytes, channels) = (Vec::new(), Vec::new());
        Self { input, line: 0, bytes, latest: Time::ZERO, channels, skipped, over: false }
    }

    /// Names of the channels seen so far, in the order in which they came.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// What was skipped so far.
    pub const fn skipped(&self) -> Skipped {
        self.skipped
    }

    /// The next J1939 frame; none at the end.
    fn advance(&mut self) -> Result<Option<Entry>, BusError> {
        while self.read_line()? {
            let wrong = |why: String| BusError::Line { line: self.line, why };
            let text = text_of(&self.bytes).map_err(wrong)?;
            if text.trim_ascii().is_empty() {
                continue;
            }
            let line = line::parse(text).map_err(wrong)?;
            self.latest = line.time.unwrap_or(self.latest);
            let known = self.channels.iter().position(|name| name == line.channel);
            let channel = known.unwrap_or(self.channels.len());
            if channel >= CHANNELS {
                return Err(wrong(format!("{:?}: more than {CHANNELS} channels", line.channel)));
            }
            if known.is_none() {
                self.channels.push(line.channel.to_owned());
            }
            match line.what {
                What::Frame(value) => {
                    let heard = Stamped { time: self.latest, value };
                    return Ok(Some(Entry { channel, heard }));
                }
                What::Standard => self.skipped.standard += 1,
                What::Remote => self.skipped.remote += 1,
                What::Error => self.skipped.error += 1,
            }
        }
        Ok(None)
    }

    /// The next line into `bytes`; false at the end. Reads no more than a line may have.
    fn read_line(&mut self) -> Result<bool, BusError> {
        self.bytes.clear();
        self.line += 1;
        let io = |e: std::io::Error| BusError::Io {
            what: format!("line {}", self.line),
            why: e.to_string(),
        };
        let most = LINE_BYTES as u64 + 1;
        self.input.by_ref().take(most).read_until(b'\n', &mut self.bytes).map_err(io)?;
        if self.bytes.len() > LINE_BYTES {
            let why = format!("longer than {LINE_BYTES} bytes: not a log of candump");
            return Err(BusError::Line { line: self.line, why });
        }
        Ok(!self.bytes.is_empty())
    }
}

impl<R: BufRead> Iterator for Reader<R> {
    type Item = Result<Entry, BusError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let next = self.advance().transpose();
        self.over = !matches!(next, Some(Ok(_)));
        next
    }
}

/// A line as text; control characters are binary.
fn text_of(bytes: &[u8]) -> Result<&str, String> {
    let at = bytes.iter().position(|b| !(b.is_ascii_graphic() || b.is_ascii_whitespace()));
    match at.and_then(|at| bytes.get(at).map(|byte| (at, byte))) {
        Some((at, byte)) => Err(format!("byte {} is {byte:#04X}: not a log of candump", at + 1)),
        None => std::str::from_utf8(bytes).map_err(|e| e.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_told_apart_and_the_rest_is_counted() {
        let log = "(0.1) can0 18F00E00#01\n(0.2) can1 18F00E01#02\r\n\n(0.15) can0 7FF#00\n\
                   can1 18F00E01 [1] 03\n(0.3) can0 20000004#0000000000000000\n(0.4) can1 18F00E01#R";
        let mut reader = Reader::new(log.as_bytes());
        let entries: Vec<_> = reader.by_ref().map(Result::unwrap).collect();
        let seen = entries.iter().map(|e| (e.channel, e.heard.time.0, e.heard.value.bytes()[0]));
        let ms = 1_000_000;
        assert!(seen.eq([(0, 100 * ms, 1), (1, 200 * ms, 2), (1, 150 * ms, 3)]));
        assert_eq!(reader.channels(), ["can0", "can1"]);
        assert_eq!(reader.skipped(), Skipped { standard: 1, remote: 1, error: 1 });
    }

    #[test]
    fn binary_and_endless_lines_are_errors_with_their_number_and_nothing_follows() {
        let endless = std::io::Read::chain(&b"(0.1) can0 18F00E00#01\n"[..], std::io::repeat(b' '));
        let mut reader = Reader::new(std::io::BufReader::new(endless));
        assert!(reader.next().unwrap().is_ok());
        let error = reader.next().unwrap().unwrap_err().to_string();
        assert!(error.starts_with("line 2: longer than 256 bytes"), "{error}");
        assert!(reader.next().is_none());

        let mut reader = Reader::new(&b"(0.1) can0 18F0\0E00#01\n"[..]);
        let error = reader.next().unwrap().unwrap_err().to_string();
        assert_eq!(error, "line 1: byte 16 is 0x00: not a log of candump");
        assert!(reader.next().is_none());
    }

    #[test]
    fn a_log_may_not_have_any_number_of_channels() {
        let log: String = (0..100).map(|i| format!("(0.1) can{i} 18F00E00#01\n")).collect();
        let entries: Vec<_> = Reader::new(log.as_bytes()).collect();
        assert_eq!(entries.len(), CHANNELS + 1);
        assert!(entries[CHANNELS].as_ref().unwrap_err().to_string().starts_with("line 65: "));
    }

    proptest::proptest! {
        #[test]
        fn no_log_panics(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..600)) {
            let entries = Reader::new(&bytes[..]).count();
            proptest::prop_assert!(entries <= 600);
        }
    }
}
