//! The TraCI wire format: pure, bounded, without allocation where the step is hot.
//!
//! Integers and doubles are big-endian; a string is a 32-bit length and bytes. A message is a
//! 32-bit length (itself included) and commands; a command is `u8 length (itself included), u8 id,
//! payload`, or `0x00, u32 length, u8 id, payload` if it is longer than 255 bytes. Source: SUMO
//! documentation "TraCI/Protocol", checked against SUMO 1.15 and 1.28.
//!
//! Every length that comes from the peer is checked against what is there before it is used.

/// Largest message that is accepted, bytes.
pub const MAX_MESSAGE_BYTES: usize = 64 << 20;

/// A message that does not follow the protocol.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("TraCI message: {what} at byte {at}")]
pub struct ProtocolError {
    /// What was expected or found.
    pub what: String,
    /// Offset in the message, bytes.
    pub at: usize,
}

/// Reads one message.
#[derive(Debug, Clone)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    /// A reader over the body of a message (without its length).
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Is everything read?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.at >= self.bytes.len()
    }

    /// An error at the current position.
    pub fn error(&self, what: impl Into<String>) -> ProtocolError {
        ProtocolError { what: what.into(), at: self.at }
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8], ProtocolError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let taken = rest
            .get(..n)
            .ok_or_else(|| self.error(format!("{n} bytes needed, {} left", rest.len())))?;
        self.at += n;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ProtocolError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N)?);
        Ok(out)
    }

    /// One byte.
    pub fn u8(&mut self) -> Result<u8, ProtocolError> {
        Ok(self.array::<1>()?[0])
    }

    /// A 32-bit integer.
    pub fn i32(&mut self) -> Result<i32, ProtocolError> {
        Ok(i32::from_be_bytes(self.array()?))
    }

    /// A double; may be NaN.
    pub fn f64(&mut self) -> Result<f64, ProtocolError> {
        Ok(f64::from_be_bytes(self.array()?))
    }

    /// A count of things of at least `size` bytes each; bounded by what is left.
    pub fn count(&mut self, size: usize) -> Result<usize, ProtocolError> {
        let n = self.i32()?;
        let left = self.bytes.len() - self.at;
        usize::try_from(n)
            .ok()
            .filter(|n| n.saturating_mul(size) <= left)
            .ok_or_else(|| self.error(format!("count {n} with {left} bytes left")))
    }

    /// A string, borrowed.
    pub fn str(&mut self) -> Result<&'a str, ProtocolError> {
        let n = self.count(1)?;
        let bytes = self.take(n)?;
        std::str::from_utf8(bytes).map_err(|_| self.error("text is not UTF-8"))
    }

    /// The next command: its id and its payload.
    pub fn command(&mut self) -> Result<(u8, Reader<'a>), ProtocolError> {
        let start = self.at;
        let short = self.u8()? as usize;
        // The length counts its own bytes; what is too long fails in `take`.
        let length = if short == 0 { usize::try_from(self.i32()?).unwrap_or(0) } else { short };
        let id = self.u8()?;
        let head = self.at - start;
        let n = length
            .checked_sub(head)
            .ok_or_else(|| self.error(format!("command length {length} is below its head")))?;
        let at = self.at;
        self.take(n)?;
        Ok((id, Reader { bytes: self.bytes.get(..at + n).unwrap_or_default(), at }))
    }

    /// A value with its type byte.
    pub fn value(&mut self) -> Result<Value, ProtocolError> {
        self.value_at_depth(0)
    }

    fn value_at_depth(&mut self, depth: u8) -> Result<Value, ProtocolError> {
        let tag = self.u8()?;
        Ok(match tag {
            tag::UBYTE => Value::Ubyte(self.u8()?),
            tag::BYTE => Value::Byte(self.u8()? as i8),
            tag::INT => Value::Int(self.i32()?),
            tag::DOUBLE => Value::Double(self.f64()?),
            tag::STRING => Value::Text(self.str()?.to_owned()),
            tag::STRINGS => {
                let n = self.count(4)?;
                Value::Texts(
                    (0..n).map(|_| self.str().map(str::to_owned)).collect::<Result<_, _>>()?,
                )
            }
            tag::POS_2D => Value::Position([self.f64()?, self.f64()?, 0.0]),
            tag::POS_3D => Value::Position([self.f64()?, self.f64()?, self.f64()?]),
            tag::COMPOUND if depth < 8 => {
                let n = self.count(1)?;
                Value::Compound(
                    (0..n).map(|_| self.value_at_depth(depth + 1)).collect::<Result<_, _>>()?,
                )
            }
            other => return Err(self.error(format!("unknown type 0x{other:02x}"))),
        })
    }
}

