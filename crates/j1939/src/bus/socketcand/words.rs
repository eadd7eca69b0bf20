//! Messages in angle brackets, and the stream that carries them.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;

use tractrix_core::{Stamped, Time};

use super::WAITING;
use crate::bus::BusError;
use crate::{Frame, Id};

/// Longest message, bytes: a frame has about 60.
const MESSAGE_BYTES: usize = 256;
/// Bytes that are read at once.
const CHUNK: usize = 4_096;

/// A connection as a sequence of messages, both ways without waiting.
#[derive(Debug)]
pub(super) struct Words {
    stream: TcpStream,
    name: String,
    read: Vec<u8>,
    write: Vec<u8>,
    messages: u64,
}

impl Words {
    /// Messages over a stream that does not block.
    pub(super) fn new(stream: TcpStream, name: String) -> Self {
        Self { stream, name, read: Vec::new(), write: Vec::new(), messages: 0 }
    }

    /// What failed and why.
    pub(super) fn failure(&self, why: impl ToString) -> BusError {
        BusError::Io { what: self.name.clone(), why: why.to_string() }
    }

    /// A message that is not what it should be.
    pub(super) fn wrong(&self, why: String) -> BusError {
        BusError::Line { line: self.messages, why }
    }

    /// The next whole message without its brackets; none when none has come.
    pub(super) fn next(&mut self) -> Result<Option<String>, BusError> {
        if let Some(message) = self.take()? {
            return Ok(Some(message));
        }
        let mut chunk = [0; CHUNK];
        match self.stream.read(&mut chunk) {
            Ok(0) => Err(self.failure("the connection was closed")),
            Ok(count) => {
                self.read.extend_from_slice(chunk.get(..count).unwrap_or_default());
                self.take()
            }
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                Ok(None)
            }
            Err(e) => Err(self.failure(e)),
        }
    }

    /// A message that has been read, if there is one. What is outside of brackets may be white only.
    fn take(&mut self) -> Result<Option<String>, BusError> {
        let end = self.read.iter().take(MESSAGE_BYTES).position(|byte| *byte == b'>');
        let Some(end) = end else {
            if self.read.len() >= MESSAGE_BYTES {
                self.messages += 1;
                return Err(self.wrong(format!("longer than {MESSAGE_BYTES} bytes")));
            }
            return Ok(None);
        };
        self.messages += 1;
        let message: Vec<u8> = self.read.drain(..=end).collect();
        let text = std::str::from_utf8(&message).ok().map(str::trim);
        let inner = text.and_then(|t| t.strip_prefix('<')).and_then(|t| t.strip_suffix('>'));
        match inner.filter(|t| t.bytes().all(|b| b.is_ascii_graphic() || b == b' ')) {
            Some(inner) => Ok(Some(inner.trim().to_owned())),
            None => {
                Err(self.wrong(format!("{:?} is no message", String::from_utf8_lossy(&message))))
            }
        }
    }

    /// Puts a message behind those that wait; false when there is no room for it.
    pub(super) fn say(&mut self, message: &str) -> bool {
        let fits = self.write.len() + message.len() + 4 <= WAITING;
        if fits {
            self.write.extend_from_slice(format!("< {message} >").as_bytes());
        }
        fits
    }

    /// Writes what the peer takes.
    pub(super) fn flush(&mut self) -> Result<(), BusError> {
        while !self.write.is_empty() {
            match self.stream.write(&self.write) {
                Ok(0) => return Err(self.failure("the connection was closed")),
                Ok(count) => drop(self.write.drain(..count.min(self.write.len()))),
                Err(e) if e.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(self.failure(e)),
            }
        }
        Ok(())
    }
}

/// `frame ID SECONDS DATA`, as servers say it.
pub(super) fn frame_message(heard: &Stamped<Frame>) -> String {
    let micros = heard.time.0.max(0) / 1_000;
    let data: String = heard.value.bytes().iter().map(|byte| format!("{byte:02X}")).collect();
    let raw = heard.value.id().raw();
    format!("frame {raw:08X} {}.{:06} {data}", micros / 1_000_000, micros % 1_000_000)
}

/// `send ID LENGTH BYTES`, as clients say it.
pub(super) fn send_message(frame: &Frame) -> String {
    let data: String = frame.bytes().iter().map(|byte| format!(" {byte:02X}")).collect();
    format!("send {:08X} {}{data}", frame.id().raw(), frame.bytes().len())
}

