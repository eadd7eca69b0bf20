//! Counters and checksums of the messages that move a truck (SAE J1939-71, SPN 3188, 3189, 4206,
//! 4207): both lie in byte 8, the counter in its low half and the checksum in its high half.
//!
//! The sum goes over bytes 1 to 7, the counter and the four bytes of the identifier as it is sent.
//! Older controllers send FF there, which says "not available" and not "wrong": a receiver decides
//! source by source what it demands ([`Policy`]). What carries a brake demand, and with which key,
//! depends on the truck maker: a [`Carrier`] is configuration.

use crate::message::{Aebs2, Sas, Tsc1, Xbr};
use crate::{Frame, Id, J1939Error, Message, Slot};

/// How a sum is folded into a checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub enum Formula {
    /// TSC1: three bits (SPN 4207).
    ThreeBits,
    /// XBR, AEBS2 and SAS: four bits (SPN 3188, 5683, 3690).
    FourBits,
}

/// How a message proves that it is whole and new.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub struct Protection {
    /// How the sum is folded.
    pub formula: Formula,
    /// The counter counts from 0 to one below this.
    pub counter_modulus: u8,
    /// What a truck maker adds to the sum; 0 in the standard.
    pub key: u8,
}

impl Protection {
    /// The checksum of eight bytes with the counter already in the low half of the last one.
    #[must_use]
    pub fn checksum(self, id: Id, data: [u8; 8]) -> u8 {
        let [b1, b2, b3, b4, b5, b6, b7, b8] = data.map(u16::from);
        let id: u16 = id.raw().to_be_bytes().map(u16::from).iter().sum();
        let sum = b1 + b2 + b3 + b4 + b5 + b6 + b7 + (b8 & 0xF) + id + u16::from(self.key);
        let folded = match self.formula {
            // The term `& 3` is in the standard; many write it without, and fail on large sums.
            Formula::ThreeBits => (((sum >> 6) & 3) + (sum >> 3) + sum) & 0x7,
            Formula::FourBits => ((sum >> 4) + sum) & 0xF,
        };
        folded as u8
    }
}

/// What a protected message travels in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub struct Carrier {
    /// Parameter group on the wire; another than the message's own where a maker wants it so.
    pub pgn: u32,
    /// Priority, 0 to 7.
    pub priority: u8,
    /// Counter and checksum.
    pub protection: Protection,
}

impl Carrier {
    /// TSC1 as in the standard. Counters of this message are seen to wrap at 8.
    pub const TSC1: Self = Self::standard::<Tsc1>(Formula::ThreeBits, 8);
    /// XBR as in the standard.
    pub const XBR: Self = Self::standard::<Xbr>(Formula::FourBits, 16);
    /// AEBS2 as in the standard.
    pub const AEBS2: Self = Self::standard::<Aebs2>(Formula::FourBits, 16);
    /// SAS as in the standard.
    pub const SAS: Self = Self::standard::<Sas>(Formula::FourBits, 16);

    const fn standard<M: Message>(formula: Formula, counter_modulus: u8) -> Self {
        let protection = Protection { formula, counter_modulus, key: 0 };
        Self { pgn: M::TABLE.pgn, priority: M::TABLE.priority, protection }
    }

    /// XBR in a frame of Proprietary A (PGN 61184) with the customer's key in the sum, as brake
    /// controllers of Bendix take it from a radar (seen in California PATH's Volvo trucks).
    #[must_use]
    pub const fn proprietary_xbr(key: u8) -> Self {
        let protection = Protection { key, ..Self::XBR.protection };
        Self { pgn: crate::message::PROPRIETARY_A, priority: Self::XBR.priority, protection }
    }
}

/// A message with counter and checksum in byte 8.
pub trait Protected: Message<Bytes = [u8; 8]> + Copy {
    /// The message with some counter and checksum: without, it does not encode.
    #[must_use]
    fn protectable(self) -> Self;
}

macro_rules! protected {
    ($($message:ident),*) => {$(
        impl Protected for $message {
            fn protectable(self) -> Self {
                Self { counter: Slot::Value(0), checksum: Slot::Value(0), ..self }
            }
        }
    )*};
}
protected!(Tsc1, Xbr, Aebs2, Sas);

/// Sends one message: counts and signs. Each destination has its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sealer {
    carrier: Carrier,
    counter: u8,
}

