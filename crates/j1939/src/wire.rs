//! How long a frame occupies a classic CAN bus, and how busy the bus is (ISO 11898-1).

use tractrix_core::Time;

use crate::Frame;

/// Speed of a J1939 bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub enum BitRate {
    /// 250 kbit/s (SAE J1939-11, -15).
    Kbit250,
    /// 500 kbit/s (SAE J1939-14).
    Kbit500,
}

impl BitRate {
    /// Nanoseconds a bit.
    #[must_use]
    pub const fn bit_nanos(self) -> i64 {
        match self {
            Self::Kbit250 => 4_000,
            Self::Kbit500 => 2_000,
        }
    }
}

/// CRC delimiter, acknowledge slot and delimiter, end of frame, space between frames: not stuffed.
const BITS_AFTER_CRC: u32 = 1 + 2 + 7 + 3;
/// Generator of the 15-bit check sequence (ISO 11898-1, 10.4.2.6).
const CRC_GENERATOR: u16 = 0x4599;
/// After so many equal bits the sender puts in one of the other kind.
const EQUAL_BITS: u32 = 5;

/// What a byte at the top of the check sequence makes of it.
const CRC_OF_BYTE: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut crc, mut bit) = ((byte as u16) << 7, 0);
        while bit < 8 {
            let feedback = crc >> 14 & 1 == 1;
            crc = crc << 1 & 0x7FFF;
            if feedback {
                crc ^= CRC_GENERATOR;
            }
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// What a byte does after one to four zeros that went over the wire before it.
#[derive(Clone, Copy)]
struct Stuffing {
    /// Stuff bits that it needs.
    count: u8,
    /// Equal bits at its end, less one.
    equal: u8,
    /// These bits: all zeros or all ones.
    last: u8,
}

/// By the zeros before, less one, and the byte.
const STUFFING: [[Stuffing; 256]; 4] = {
    let mut table = [[Stuffing { count: 0, equal: 0, last: 0 }; 256]; 4];
    let mut at = 0;
    while at < 4 * 256 {
        let (before, byte) = (at / 256, at % 256);
        let (mut run, mut last, mut count, mut bit) = (before as u32 + 1, 0, 0, 8);
        while bit > 0 {
            bit -= 1;
            let next = byte >> bit & 1;
            run = if next == last { run + 1 } else { 1 };
            last = next;
            if run == EQUAL_BITS {
                (last, run, count) = (1 - last, 1, count + 1);
            }
        }
        let (equal, last) = (run as u8 - 1, if last == 1 { 0xFF } else { 0 });
        table[before][byte] = Stuffing { count, equal, last };
        at += 1;
    }
    table
};

/// Bits from the start of a frame to the end of the space behind it, with the stuff bits that its
/// content needs.
#[must_use]
pub fn frame_bits(frame: &Frame) -> u32 {
    let raw = u128::from(frame.id().raw());
    // start of frame: zero; identifier; substitute remote request, identifier extension: ones;
    // identifier; no remote request, two reserved bits: zeros; length
    let head = raw >> 18 << 27 | 0b11 << 25 | (raw & 0x3_FFFF) << 7 | frame.bytes().len() as u128;
    let with = |bits: u128, byte: &u8| bits << 8 | u128::from(*byte);
    let bits = frame.bytes().iter().fold(head, with);
    let bytes = frame.bytes().len() as u32;
    let checked = bits << 15 | u128::from(crc(bits, 5 + bytes));
    // Two bits fill the first byte. The second one ends what was before the frame.
    let width = 54 + 8 * bytes;
    width + stuffed(checked | 0b01 << width, 7 + bytes) + BITS_AFTER_CRC
}

/// Check sequence of so many bytes. Zeros before them change nothing.
fn crc(bits: u128, bytes: u32) -> u16 {
    let add = |crc: u16, byte: u32| {
        let top = crc >> 7 ^ (bits >> (8 * byte)) as u16 & 0xFF;
        crc << 8 & 0x7FFF ^ CRC_OF_BYTE.get(usize::from(top)).copied().unwrap_or(0)
    };
    (0..bytes).rev().fold(0, add)
}

/// Stuff bits of so many bytes, of which the first bit is a zero.
fn stuffed(bits: u128, bytes: u32) -> u32 {
    let (mut state, mut count) = (Stuffing { count: 0, equal: 0, last: 0xFF }, 0);
    for at in (0..bytes).rev() {
        let (of, last) = (&STUFFING[usize::from(state.equal & 3)], state.last);
        // A byte after ones is the opposite of one after zeros.
        state = of[usize::from((bits >> (8 * at)) as u8 ^ last)];
        state.last ^= last;
        count += u32::from(state.count);
    }
    count
}

/// Slices of the window in which the load is counted.
const SLICES: usize = 10;
/// Length of a slice, ns.
const SLICE_NANOS: i64 = 100_000_000;

/// Share of the last second in which a bus was busy, in steps of 0.1 s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusLoad {
    rate: BitRate,
    busy_bits: [u32; SLICES],
    slice: i64,
}

impl BusLoad {
    /// An idle bus.
    #[must_use]
    pub const fn new(rate: BitRate) -> Self {
        Self { rate, busy_bits: [0; SLICES], slice: i64::MIN }
    }

