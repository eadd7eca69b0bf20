//! Getting an address and keeping it (SAE J1939-81).
//!
//! A node says which address it wants, waits 250 ms for somebody with a smaller NAME to object, and
//! defends the address afterwards. Who loses takes another one if its NAME says that it can, or says
//! that it cannot claim, after a delay that differs from node to node.
//!
//! A NAME of zero beats every other and belongs to no controller: it is an attack (it silenced the
//! engine of a Kenworth T270). Such a claim is answered with our own and never yielded to.

use tractrix_core::Time;

use crate::bus::{Bus, BusError};
use crate::{AddressSet, Frame, GLOBAL_ADDRESS, Id, NULL_ADDRESS, Request, TpMessage};

/// Parameter group of a claim, and with the null address of "cannot claim".
pub const ADDRESS_CLAIMED_PGN: u32 = 60_928;
/// Parameter group that gives a node another address.
pub const COMMANDED_ADDRESS_PGN: u32 = 65_240;

/// A node waits so long for objections, ns.
const HOLD_OFF: i64 = 250_000_000;
/// Step of the delay before "cannot claim", ns: 0 to 255 steps are 0 to 153 ms.
const DELAY_STEP: i64 = 600_000;
/// Addresses that a node which can choose tries.
const CHOICE: core::ops::RangeInclusive<u8> = 128..=247;
const PRIORITY: u8 = 6;

/// NAME of a node: 64 bits, the smaller one keeps the address.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub struct Name(pub u64);

impl Name {
    /// Whether the node can take another address (bit 64).
    #[must_use]
    pub const fn can_choose(self) -> bool {
        self.0 >> 63 == 1
    }

    /// Function that the node has, 0 to 255 (bits 41 to 48).
    #[must_use]
    pub const fn function(self) -> u8 {
        (self.0 >> 40) as u8
    }

    /// Number of the maker, 0 to 2047 (bits 22 to 32).
    #[must_use]
    pub const fn manufacturer(self) -> u16 {
        (self.0 >> 21) as u16 & 0x7FF
    }

    /// Serial number, 0 to 2^21 - 1 (bits 1 to 21).
    #[must_use]
    pub const fn identity(self) -> u32 {
        self.0 as u32 & 0x1F_FFFF
    }

    /// The NAME in a claim, when the frame is one.
    #[must_use]
    pub fn claimed_in(frame: &Frame) -> Option<Self> {
        let bytes = frame.bytes().first_chunk::<8>()?;
        (frame.id().pgn() == ADDRESS_CLAIMED_PGN).then_some(Self(u64::from_le_bytes(*bytes)))
    }

    /// The claim of an address; of [`NULL_ADDRESS`]: "cannot claim".
    #[must_use]
    pub fn claim(self, address: u8) -> Frame {
        let raw = u32::from(PRIORITY) << 26
            | (ADDRESS_CLAIMED_PGN | u32::from(GLOBAL_ADDRESS)) << 8
            | u32::from(address);
        Frame::of(Id::from_raw(raw), self.0.to_le_bytes())
    }
}

/// Where a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimState {
    /// The claim is to be sent.
    Announcing,
    /// It was sent; objections are awaited since this time.
    Waiting(Time),
    /// The address may be used.
    Claimed,
    /// It is another's; "cannot claim" is to be sent at this time.
    Losing(Time),
    /// It is another's.
    Lost,
}

/// The claim of one node.
#[derive(Debug, Clone)]
pub struct AddressClaim {
    name: Name,
    address: u8,
    state: ClaimState,
    /// How long to wait before "cannot claim", ns.
    delay: i64,
    bypassed: bool,
    /// Somebody asked for our claim, or claimed our address in vain.
    answer_due: bool,
    /// Addresses that others have.
    taken: AddressSet,
}

impl AddressClaim {
    /// A node that wants an address from 0 to 253. `delay_steps` of 0.6 ms pass before "cannot
    /// claim": a random number, so that nodes which lose together do not speak together.
    #[must_use]
    pub const fn new(name: Name, address: u8, delay_steps: u8) -> Self {
        let usable = address < NULL_ADDRESS;
        Self {
            name,
            address,
            state: if usable { ClaimState::Announcing } else { ClaimState::Lost },
            delay: delay_steps as i64 * DELAY_STEP,
            bypassed: false,
            answer_due: false,
            taken: AddressSet::EMPTY,
        }
    }