impl Sealer {
    /// A sender whose first counter is 0.
    #[must_use]
    pub const fn new(carrier: Carrier) -> Self {
        Self { carrier, counter: 0 }
    }

    /// The frame of `message` with the next counter and its checksum, from `sa` to `da`. The
    /// counter moves only where a frame came out.
    ///
    /// # Errors
    /// As [`Message::encode`] and [`Id::new`].
    pub fn seal<M: Protected>(&mut self, message: M, da: u8, sa: u8) -> Result<Frame, J1939Error> {
        self.seal_bytes(message.protectable().encode()?, da, sa)
    }

    /// The frame of these bytes, the last one replaced.
    pub(crate) fn seal_bytes(
        &mut self,
        data: [u8; 8],
        da: u8,
        sa: u8,
    ) -> Result<Frame, J1939Error> {
        let Carrier { pgn, priority, protection } = self.carrier;
        let id = Id::new(priority, pgn, da, sa)?;
        let mut data = data;
        let [.., signature] = &mut data;
        *signature = self.counter;
        let checksum = protection.checksum(id, data);
        let [.., signature] = &mut data;
        *signature = checksum << 4 | self.counter;
        self.counter = (self.counter + 1) % protection.counter_modulus.max(1);
        Ok(Frame::of(id, data))
    }
}

/// What a receiver demands of one source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Policy {
    /// Counter and checksum must be there and right.
    #[default]
    Required,
    /// They must be right where they are there: byte 8 = FF passes.
    WherePresent,
    /// They are not looked at.
    Ignored,
}

/// What a receiver finds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Whole and new.
    Good,
    /// Byte 8 says "not available", and the policy lets that pass.
    Unprotected,
    /// Byte 8 is missing or says "not available", and the policy demands it.
    Missing,
    /// The checksum is not that of the bytes.
    Checksum {
        /// What is in the frame.
        found: u8,
        /// What the bytes give.
        expected: u8,
    },
    /// The counter did not move since the last frame.
    Stuck {
        /// The counter.
        counter: u8,
    },
    /// The counter moved by more than one, or backwards.
    Jump {
        /// What is in the frame.
        found: u8,
        /// What follows the last frame.
        expected: u8,
    },
}

impl Verdict {
    /// Whether the policy lets the frame act.
    #[must_use]
    pub const fn passes(self) -> bool {
        matches!(self, Self::Good | Self::Unprotected)
    }
}

/// Receives one message from one source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Checker {
    protection: Protection,
    policy: Policy,
    last: Option<u8>,
}

impl Checker {
    /// A receiver that has seen nothing yet: it accepts any first counter.
    #[must_use]
    pub const fn new(protection: Protection, policy: Policy) -> Self {
        Self { protection, policy, last: None }
    }