    /// Counts a frame that ended at `now`. A time that goes back counts as the latest one.
    pub fn add(&mut self, now: Time, frame: &Frame) {
        self.turn_to(now);
        let slice = Self::index(self.slice);
        if let Some(bits) = self.busy_bits.get_mut(slice) {
            *bits = bits.saturating_add(frame_bits(frame));
        }
    }

    /// The share at `now`, 0 to 1; the slice that is not over yet is left out.
    #[must_use]
    pub fn share(&mut self, now: Time) -> f64 {
        self.turn_to(now);
        let current = Self::index(self.slice);
        let whole = self.busy_bits.iter().enumerate().filter(|(at, _)| *at != current);
        let bits: u64 = whole.map(|(_, bits)| u64::from(*bits)).sum();
        let window_nanos = (SLICES as i64 - 1) * SLICE_NANOS;
        (bits as f64 * self.rate.bit_nanos() as f64 / window_nanos as f64).min(1.0)
    }

    fn index(slice: i64) -> usize {
        slice.rem_euclid(SLICES as i64) as usize
    }

    /// Empties the slices that have gone by since the latest time.
    fn turn_to(&mut self, now: Time) {
        let slice = now.0.div_euclid(SLICE_NANOS);
        let passed = slice.saturating_sub(self.slice).clamp(0, SLICES as i64);
        for back in 0..passed {
            if let Some(bits) = self.busy_bits.get_mut(Self::index(slice - back)) {
                *bits = 0;
            }
        }
        self.slice = self.slice.max(slice);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Id;
    use proptest::prelude::*;

    #[test]
    fn the_check_sequence_is_crc_15_can() {
        let bits = b"123456789".iter().fold(0, |bits, byte| bits << 8 | u128::from(*byte));
        assert_eq!(crc(bits, 9), 0x059E, "check value of CRC-15/CAN");
    }

    #[test]
    fn long_runs_are_stuffed() {
        assert_eq!(stuffed(0b0101_1111, 1), 1);
        // the stuff bit is the first of the next run
        assert_eq!(stuffed(0b0001_0000_0111_1010, 2), 2);
        assert_eq!(stuffed(0b0001_0000_0011_1101, 2), 1);
        assert_eq!((stuffed(0, 3), stuffed(0x55, 1)), (4, 0));
    }

    /// Bit by bit, as they go over the wire.
    fn one_by_one(bits: u128, width: u32) -> (u16, u32) {
        let (mut crc, mut last, mut run, mut stuffed) = (0_u16, true, 0, 0);
        for at in (0..width).rev() {
            let bit = bits >> at & 1 == 1;
            let feedback = bit != (crc >> 14 & 1 == 1);
            crc = crc << 1 & 0x7FFF;
            if feedback {
                crc ^= CRC_GENERATOR;
            }
            run = if bit == last { run + 1 } else { 1 };
            last = bit;
            if run == EQUAL_BITS {
                (last, run, stuffed) = (!bit, 1, stuffed + 1);
            }
        }
        (crc, stuffed)
    }

    proptest! {
        #[test]
        fn bytes_are_checked_and_stuffed_as_their_bits(
            bits in any::<u128>(), sparse in any::<u128>(), bytes in 1_u32..=15
        ) {
            // Random bits have few long runs.
            for bits in [bits, bits & sparse & sparse.rotate_left(7), bits | sparse | !(bits >> 3)] {
                let bits = bits & ((1 << (8 * bytes - 1)) - 1);
                let all = (crc(bits, bytes), stuffed(bits, bytes));
                prop_assert_eq!(all, one_by_one(bits, 8 * bytes));
            }
        }

        #[test]
        fn a_frame_is_never_shorter_than_its_fields_nor_longer_than_fully_stuffed(
            raw in 0_u32..1 << 29, data in proptest::collection::vec(any::<u8>(), 0..=8)
        ) {
            let fields = 54 + 8 * data.len() as u32;
            let bits = frame_bits(&Frame::new(Id::from_raw(raw), &data).unwrap());
            prop_assert!(bits >= fields + BITS_AFTER_CRC, "{bits}");
            prop_assert!(bits <= fields + (fields - 1) / 4 + BITS_AFTER_CRC, "{bits}");
        }
    }

    #[test]
    fn the_load_is_that_of_the_last_second() {
        let frame = Frame::of(Id::from_raw(0x0CF0_0400), [0x55; 8]);
        let busy_s = f64::from(frame_bits(&frame)) * 4e-6;
        let mut load = BusLoad::new(BitRate::Kbit250);
        for ms in 0..1000 {
            load.add(Time(ms * 1_000_000), &frame);
        }
        let expected = busy_s * 1000.0;
        assert!((load.share(Time(999_999_999)) - expected).abs() < 1e-9);
        assert!(load.share(Time(1_450_000_000)) < 0.6 * expected);
        assert_eq!(load.share(Time(2_100_000_000)), 0.0);
        // a clock that jumps far, forwards or back, breaks nothing
        for time in [i64::MAX, i64::MIN, 0] {
            load.add(Time(time), &frame);
            assert!(load.share(Time(time)) <= 1.0);
        }
    }
}
