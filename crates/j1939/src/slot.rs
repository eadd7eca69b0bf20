//! What a parameter on the bus says: a number, or why there is none (SAE J1939-71, 5.1.5 and table 1).
//!
//! Each parameter keeps the top of its range for states. Which raw values are data depends on the
//! width alone, unless the parameter's definition gives more or fewer of them a meaning (then the
//! table of the messages names the last raw value that is data):
//!
//! | bits | data | parameter specific | reserved | error | not available |
//! |---|---|---|---|---|---|
//! | 1 | 0, 1 | | | | |
//! | 2 | 0, 1 | | | 2 | 3 |
//! | 3 to 7 | 0 to 2ⁿ − 3 | | | 2ⁿ − 2 | 2ⁿ − 1 |
//! | 8 | 0 to FA | FB | FC, FD | FE | FF |
//! | 9 to 32 | top eight bits 0 to FA | FB | FC, FD | FE | FF |
//!
//! So 10 bits hold data up to 3EB, 16 bits up to FAFF, 19 bits up to 7D7FF, 32 bits up to FAFF FFFF.

/// One parameter of a message. Only [`Slot::Value`] carries a number that means something.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Slot<T> {
    /// In the data band: the decoded number.
    Value(T),
    /// A state that the parameter's own definition explains; the raw value.
    ParameterSpecific(u32),
    /// Kept for later editions of the standard; the raw value.
    Reserved(u32),
    /// The sender knows that its sensor or module is at fault; the raw value.
    Error(u32),
    /// The sender does not have it, or does not ask for it.
    #[default]
    NotAvailable,
}

impl<T> Slot<T> {
    /// The number, where there is one.
    #[must_use]
    pub fn value(self) -> Option<T> {
        match self {
            Self::Value(value) => Some(value),
            _ => None,
        }
    }

    /// The same state with another number.
    #[must_use]
    pub fn map<U>(self, number: impl FnOnce(T) -> U) -> Slot<U> {
        match self {
            Self::Value(value) => Slot::Value(number(value)),
            Self::ParameterSpecific(raw) => Slot::ParameterSpecific(raw),
            Self::Reserved(raw) => Slot::Reserved(raw),
            Self::Error(raw) => Slot::Error(raw),
            Self::NotAvailable => Slot::NotAvailable,
        }
    }

    /// The state in words, for people and tables.
    #[must_use]
    pub const fn state(&self) -> &'static str {
        match self {
            Self::Value(_) => "value",
            Self::ParameterSpecific(_) => "parameter specific",
            Self::Reserved(_) => "reserved",
            Self::Error(_) => "error",
            Self::NotAvailable => "not available",
        }
    }
}

impl Slot<u32> {
    /// What `raw` of a parameter of `length_bits` bits (1 to 32) says, where raw values up to
    /// `data_max` are data.
    #[must_use]
    #[inline]
    pub const fn of_raw(raw: u32, length_bits: u8, data_max: u32) -> Self {
        if raw <= data_max { Self::Value(raw) } else { Self::of_state(raw, length_bits) }
    }

    /// The state that a raw value above the data band stands for.
    const fn of_state(raw: u32, length_bits: u8) -> Self {
        let all_ones = all_ones(length_bits);
        if length_bits < 8 {
            return match all_ones.saturating_sub(raw) {
                0 => Self::NotAvailable,
                1 => Self::Error(raw),
                _ => Self::Reserved(raw),
            };
        }
        match raw.wrapping_shr(length_bits as u32 - 8) & 0xFF {
            0xFB => Self::ParameterSpecific(raw),
            0xFE => Self::Error(raw),
            0xFF => Self::NotAvailable,
            _ => Self::Reserved(raw),
        }
    }

    /// The raw value that stands for this: not available is all ones.
    #[must_use]
    pub const fn to_raw(self, length_bits: u8) -> u32 {
        match self {
            Self::Value(raw)
            | Self::ParameterSpecific(raw)
            | Self::Reserved(raw)
            | Self::Error(raw) => raw,
            Self::NotAvailable => all_ones(length_bits),
        }
    }
}