/// The frame in a `frame` message; none for one with an 11-bit identifier.
pub(super) fn parse_frame(words: &str) -> Result<Option<Frame>, String> {
    let mut words = words.split(' ');
    let id = words.next().unwrap_or_default();
    words.next().and_then(|t| t.parse::<f64>().ok()).ok_or("a frame without a time")?;
    let digits: String = words.collect();
    let byte = |pair: &[u8]| std::str::from_utf8(pair).ok().and_then(hex_byte);
    let bytes: Option<Vec<u8>> = digits.as_bytes().chunks(2).map(byte).collect();
    frame(id, &bytes.ok_or_else(|| format!("{digits:?} are no bytes"))?)
}

/// The frame in a `send` message; none for one with an 11-bit identifier.
pub(super) fn parse_send(words: &str) -> Result<Option<Frame>, String> {
    let mut words = words.split_ascii_whitespace();
    let id = words.next().unwrap_or_default();
    let len = words.next().and_then(|l| usize::from_str_radix(l, 16).ok()).ok_or("no length")?;
    let bytes: Option<Vec<u8>> = words.map(hex_byte).collect();
    let bytes = bytes.filter(|b| b.len() == len).ok_or_else(|| format!("not {len} bytes"))?;
    frame(id, &bytes)
}

fn frame(id: &str, bytes: &[u8]) -> Result<Option<Frame>, String> {
    let plain = id.bytes().all(|byte| byte.is_ascii_hexdigit());
    let raw = plain.then(|| u32::from_str_radix(id, 16).ok()).flatten();
    match (id.len(), raw) {
        (1..=3, Some(_)) => Ok(None),
        (8, Some(raw)) if raw < 1 << 29 => {
            Frame::new(Id::from_raw(raw), bytes).map(Some).map_err(|e| e.to_string())
        }
        _ => Err(format!("{id:?} is not an identifier of 3 or 8 hexadecimal digits")),
    }
}

/// One or two hexadecimal digits: peers write both.
fn hex_byte(digits: &str) -> Option<u8> {
    let plain = digits.len() <= 2 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    plain.then(|| u8::from_str_radix(digits, 16).ok()).flatten()
}

/// A frame that has just come.
pub(super) const fn heard(time: Time, value: Frame) -> Stamped<Frame> {
    Stamped { time, value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn messages_as_python_can_and_socketcand_write_them() {
        let id = Id::from_raw(0x18EA_FFFE);
        let expected = Some(Frame::new(id, &[0, 0xEE, 0]).unwrap());
        assert_eq!(parse_send("18EAFFFE 3 00 EE 00"), Ok(expected));
        assert_eq!(parse_send("18EAFFFE 3 0 ee 0"), Ok(expected));
        assert_eq!(parse_frame("18EAFFFE 12.345678 00EE00"), Ok(expected));
        assert_eq!(parse_frame("18EAFFFE 12.345678 00 EE 00"), Ok(expected));
        assert_eq!(parse_frame("123 0.1 00"), Ok(None));
        let empty = Frame::new(id, &[]).unwrap();
        assert_eq!(parse_send("18EAFFFE 0"), Ok(Some(empty)));
        assert_eq!(parse_frame("18EAFFFE 0.1 "), Ok(Some(empty)));
        for wrong in
            ["", "18EAFFFE", "18EAFFFE 2 00", "18EAFFFE 1 0+", "38EAFFFE 1 00", "18EAFFFE 9"]
        {
            assert!(parse_send(wrong).is_err(), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn what_is_said_is_understood(
            raw in 0_u32..1 << 29, data in prop::collection::vec(any::<u8>(), 0..=8), nanos in any::<i64>(),
        ) {
            let frame = Frame::new(Id::from_raw(raw), &data).unwrap();
            let send = send_message(&frame);
            prop_assert_eq!(parse_send(send.strip_prefix("send ").unwrap()), Ok(Some(frame)));
            let said = frame_message(&heard(Time(nanos), frame));
            prop_assert_eq!(parse_frame(said.strip_prefix("frame ").unwrap()), Ok(Some(frame)));
        }

        #[test]
        fn no_text_panics(text in "[ -~]{0,80}") {
            let _ = (parse_send(&text), parse_frame(&text));
        }
    }
}