/// Type bytes.
pub mod tag {
    /// Two doubles.
    pub const POS_2D: u8 = 0x01;
    /// Three doubles.
    pub const POS_3D: u8 = 0x03;
    /// Unsigned byte.
    pub const UBYTE: u8 = 0x07;
    /// Signed byte.
    pub const BYTE: u8 = 0x08;
    /// 32-bit integer.
    pub const INT: u8 = 0x09;
    /// Double.
    pub const DOUBLE: u8 = 0x0b;
    /// String.
    pub const STRING: u8 = 0x0c;
    /// List of strings.
    pub const STRINGS: u8 = 0x0e;
    /// Count and typed values.
    pub const COMPOUND: u8 = 0x0f;
}

/// A decoded value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Unsigned byte.
    Ubyte(u8),
    /// Signed byte.
    Byte(i8),
    /// Integer.
    Int(i32),
    /// Double.
    Double(f64),
    /// String.
    Text(String),
    /// List of strings.
    Texts(Vec<String>),
    /// Position (z is zero for 2-D).
    Position([f64; 3]),
    /// Compound.
    Compound(Vec<Value>),
}

/// Writes one message. Each command is written in the long form, whose length can be patched.
#[derive(Debug, Clone, Default)]
pub struct Writer {
    bytes: Vec<u8>,
    command_at: usize,
}

impl Writer {
    /// Starts a new message; keeps the memory.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.bytes.extend_from_slice(&[0; 4]);
    }

    /// Begins a command.
    pub fn begin(&mut self, id: u8) -> &mut Self {
        self.command_at = self.bytes.len();
        self.bytes.extend_from_slice(&[0; 5]);
        self.bytes.push(id);
        self
    }

    /// Ends the command: patches its length.
    pub fn end(&mut self) {
        let n = (self.bytes.len() - self.command_at) as u32;
        self.patch(self.command_at + 1, n);
    }

    fn patch(&mut self, at: usize, n: u32) {
        if let Some(slot) = self.bytes.get_mut(at..at + 4) {
            slot.copy_from_slice(&n.to_be_bytes());
        }
    }

    /// The finished message.
    pub fn message(&mut self) -> &[u8] {
        self.patch(0, self.bytes.len() as u32);
        &self.bytes
    }

    /// A raw byte.
    pub fn u8(&mut self, x: u8) -> &mut Self {
        self.bytes.push(x);
        self
    }

    /// A raw integer.
    pub fn i32(&mut self, x: i32) -> &mut Self {
        self.bytes.extend_from_slice(&x.to_be_bytes());
        self
    }

    /// A raw double.
    pub fn f64(&mut self, x: f64) -> &mut Self {
        self.bytes.extend_from_slice(&x.to_be_bytes());
        self
    }

    /// A raw string.
    pub fn str(&mut self, x: &str) -> &mut Self {
        self.i32(x.len() as i32);
        self.bytes.extend_from_slice(x.as_bytes());
        self
    }

    /// A value with its type byte.
    pub fn value(&mut self, value: &Value) -> &mut Self {
        match value {
            Value::Ubyte(x) => self.u8(tag::UBYTE).u8(*x),
            Value::Byte(x) => self.u8(tag::BYTE).u8(*x as u8),
            Value::Int(x) => self.u8(tag::INT).i32(*x),
            Value::Double(x) => self.u8(tag::DOUBLE).f64(*x),
            Value::Text(x) => self.u8(tag::STRING).str(x),
            Value::Texts(list) => {
                self.u8(tag::STRINGS).i32(list.len() as i32);
                for x in list {
                    self.str(x);
                }
                self
            }
            Value::Position([x, y, z]) => self.u8(tag::POS_3D).f64(*x).f64(*y).f64(*z),
            Value::Compound(list) => {
                self.u8(tag::COMPOUND).i32(list.len() as i32);
                for x in list {
                    self.value(x);
                }
                self
            }
        }
    }
}

