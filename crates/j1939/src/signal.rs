//! One signal of a message: where its bits lie and what they mean, for the generated messages and
//! for tools that work on any signal (decoding logs, writing a DBC).

use crate::{J1939Error, Slot, slot::all_ones};

/// A signal: where its bits lie (little-endian), what one step is in SI, and which raw values are
/// data.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Signal {
    /// The parameter group that it is in.
    pub pgn: u32,
    /// Its suspect parameter number.
    pub spn: u32,
    /// Its name with the unit, as the field of the message's struct is called.
    pub name: &'static str,
    /// The SI unit; empty for codes, counts and ratios.
    pub unit: &'static str,
    /// Its first bit, counted from 0 at the least significant bit of the first byte.
    pub start_bit: u16,
    /// Its bits, 1 to 32.
    pub length_bits: u8,
    /// What one step of the raw value is in `unit`.
    pub scale: f64,
    /// What the raw value 0 is in `unit`.
    pub offset: f64,
    /// The last raw value that is data.
    pub data_max: u32,
    /// Whether it is a code or a count and no physical quantity.
    pub is_code: bool,
}

impl Signal {
    /// The raw value. Bytes that the sender left out read as ones: not available.
    #[must_use]
    #[inline]
    pub fn raw(&self, bytes: &[u8]) -> u32 {
        let first = usize::from(self.start_bit / 8);
        let shift = u32::from(self.start_bit % 8);
        let count = (shift + u32::from(self.length_bits)).div_ceil(8);
        let mut word = 0_u64;
        for i in 0..count {
            let byte = bytes.get(first + i as usize).copied().unwrap_or(0xFF);
            word |= u64::from(byte) << (8 * i);
        }
        (word >> shift) as u32 & all_ones(self.length_bits)
    }

    /// What the signal says, the number still raw.
    #[must_use]
    #[inline]
    pub fn slot(&self, bytes: &[u8]) -> Slot<u32> {
        Slot::of_raw(self.raw(bytes), self.length_bits, self.data_max)
    }

    /// What the signal says, in its unit.
    #[must_use]
    #[inline]
    pub fn decode(&self, bytes: &[u8]) -> Slot<f64> {
        self.slot(bytes).map(|raw| f64::from(raw) * self.scale + self.offset)
    }

    /// What a code or a count says.
    #[must_use]
    #[inline]
    pub(crate) fn decode_code(&self, bytes: &[u8]) -> Slot<i64> {
        self.slot(bytes).map(|raw| i64::from(raw) + self.offset as i64)
    }

    /// The raw value that says `slot`, numbers rounded to the nearest step.
    ///
    /// # Errors
    /// For a number outside the data band (NaN too) and for a state that the signal has no raw value
    /// for: a code whose raw values are all data cannot be "not available".
    pub fn encode(&self, slot: Slot<f64>) -> Result<u32, J1939Error> {
        let refused = J1939Error::NotEncodable { pgn: self.pgn, signal: self.name, slot };
        let wanted = match slot {
            Slot::Value(value) => {
                let steps = (value - self.offset) / self.scale + 0.5;
                if !(steps >= 0.0 && steps < f64::from(self.data_max) + 1.0) {
                    return Err(refused);
                }
                Slot::Value(steps as u32)
            }
            state => state.map(|_| 0),
        };
        let raw = wanted.to_raw(self.length_bits);
        let read_back = Slot::of_raw(raw, self.length_bits, self.data_max);
        if raw <= all_ones(self.length_bits) && read_back == wanted {
            Ok(raw)
        } else {
            Err(refused)
        }
    }

    /// Puts `slot` into the message's bytes and leaves all other bits as they are.
    ///
    /// # Errors
    /// As [`Signal::encode`], and where the message is too short for the signal.
    #[inline]
    pub fn write(&self, bytes: &mut [u8], slot: Slot<f64>) -> Result<(), J1939Error> {
        let raw = self.encode(slot)?;
        let first = usize::from(self.start_bit / 8);
        let shift = u32::from(self.start_bit % 8);
        let count = (shift + u32::from(self.length_bits)).div_ceil(8) as usize;
        let len = bytes.len();
        let too_short = J1939Error::Length { pgn: self.pgn, len };
        let bytes = bytes.get_mut(first..first + count).ok_or(too_short)?;
        let mask = u64::from(all_ones(self.length_bits)) << shift;
        let bits = u64::from(raw) << shift;
        for (i, byte) in bytes.iter_mut().enumerate() {
            *byte = *byte & !((mask >> (8 * i)) as u8) | (bits >> (8 * i)) as u8;
        }
        Ok(())
    }
}
