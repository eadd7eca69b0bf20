//! Writes lines of a log.

use std::io;

use tractrix_core::Stamped;

use crate::Frame;

/// How a line looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `candump -L`.
    Log,
    /// `candump -t a`: with spaces.
    Spaced,
}

/// Writes one line: time in seconds to the microsecond (below zero: zero), channel, frame.
///
/// # Errors
/// When `out` cannot be written.
pub fn write(
    out: &mut impl io::Write,
    form: Form,
    channel: &str,
    heard: &Stamped<Frame>,
) -> io::Result<()> {
    let micros = heard.time.0.max(0) / 1_000;
    let (seconds, micros) = (micros / 1_000_000, micros % 1_000_000);
    let (raw, bytes) = (heard.value.id().raw(), heard.value.bytes());
    match form {
        Form::Log => write!(out, "({seconds:010}.{micros:06}) {channel} {raw:08X}#")?,
        Form::Spaced => {
            let len = bytes.len();
            write!(out, " ({seconds:010}.{micros:06})  {channel}  {raw:08X}   [{len}] ")?;
        }
    }
    for byte in bytes {
        match form {
            Form::Log => write!(out, "{byte:02X}")?,
            Form::Spaced => write!(out, " {byte:02X}")?,
        }
    }
    writeln!(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Id;
    use crate::bus::candump::Reader;
    use proptest::prelude::*;
    use tractrix_core::Time;

    #[test]
    fn lines_look_like_those_of_candump() {
        let value = Frame::new(Id::from_raw(0x18EA_FFFE), &[0, 0xEE, 0]).unwrap();
        let heard = Stamped { time: Time(1_635_188_455_020_850_999), value };
        let mut out = Vec::new();
        write(&mut out, Form::Log, "can0", &heard).unwrap();
        write(&mut out, Form::Spaced, "can0", &heard).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "(1635188455.020850) can0 18EAFFFE#00EE00\n \
             (1635188455.020850)  can0  18EAFFFE   [3]  00 EE 00\n"
        );
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            raw in 0_u32..1 << 29,
            data in proptest::collection::vec(any::<u8>(), 0..=8),
            micros in 0_i64..9_000_000_000_000_000,
            log in any::<bool>(),
        ) {
            let form = if log { Form::Log } else { Form::Spaced };
            let value = Frame::new(Id::from_raw(raw), &data).unwrap();
            let heard = Stamped { time: Time(micros * 1_000), value };
            let mut out = Vec::new();
            write(&mut out, form, "vcan0", &heard).unwrap();
            let mut reader = Reader::new(&out[..]);
            prop_assert_eq!(reader.next().unwrap().unwrap().heard, heard);
            prop_assert!(reader.next().is_none());
        }
    }
}
