//! What the firmware and a test of truck-node do alike; both print the same bits.

pub mod codec;
pub mod drive;
pub mod transfer;

/// All bits of what was computed, FNV-1a, 64 bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bits(pub u64);

impl Bits {
    /// Nothing yet.
    pub const NONE: Self = Self(0xCBF2_9CE4_8422_2325);

    /// Adds bytes.
    pub fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x100_0000_01B3);
        }
    }

    /// Adds a number with every bit.
    pub fn number(&mut self, number: f64) {
        self.add(&number.to_bits().to_le_bytes());
    }
}
