//! One line of a log.

use tractrix_core::Time;

use crate::{Frame, Id};

/// Marks an error frame in the identifier (linux/can.h).
const ERROR_FLAG: u32 = 0x2000_0000;
/// The 29 bits of an extended identifier.
const EXTENDED: u32 = 0x1FFF_FFFF;

/// What a line says.
#[derive(Debug, PartialEq)]
pub(super) struct Line<'a> {
    /// None when the line has no time.
    pub(super) time: Option<Time>,
    pub(super) channel: &'a str,
    pub(super) what: What,
}

/// What was on the bus.
#[derive(Debug, PartialEq)]
pub(super) enum What {
    Frame(Frame),
    /// An 11-bit identifier: never J1939.
    Standard,
    /// A remote frame: none in J1939.
    Remote,
    /// The controller's report of an error.
    Error,
}

/// Reads a line of either form.
///
/// # Errors
/// What is wrong with it, with the offending word.
pub(super) fn parse(text: &str) -> Result<Line<'_>, String> {
    let mut words = text.split_ascii_whitespace().peekable();
    let time = words.next_if(|word| word.starts_with('(')).map(time).transpose()?;
    let channel = words.next().ok_or("no channel")?;
    let word = words.next().ok_or("no identifier")?;
    let what = if let Some((id, data)) = word.split_once('#') {
        let what = compact(id, data)?;
        // the direction that `candump -L -x` and python-can add
        words.next_if(|word| matches!(*word, "R" | "T"));
        what
    } else {
        let mut id = word;
        while matches!(id, "RX" | "TX" | "-" | "B" | "E") {
            id = words.next().ok_or("no identifier")?;
        }
        let len = words.next().ok_or("no length")?;
        spaced(id, len, &mut words)?
    };
    match words.next() {
        None => Ok(Line { time, channel, what }),
        Some(more) => Err(format!("{more:?} after the end of the frame")),
    }
}

/// Data of the `-L` form: `id#data`.
fn compact(id: &str, data: &str) -> Result<What, String> {
    if data.starts_with('#') {
        return Err(format!("{id:?} is a CAN FD frame, J1939-21 buses carry classic frames"));
    }
    if data.starts_with('R') {
        return kind(id).map(|kind| kind.map_or(What::Remote, |other| other.0));
    }
    let mut bytes = [0; 8];
    let wrong = || format!("{data:?} is not at most eight bytes in hexadecimal");
    if !data.len().is_multiple_of(2) {
        return Err(wrong());
    }
    let len = data.len() / 2;
    let room = bytes.get_mut(..len).ok_or_else(wrong)?;
    for (byte, digits) in room.iter_mut().zip(data.as_bytes().chunks(2)) {
        *byte = std::str::from_utf8(digits).ok().and_then(hex_byte).ok_or_else(wrong)?;
    }
    frame(id, &bytes, len)
}

/// Data of the form with spaces: `id [len] byte byte ...`, perhaps with the bytes as text behind.
fn spaced<'a>(
    id: &str,
    len: &str,
    words: &mut std::iter::Peekable<impl Iterator<Item = &'a str>>,
) -> Result<What, String> {
    let digits = len.strip_prefix('[').and_then(|l| l.strip_suffix(']'));
    let digits = digits.ok_or_else(|| format!("{len:?} is not a length like [8]"))?;
    if digits.len() == 2 {
        return Err(format!("{len} is a CAN FD frame, J1939-21 buses carry classic frames"));
    }
    let len: usize =
        digits.parse().ok().filter(|l| *l <= 8).ok_or_else(|| format!("length {len}"))?;
    if words.next_if_eq(&"remote").is_some() {
        words.next_if_eq(&"request");
        return kind(id).map(|kind| kind.map_or(What::Remote, |other| other.0));
    }
    let mut bytes = [0; 8];
    for byte in bytes.iter_mut().take(len) {
        let word = words.next().ok_or_else(|| format!("fewer than {len} bytes"))?;
        *byte = hex_byte(word).ok_or_else(|| format!("{word:?} is not a byte"))?;
    }
    if words.peek().is_some_and(|word| word.starts_with('\'') || *word == "ERRORFRAME") {
        words.by_ref().for_each(drop);
    }
    frame(id, &bytes, len)
}

/// What is on the bus when it is no J1939 frame.
struct Other(What);

/// A frame, or what else the identifier says it is.
fn frame(id: &str, bytes: &[u8; 8], len: usize) -> Result<What, String> {
    match kind(id)? {
        Some(other) => Ok(other.0),
        None => {
            let raw = hex(id).unwrap_or_default();
            let data = bytes.get(..len).unwrap_or(bytes);
            Frame::new(Id::from_raw(raw), data).map(What::Frame).map_err(|e| e.to_string())
        }
    }
}

/// What an identifier says that the frame is; none for an extended data frame.
fn kind(id: &str) -> Result<Option<Other>, String> {
    let wrong = || format!("{id:?} is not an identifier of 3 or 8 hexadecimal digits");
    let raw = hex(id).ok_or_else(wrong)?;
    match id.len() {
        3 if raw <= 0x7FF => Ok(Some(Other(What::Standard))),
        8 if raw & ERROR_FLAG != 0 => Ok(Some(Other(What::Error))),
        8 if raw <= EXTENDED => Ok(None),
        _ => Err(wrong()),
    }
}

