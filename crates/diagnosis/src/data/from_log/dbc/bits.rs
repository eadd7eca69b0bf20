//! Bits of a signal in a message, in both byte orders of a DBC.

use can_dbc::{ByteOrder, Signal, ValueType};

/// Where a signal lies: bit `8 * byte + k` is bit k of that byte.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bits {
    start: u64,
    size: u64,
    is_big_endian: bool,
    is_signed: bool,
}

impl Bits {
    /// None if it is no number of 1 to 64 bits within a transported message.
    pub(super) fn of(signal: &Signal) -> Option<Self> {
        let fits = (1..=64).contains(&signal.size) && signal.start_bit < 8 * 1785;
        fits.then_some(Self {
            start: signal.start_bit,
            size: signal.size,
            is_big_endian: signal.byte_order == ByteOrder::BigEndian,
            is_signed: signal.value_type == ValueType::Signed,
        })
    }

    /// Its bits, the least significant one first if little-endian, else the most significant one.
    pub(super) fn places(self) -> impl Iterator<Item = u64> {
        let first = self.start;
        // big-endian goes down within a byte and on at the top of the next
        let sawtooth = 8 * (first / 8) + 7 - first % 8;
        (0..self.size).map(move |k| {
            if self.is_big_endian {
                let at = sawtooth + k;
                8 * (at / 8) + 7 - at % 8
            } else {
                first + k
            }
        })
    }

    /// What the bits say; none if the message is too short.
    pub(super) fn raw(self, bytes: &[u8]) -> Option<u64> {
        let mut raw = 0;
        for (k, place) in self.places().enumerate() {
            let byte = *bytes.get(usize::try_from(place / 8).ok()?)?;
            let bit = u64::from(byte >> (place % 8) & 1);
            raw = if self.is_big_endian { raw << 1 | bit } else { raw | bit << k };
        }
        Some(raw)
    }

    /// J1939 says so that there is no number; a single bit or a sign has no such state.
    pub(super) fn is_all_ones(self, raw: u64) -> bool {
        !self.is_signed && self.size > 1 && raw == u64::MAX >> (64 - self.size)
    }

    /// The number of these bits, two's complement if signed.
    pub(super) fn number(self, raw: u64) -> f64 {
        if self.is_signed {
            let shift = 64 - self.size;
            (((raw << shift) as i64) >> shift) as f64
        } else {
            raw as f64
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_byte_orders_and_signs_are_those_of_vector_s_dbc() {
        let bits =
            |start, size, is_big_endian, is_signed| Bits { start, size, is_big_endian, is_signed };
        let bytes = [0x12, 0x34, 0xFE, 0xFF];
        assert_eq!(bits(0, 16, false, false).raw(&bytes), Some(0x3412));
        assert_eq!(bits(7, 16, true, false).raw(&bytes), Some(0x1234));
        assert_eq!(bits(3, 8, true, false).raw(&bytes), Some(0x23));
        assert_eq!(bits(4, 8, false, false).raw(&bytes), Some(0x41));
        let signed = bits(16, 16, false, true);
        assert_eq!(signed.number(signed.raw(&bytes).unwrap()), -2.0);
        assert_eq!(bits(24, 16, false, false).raw(&bytes), None, "the message is too short");
        assert!(bits(24, 8, false, false).is_all_ones(0xFF) && !signed.is_all_ones(0xFFFF));
    }
}
