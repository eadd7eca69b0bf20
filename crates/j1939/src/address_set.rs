//! A set of addresses.

/// Which of the 256 addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AddressSet([u64; 4]);

impl AddressSet {
    /// None.
    pub const EMPTY: Self = Self([0; 4]);

    /// These addresses.
    #[must_use]
    pub fn of(addresses: &[u8]) -> Self {
        let mut set = Self::EMPTY;
        addresses.iter().for_each(|address| set.insert(*address));
        set
    }

    /// Puts an address in.
    pub const fn insert(&mut self, address: u8) {
        // a quarter of eight bits is one of four words
        self.0[address as usize >> 6] |= 1 << (address & 63);
    }

    /// Whether the address is in the set.
    #[must_use]
    pub const fn contains(self, address: u8) -> bool {
        self.0[address as usize >> 6] >> (address & 63) & 1 == 1
    }

    /// Whether no address is in the set.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        let [a, b, c, d] = self.0;
        a | b | c | d == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_address_is_its_own_bit() {
        for address in 0..=u8::MAX {
            let set = AddressSet::of(&[address]);
            assert!(!set.is_empty());
            assert!((0..=u8::MAX).all(|other| set.contains(other) == (other == address)));
        }
        assert!(AddressSet::EMPTY.is_empty());
    }
}