    /// Judges the next frame of the source. A wrong checksum does not move the counter; a jump does,
    /// so that one lost frame is reported once.
    pub fn check(&mut self, frame: &Frame) -> Verdict {
        if self.policy == Policy::Ignored {
            return Verdict::Unprotected;
        }
        let Ok(data) = <[u8; 8]>::try_from(frame.bytes()) else {
            return Verdict::Missing;
        };
        let [.., signature] = data;
        let (counter, found) = (signature & 0xF, signature >> 4);
        let expected = self.protection.checksum(frame.id(), data);
        if found != expected {
            return match (signature, self.policy) {
                (0xFF, Policy::WherePresent) => Verdict::Unprotected,
                (0xFF, _) => Verdict::Missing,
                _ => Verdict::Checksum { found, expected },
            };
        }
        let modulus = self.protection.counter_modulus.max(1);
        let next = self.last.map(|last| (last + 1) % modulus);
        let last = self.last.replace(counter);
        match next {
            _ if last == Some(counter) => Verdict::Stuck { counter },
            Some(expected) if expected != counter => Verdict::Jump { found: counter, expected },
            _ => Verdict::Good,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vectors::{TSC1, XBR};

    #[test]
    fn public_vectors_have_the_checksum_that_the_formulas_give() {
        for (id, data) in TSC1 {
            let given = Carrier::TSC1.protection.checksum(Id::from_raw(id), data);
            assert_eq!(given, data[7] >> 4, "{id:08X} {data:02X?}");
        }
        assert_eq!(Carrier::XBR.protection.checksum(Id::from_raw(XBR.0), XBR.1), 5);
    }

    #[test]
    fn one_wrong_bit_anywhere_is_noticed() {
        for (protection, (id, data)) in
            [(Carrier::TSC1.protection, TSC1[0]), (Carrier::XBR.protection, XBR)]
        {
            for bit in 0..64 {
                let mut wrong = data;
                wrong[bit / 8] ^= 1 << (bit % 8);
                let mut checker = Checker::new(protection, Policy::Required);
                let verdict = checker.check(&Frame::of(Id::from_raw(id), wrong));
                assert!(!verdict.passes(), "bit {bit} of {id:08X}: {verdict:?}");
            }
        }
    }

    fn brake(acceleration_m_s2: f64) -> Xbr {
        Xbr {
            acceleration_demand_m_s2: Slot::Value(acceleration_m_s2),
            endurance_brake_mode: Slot::Value(0),
            priority: Slot::Value(0),
            control_mode: Slot::Value(2),
            compensation_mode: Slot::Value(0),
            urgency_frac: Slot::Value(0.0),
            ..Xbr::default()
        }
    }

    #[test]
    fn what_a_sealer_sends_a_checker_takes_and_counters_wrap() {
        for (carrier, frames) in
            [(Carrier::XBR, 40), (Carrier::TSC1, 20), (Carrier::proprietary_xbr(5), 40)]
        {
            let mut sealer = Sealer::new(carrier);
            let mut checker = Checker::new(carrier.protection, Policy::Required);
            for i in 0..frames {
                let frame = if carrier.pgn == Carrier::TSC1.pgn {
                    let demand = Tsc1 {
                        override_mode: Slot::Value(2),
                        speed_condition: Slot::Value(0),
                        priority: Slot::Value(0),
                        torque_request_frac: Slot::Value(0.25),
                        transmission_rate: Slot::Value(7),
                        control_purpose: Slot::Value(6),
                        ..Tsc1::default()
                    };
                    sealer.seal(demand, 0x00, 0x27)
                } else {
                    sealer.seal(brake(-0.1 * f64::from(i)), 0x0B, 0x2A)
                }
                .unwrap();
                assert_eq!(checker.check(&frame), Verdict::Good);
                let counter = frame.bytes()[7] & 0xF;
                assert_eq!(
                    u32::from(counter),
                    i as u32 % u32::from(carrier.protection.counter_modulus)
                );
            }
        }
    }

    #[test]
    fn a_wrong_key_is_a_wrong_checksum() {
        let mut sealer = Sealer::new(Carrier::proprietary_xbr(5));
        let frame = sealer.seal(brake(-2.0), 0x0B, 0x2A).unwrap();
        assert_eq!(frame.id().raw(), 0x0CEF_0B2A);
        let mut standard = Checker::new(Carrier::XBR.protection, Policy::Required);
        assert!(matches!(standard.check(&frame), Verdict::Checksum { .. }));
    }

    #[test]
    fn lost_repeated_and_old_frames_are_told_apart() {
        let frames: Vec<Frame> = {
            let mut sealer = Sealer::new(Carrier::XBR);
            (0..6).map(|_| sealer.seal(brake(-1.0), 0x0B, 0x2A).unwrap()).collect()
        };
        let mut checker = Checker::new(Carrier::XBR.protection, Policy::Required);
        let verdicts = [0, 1, 1, 4, 5, 2].map(|i| checker.check(&frames[i]));
        assert_eq!(
            verdicts,
            [
                Verdict::Good,
                Verdict::Good,
                Verdict::Stuck { counter: 1 },
                Verdict::Jump { found: 4, expected: 2 },
                Verdict::Good,
                Verdict::Jump { found: 2, expected: 6 },
            ]
        );
    }

    #[test]
    fn not_available_is_not_wrong_unless_it_is_demanded() {
        // TSC1 of a transmission of 2014
        let old =
            Frame::of(Id::from_raw(0x0C00_0003), [0xC0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]);
        let check = |policy| Checker::new(Carrier::TSC1.protection, policy).check(&old);
        assert_eq!(
            [Policy::Required, Policy::WherePresent, Policy::Ignored].map(check),
            [Verdict::Missing, Verdict::Unprotected, Verdict::Unprotected]
        );
        let short = Frame::new(Id::from_raw(0x0C00_0003), &[0xC0; 4]).unwrap();
        assert_eq!(
            Checker::new(Carrier::TSC1.protection, Policy::WherePresent).check(&short),
            Verdict::Missing
        );
    }
}