    /// A node on a bus without network management: it uses its address at once, claims nothing and
    /// answers nothing. Not for a bus where anybody else may have the address.
    #[must_use]
    pub const fn bypass(name: Name, address: u8) -> Self {
        Self { state: ClaimState::Claimed, bypassed: true, ..Self::new(name, address, 0) }
    }

    /// The address, as soon as and as long as it may be used.
    #[must_use]
    pub const fn address(&self) -> Option<u8> {
        match self.state {
            ClaimState::Claimed => Some(self.address),
            _ => None,
        }
    }

    /// Where the node is.
    #[must_use]
    pub const fn state(&self) -> ClaimState {
        self.state
    }

    /// Its NAME.
    #[must_use]
    pub const fn name(&self) -> Name {
        self.name
    }

    /// Takes a frame that was heard at `now`, whatever it is.
    pub fn on_frame(&mut self, now: Time, frame: &Frame) {
        if self.bypassed {
            return;
        }
        if let Some(name) = Name::claimed_in(frame) {
            self.on_claim(now, frame.id().sa(), name);
        }
        if let Some(request) = Request::of(frame)
            && request.pgn == ADDRESS_CLAIMED_PGN
        {
            self.on_request(now, request.da);
        }
    }

    /// Takes a message of the transport, whatever it is: a commanded address for this NAME is
    /// claimed in place of the old one.
    pub fn on_message(&mut self, message: &TpMessage<'_>) {
        let Some((name, [address, ..])) = message.bytes.split_first_chunk::<8>() else { return };
        let ours = message.pgn == COMMANDED_ADDRESS_PGN && u64::from_le_bytes(*name) == self.name.0;
        if ours && *address < NULL_ADDRESS && !self.bypassed {
            (self.address, self.state) = (*address, ClaimState::Announcing);
        }
    }

    /// Sends what is due at `now`; what the bus has no room for goes at the next call.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn poll(&mut self, now: Time, bus: &mut impl Bus) -> Result<(), BusError> {
        match self.send_due(now, bus) {
            Err(BusError::Full(_)) => Ok(()),
            result => result,
        }
    }

    fn send_due(&mut self, now: Time, bus: &mut impl Bus) -> Result<(), BusError> {
        match self.state {
            ClaimState::Announcing => {
                bus.send(now, &self.name.claim(self.address))?;
                (self.state, self.answer_due) = (ClaimState::Waiting(now), false);
            }
            ClaimState::Losing(at) if now >= at => {
                bus.send(now, &self.name.claim(NULL_ADDRESS))?;
                self.state = ClaimState::Lost;
            }
            ClaimState::Waiting(since) if now.0.saturating_sub(since.0) >= HOLD_OFF => {
                self.state = ClaimState::Claimed;
            }
            ClaimState::Waiting(_) | ClaimState::Claimed if self.answer_due => {
                bus.send(now, &self.name.claim(self.address))?;
                self.answer_due = false;
            }
            _ => {}
        }
        Ok(())
    }

    /// Somebody claims an address.
    fn on_claim(&mut self, now: Time, sa: u8, name: Name) {
        if sa >= NULL_ADDRESS || name == self.name {
            return;
        }
        self.taken.insert(sa);
        let holding = !matches!(self.state, ClaimState::Losing(_) | ClaimState::Lost);
        if sa != self.address || !holding {
            return;
        }
        if self.name < name || name.0 == 0 {
            self.answer_due = true;
            return;
        }
        let free = CHOICE.into_iter().find(|address| !self.taken.contains(*address));
        match free.filter(|_| self.name.can_choose()) {
            Some(address) => (self.address, self.state) = (address, ClaimState::Announcing),
            None => self.state = ClaimState::Losing(now.plus_nanos(self.delay)),
        }
    }

    /// Somebody asks who has an address.
    fn on_request(&mut self, now: Time, da: u8) {
        match self.state {
            // Asked by everybody's address, a node without one answers too
            ClaimState::Lost if da == GLOBAL_ADDRESS => {
                self.state = ClaimState::Losing(now.plus_nanos(self.delay));
            }
            ClaimState::Waiting(_) | ClaimState::Claimed => {
                self.answer_due |= da == GLOBAL_ADDRESS || da == self.address;
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests;