/// The largest raw value of a parameter of 1 to 32 bits.
pub(crate) const fn all_ones(length_bits: u8) -> u32 {
    u32::MAX.wrapping_shr(32_u32.wrapping_sub(length_bits as u32))
}

/// The last raw value that is data, by the width alone.
#[must_use]
pub(crate) const fn data_max(length_bits: u8) -> u32 {
    match length_bits {
        0 | 1 => 1,
        2..=7 => all_ones(length_bits) - 2,
        _ => (0xFB << (length_bits - 8)) - 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(raw: u32, length_bits: u8) -> Slot<u32> {
        Slot::of_raw(raw, length_bits, data_max(length_bits))
    }

    #[test]
    fn the_bands_of_every_width_are_those_of_the_standard() {
        assert_eq!([of(0, 1), of(1, 1)], [Slot::Value(0), Slot::Value(1)]);
        assert_eq!(
            [of(0, 2), of(1, 2), of(2, 2), of(3, 2)],
            [Slot::Value(0), Slot::Value(1), Slot::Error(2), Slot::NotAvailable]
        );
        for (bits, last, error) in
            [(3, 5, 6), (4, 0xD, 0xE), (5, 29, 30), (6, 61, 62), (7, 125, 126)]
        {
            assert_eq!(of(last, bits), Slot::Value(last));
            assert_eq!(of(error, bits), Slot::Error(error));
            assert_eq!(of(error + 1, bits), Slot::NotAvailable);
        }
        for (bits, last, all) in [
            (8, 0xFA, 0xFF),
            (10, 0x3EB, 0x3FF),
            (16, 0xFAFF, 0xFFFF),
            (19, 0x7_D7FF, 0x7_FFFF),
            (24, 0xFA_FFFF, 0xFF_FFFF),
            (32, 0xFAFF_FFFF, u32::MAX),
        ] {
            assert_eq!(of(last, bits), Slot::Value(last), "{bits} bits");
            assert_eq!(of(last + 1, bits), Slot::ParameterSpecific(last + 1), "{bits} bits");
            let at = |top: u32| top << (bits - 8);
            assert_eq!(of(at(0xFC), bits), Slot::Reserved(at(0xFC)), "{bits} bits");
            assert_eq!(of(at(0xFE) - 1, bits), Slot::Reserved(at(0xFE) - 1), "{bits} bits");
            assert_eq!(of(at(0xFE), bits), Slot::Error(at(0xFE)), "{bits} bits");
            assert_eq!(of(at(0xFF), bits), Slot::NotAvailable, "{bits} bits");
            assert_eq!(of(all, bits), Slot::NotAvailable, "{bits} bits");
        }
    }

    #[test]
    fn a_definition_may_give_more_or_fewer_raw_values_a_meaning() {
        // TSC1 override mode: all four; XBR state: three; torque fraction: eight of sixteen
        assert_eq!(Slot::of_raw(3, 2, 3), Slot::Value(3));
        assert_eq!(
            [Slot::of_raw(2, 2, 2), Slot::of_raw(3, 2, 2)],
            [Slot::Value(2), Slot::NotAvailable]
        );
        assert_eq!(
            [7, 8, 14, 15].map(|raw| Slot::of_raw(raw, 4, 7)),
            [Slot::Value(7), Slot::Reserved(8), Slot::Error(14), Slot::NotAvailable]
        );
    }

    #[test]
    fn a_state_goes_back_to_its_raw_value_and_only_values_are_numbers() {
        for bits in 1..=16 {
            for raw in 0..=all_ones(bits) {
                let slot = of(raw, bits);
                let canonical = if slot == Slot::NotAvailable { all_ones(bits) } else { raw };
                assert_eq!(slot.to_raw(bits), canonical);
                assert_eq!(slot.value().is_some(), raw <= data_max(bits));
                assert_eq!(of(canonical, bits), slot);
            }
        }
    }
}