/// A number of hexadecimal digits alone: no sign, as `from_str_radix` would take.
fn hex(digits: &str) -> Option<u32> {
    let plain = digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    plain.then(|| u32::from_str_radix(digits, 16).ok()).flatten()
}

fn hex_byte(digits: &str) -> Option<u8> {
    hex(digits).filter(|_| digits.len() == 2).and_then(|value| u8::try_from(value).ok())
}

/// Seconds in parentheses, to the nanosecond; the calendar form of `-t A` is refused.
fn time(word: &str) -> Result<Time, String> {
    let wrong = || format!("{word:?} is not a time in seconds like (12.345678)");
    let inner = word.strip_prefix('(').and_then(|w| w.strip_suffix(')')).ok_or_else(wrong)?;
    let (seconds, fraction) = inner.split_once('.').unwrap_or((inner, "0"));
    let digits = |text: &str, most: usize| {
        let plain = !text.is_empty() && text.len() <= most;
        (plain && text.bytes().all(|b| b.is_ascii_digit()))
            .then(|| text.parse::<i64>().ok())
            .flatten()
    };
    let scale = 10_i64.pow(9_u32.saturating_sub(fraction.len() as u32));
    let nanos = digits(fraction, 9).ok_or_else(wrong)? * scale;
    // nine digits and a one: no overflow of 64 bits until the year 2262
    let seconds = digits(seconds, 10).filter(|s| *s < 9_000_000_000).ok_or_else(wrong)?;
    Ok(Time(seconds * 1_000_000_000 + nanos))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame_of(raw: u32, bytes: &[u8]) -> What {
        What::Frame(Frame::new(Id::from_raw(raw), bytes).unwrap())
    }

    #[test]
    fn all_forms_of_candump_are_read() {
        let eight = [0x82, 0x16, 0x39, 0xC4, 0xFF, 0xFF, 0xFF, 0xFF];
        let time = Some(Time(1_635_188_455_020_850_000));
        for (text, time, what) in [
            (
                "(1635188455.020850) can1 18F00E00#821639C4FFFFFFFF",
                time,
                frame_of(0x18F0_0E00, &eight),
            ),
            (
                "(1635188455.020850) can1 18F00E00#821639C4FFFFFFFF R",
                time,
                frame_of(0x18F0_0E00, &eight),
            ),
            (
                " (1635188455.020850)  can1  18F00E00   [8]  82 16 39 C4 FF FF FF FF",
                time,
                frame_of(0x18F0_0E00, &eight),
            ),
            (
                "  can1  18F00E00   [8]  82 16 39 C4 FF FF FF FF   '..9.....'",
                None,
                frame_of(0x18F0_0E00, &eight),
            ),
            (" can1  RX - -  18EAFFFE   [3]  00 EE 00", None, frame_of(0x18EA_FFFE, &[0, 0xEE, 0])),
            ("(0.5) can1 00000000#", Some(Time(500_000_000)), frame_of(0, &[])),
            ("(0.1) can1 123#00", Some(Time(100_000_000)), What::Standard),
            ("(0.1) can1 18F00E00#R8", Some(Time(100_000_000)), What::Remote),
            (" can1  18F00E00   [0]  remote request", None, What::Remote),
            ("(0.1) can1 20000080#0000000000000000", Some(Time(100_000_000)), What::Error),
            (" can1  20000088   [8]  00 00 00 19 00 00 00 00   ERRORFRAME", None, What::Error),
        ] {
            assert_eq!(parse(text), Ok(Line { time, channel: "can1", what }), "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, why) in [
            ("(0.1) can1", "no identifier"),
            ("(2021-10-25 18:20:55.020850) can1 18F00E00#00", "(2021-10-25"),
            ("(99999999999.0) can1 18F00E00#00", "(99999999999.0)"),
            ("(0.1) can1 18F00E00#000", "\"000\""),
            ("(0.1) can1 18F00E00#001122334455667788", "eight bytes"),
            ("(0.1) can1 18F00E00#+1", "\"+1\""),
            ("(0.1) can1 18F00E00##1001122", "CAN FD"),
            ("(0.1) can1 18F00E00 [12] 00", "CAN FD"),
            ("(0.1) can1 18F00E00 [9] 00", "[9]"),
            ("(0.1) can1 18F00E00 [2] 00", "fewer than 2"),
            ("(0.1) can1 8F00E00#00", "8F00E00"),
            ("(0.1) can1 800#00", "800"),
            ("(0.1) can1 18F00E00#00 more", "more"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn no_line_panics(text in "[ -~]{0,80}", tail in "[()a-fA-F0-9.# \\[\\]R]{0,60}") {
            let _ = parse(&text);
            let _ = parse(&format!("(0.1) can0 {tail}"));
            let _ = parse(&tail);
        }
    }
}