/// Cuts a byte stream into messages, however the bytes arrive.
#[derive(Debug, Default)]
pub struct Frames {
    bytes: Vec<u8>,
}

impl Frames {
    /// Takes bytes as they come.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Length of the first message, its own four bytes included, if that is known.
    ///
    /// # Errors
    /// A length below 4 or above [`MAX_MESSAGE_BYTES`].
    pub fn expected(&self) -> Result<Option<usize>, ProtocolError> {
        let Some(&[a, b, c, d]) = self.bytes.first_chunk::<4>() else { return Ok(None) };
        let n = u32::from_be_bytes([a, b, c, d]) as usize;
        if (4..=MAX_MESSAGE_BYTES).contains(&n) {
            Ok(Some(n))
        } else {
            Err(ProtocolError { what: format!("message length {n}"), at: 0 })
        }
    }

    /// Is any byte of a message there?
    #[must_use]
    pub fn is_partial(&self) -> bool {
        !self.bytes.is_empty()
    }

    /// Moves the body of the first complete message into `body`; false if none is complete.
    ///
    /// # Errors
    /// As [`Frames::expected`].
    pub fn take(&mut self, body: &mut Vec<u8>) -> Result<bool, ProtocolError> {
        let Some(n) = self.expected()?.filter(|&n| n <= self.bytes.len()) else {
            return Ok(false);
        };
        body.clear();
        body.extend_from_slice(self.bytes.get(4..n).unwrap_or_default());
        self.bytes.drain(..n);
        Ok(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn values() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            any::<u8>().prop_map(Value::Ubyte),
            any::<i8>().prop_map(Value::Byte),
            any::<i32>().prop_map(Value::Int),
            (-1e300f64..1e300).prop_map(Value::Double),
            ".{0,300}".prop_map(Value::Text),
            prop::collection::vec(".{0,20}", 0..5).prop_map(Value::Texts),
            prop::array::uniform3(-1e9f64..1e9).prop_map(Value::Position),
        ];
        leaf.prop_recursive(3, 20, 5, |inner| {
            prop::collection::vec(inner, 0..5).prop_map(Value::Compound)
        })
    }

    proptest! {
        #[test]
        fn decoding_gives_back_what_was_encoded(list in prop::collection::vec(values(), 0..6), cut in 1usize..50) {
            let mut w = Writer::default();
            w.clear();
            for v in &list {
                w.begin(0xc4).value(v).end();
            }
            let mut frames = Frames::default();
            for chunk in w.message().chunks(cut) {
                frames.push(chunk);
            }
            let mut body = Vec::new();
            prop_assert!(frames.take(&mut body).unwrap());
            prop_assert!(!frames.is_partial());
            let mut r = Reader::new(&body);
            for v in &list {
                let (id, mut command) = r.command().unwrap();
                prop_assert_eq!(id, 0xc4);
                prop_assert_eq!(&command.value().unwrap(), v);
                prop_assert!(command.is_empty());
            }
            prop_assert!(r.is_empty());
        }

        #[test]
        fn no_bytes_make_the_decoder_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let mut r = Reader::new(&bytes);
            while let Ok((_, mut c)) = r.command() {
                while c.value().is_ok() {}
            }
            let mut frames = Frames::default();
            frames.push(&bytes);
            let mut body = Vec::new();
            while let Ok(true) = frames.take(&mut body) {}
        }
    }

    #[test]
    fn lengths_that_the_message_does_not_hold_are_refused() {
        let mut r = Reader::new(&[0x7f, 0xff, 0xff, 0xff]);
        assert!(r.str().unwrap_err().what.contains("2147483647"));
        let mut frames = Frames::default();
        frames.push(&u32::MAX.to_be_bytes());
        assert!(frames.take(&mut Vec::new()).is_err());
    }
}
