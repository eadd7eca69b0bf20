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

/// Bits from the start of a frame to the end of the space behind it, with the stuff bits that its
/// content needs.
#[must_use]
pub fn frame_bits(frame: &Frame) -> u32 {
    let raw = frame.id().raw();
    let mut bits = Stuffed { crc: 0, last: true, run: 0, count: 0 };
    bits.push(0, 1); // start of frame
    bits.push(raw >> 18, 11);
    bits.push(0b11, 2); // substitute remote request, identifier extension
    bits.push(raw & 0x3_FFFF, 18);
    bits.push(0, 3); // no remote request, two reserved bits
    bits.push(frame.bytes().len() as u32, 4);
    for byte in frame.bytes() {
        bits.push(u32::from(*byte), 8);
    }
    let crc = u32::from(bits.crc);
    bits.push(crc, 15);
    bits.count + BITS_AFTER_CRC
}

/// Counts bits as they go over the wire.
struct Stuffed {
    crc: u16,
    last: bool,
    run: u32,
    count: u32,
}

impl Stuffed {
    /// The low `width` bits of a value, highest first.
    fn push(&mut self, value: u32, width: u32) {
        for at in (0..width).rev() {
            let bit = value >> at & 1 == 1;
            let feedback = bit != (self.crc >> 14 & 1 == 1);
            self.crc = self.crc << 1 & 0x7FFF;
            if feedback {
                self.crc ^= CRC_GENERATOR;
            }
            self.run = if bit == self.last { self.run + 1 } else { 1 };
            (self.last, self.count) = (bit, self.count + 1);
            if self.run == EQUAL_BITS {
                (self.last, self.run, self.count) = (!bit, 1, self.count + 1);
            }
        }
    }
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
        let mut bits = Stuffed { crc: 0, last: true, run: 0, count: 0 };
        for byte in b"123456789" {
            bits.push(u32::from(*byte), 8);
        }
        assert_eq!(bits.crc, 0x059E, "check value of CRC-15/CAN");
    }

    #[test]
    fn long_runs_are_stuffed() {
        let mut bits = Stuffed { crc: 0, last: true, run: 0, count: 0 };
        bits.push(0, 5);
        assert_eq!(bits.count, 6);
        // the stuff bit is the first of the next run
        bits.push(0b1111, 4);
        assert_eq!(bits.count, 6 + 4 + 1);
    }

    proptest! {
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
