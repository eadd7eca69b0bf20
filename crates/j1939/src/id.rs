//! The 29-bit identifier: priority, parameter group, destination and source (SAE J1939-21, 5.2).
//!
//! ```text
//! bit   28..26    25   24   23..16      15..8          7..0
//!       priority  EDP  DP   PDU format  PDU specific   source address
//! ```
//! Below PDU format 240 (PDU1) the specific byte is the destination and no part of the parameter
//! group number; from 240 on (PDU2) it extends the number and the frame goes to everybody.

use crate::J1939Error;

/// Destination of a frame to everybody.
pub const GLOBAL_ADDRESS: u8 = 0xFF;
/// Source of a node that has no address yet, or could not claim one.
pub const NULL_ADDRESS: u8 = 0xFE;
/// The largest parameter group number: 18 bits.
pub const PGN_MAX: u32 = 0x3_FFFF;

/// The first PDU format whose frames go to everybody (PDU2).
const FIRST_PDU2_FORMAT: u32 = 240;
/// The lowest priority, which is the largest number.
const LOWEST_PRIORITY: u8 = 7;

/// Whether frames of a parameter group carry a destination (PDU1).
const fn has_destination(pgn: u32) -> bool {
    (pgn >> 8) & 0xFF < FIRST_PDU2_FORMAT
}

/// Identifier of a J1939 frame. Every value of this type exists on a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Id {
    priority: u8,
    pgn: u32,
    da: u8,
    sa: u8,
}

impl Id {
    /// An identifier of its parts: priority 0 (first) to 7, parameter group number, destination
    /// address ([`GLOBAL_ADDRESS`] for everybody), source address.
    ///
    /// # Errors
    /// For a priority or parameter group that does not exist, and for a destination of a group that
    /// goes to everybody.
    pub const fn new(priority: u8, pgn: u32, da: u8, sa: u8) -> Result<Self, J1939Error> {
        if priority > LOWEST_PRIORITY {
            return Err(J1939Error::Priority(priority));
        }
        if pgn > PGN_MAX || (has_destination(pgn) && pgn & 0xFF != 0) {
            return Err(J1939Error::Pgn(pgn));
        }
        if !has_destination(pgn) && da != GLOBAL_ADDRESS {
            return Err(J1939Error::Destination { pgn, da });
        }
        Ok(Self { priority, pgn, da, sa })
    }

    /// The identifier in the low 29 bits; the bits above are ignored.
    #[must_use]
    pub const fn from_raw(raw: u32) -> Self {
        let group = (raw >> 8) & PGN_MAX;
        let specific = group as u8;
        let (pgn, da) = if has_destination(group) {
            (group & !0xFF, specific)
        } else {
            (group, GLOBAL_ADDRESS)
        };
        Self { priority: (raw >> 26) as u8 & LOWEST_PRIORITY, pgn, da, sa: raw as u8 }
    }

    /// The 29 bits as they go over the wire.
    #[must_use]
    pub const fn raw(self) -> u32 {
        let specific = if has_destination(self.pgn) { self.da as u32 } else { 0 };
        (self.priority as u32) << 26 | (self.pgn | specific) << 8 | self.sa as u32
    }

    /// Priority, 0 (first) to 7.
    #[must_use]
    pub const fn priority(self) -> u8 {
        self.priority
    }

    /// Parameter group number, 0 to [`PGN_MAX`].
    #[must_use]
    pub const fn pgn(self) -> u32 {
        self.pgn
    }

    /// Destination address; [`GLOBAL_ADDRESS`] for everybody.
    #[must_use]
    pub const fn da(self) -> u8 {
        self.da
    }

    /// Source address.
    #[must_use]
    pub const fn sa(self) -> u8 {
        self.sa
    }

    /// Whether a node at `address` is meant.
    #[must_use]
    pub const fn is_for(self, address: u8) -> bool {
        self.da == address || self.da == GLOBAL_ADDRESS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_29_bit_identifier_is_read_and_written_again(raw in 0_u32..1 << 29) {
            let id = Id::from_raw(raw);
            prop_assert_eq!(id.raw(), raw);
            prop_assert_eq!(Id::new(id.priority(), id.pgn(), id.da(), id.sa()), Ok(id));
        }
    }

    #[test]
    fn the_parts_of_known_identifiers() {
        // EEC1 of an engine, TSC1 of a brake controller to it, and a claim (J1939-71, -81).
        let parts = |raw| {
            let id = Id::from_raw(raw);
            (id.priority(), id.pgn(), id.da(), id.sa())
        };
        assert_eq!(parts(0x0CF0_0400), (3, 61_444, 0xFF, 0x00));
        assert_eq!(parts(0x0C00_000B), (3, 0, 0x00, 0x0B));
        assert_eq!(parts(0x18EE_FF80), (6, 60_928, 0xFF, 0x80));
    }

    #[test]
    fn what_is_on_no_bus_is_refused_by_name() {
        assert_eq!(Id::new(8, 0, 0, 0), Err(J1939Error::Priority(8)));
        assert_eq!(Id::new(3, 0x4_0000, 0xFF, 0), Err(J1939Error::Pgn(0x4_0000)));
        assert_eq!(Id::new(3, 1_025, 0x0B, 0), Err(J1939Error::Pgn(1_025)));
        assert_eq!(
            Id::new(3, 61_444, 0x0B, 0),
            Err(J1939Error::Destination { pgn: 61_444, da: 0x0B })
        );
    }
}
