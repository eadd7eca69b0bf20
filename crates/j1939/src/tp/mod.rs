//! Messages of more than eight bytes: TP (9 to 1785 bytes, broadcast or to one address) and ETP
//! (beyond, to one address), both ways, without I/O (SAE J1939-21, 5.10).
//!
//! **Memory.** A transport has `SESSIONS` buffers of `BYTES` bytes, for all directions together.
//! When all are in use, who is refused first: a source that has not claimed its address. Its new
//! session is refused whatever runs; its running session gives way to a new one of a claimed source
//! and to a message of our own. Nothing else is ever displaced. A source has one broadcast at a
//! time and one session to this node; a second broadcast replaces the first.
//!
//! **Tolerated**, because real units do it: any priority, windows up to 255, clear-to-send and end
//! of message that belong to nobody's session, repeated packets, a destination in the low byte of
//! a parameter group number. **Dropped**: a broadcast announcement to an address, a request to
//! send to everybody, lengths that do not fit their number of packets.
//!
//! **Loss.** Packets that are missing at the end of a window are asked for again, at most twice in
//! a row; a broadcast with a missing packet is given up.

mod control;
mod reason;
mod receive;
mod send;
mod session;

pub use reason::AbortReason;
use tractrix_core::Time;

use crate::bus::{Bus, BusError};
use crate::{
    ADDRESS_CLAIMED_PGN, AddressSet, Frame, GLOBAL_ADDRESS, Id, J1939Error, NULL_ADDRESS, Name,
};
use control::{Control, Protocol, What};
use session::{Outcome, Session, Stage, answer};

const MS: i64 = 1_000_000;
/// Between the packets of a sender, ns.
const T1: i64 = 750 * MS;
/// From clear-to-send to the first packet, ns.
const T2: i64 = 1250 * MS;
/// From the last packet to clear-to-send or end of message, ns.
const T3: i64 = 1250 * MS;
/// From a hold to the next clear-to-send, ns.
const T4: i64 = 1050 * MS;
/// Between two holds of a receiver, ns.
const TH: i64 = 500 * MS;
/// Within this a node has to answer, ns: after it a sender that cannot send gives up.
const TR: i64 = 200 * MS;
/// Between the packets of a broadcast, ns: 50 to 200 ms.
const BAM_GAP: i64 = 50 * MS;
/// How often in a row packets are asked for again.
const RETRIES: u8 = 2;
/// Holds in a row that a sender waits for: one minute at TH.
const HOLDS: u8 = 120;
/// Refusals that wait to be sent; more are dropped, the sender times out.
const REFUSALS: usize = 8;

/// A message that has arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TpMessage<'a> {
    /// When its last packet came.
    pub time: Time,
    /// Parameter group.
    pub pgn: u32,
    /// Destination address.
    pub da: u8,
    /// Source address.
    pub sa: u8,
    /// Content.
    pub bytes: &'a [u8],
}

/// How a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TpEvent<'a> {
    /// A message has arrived.
    Received(TpMessage<'a>),
    /// A message has been sent; to one address: and acknowledged.
    Sent {
        /// Parameter group.
        pgn: u32,
        /// Destination address.
        da: u8,
    },
    /// A session was given up.
    Failed {
        /// Parameter group.
        pgn: u32,
        /// Destination address.
        da: u8,
        /// Source address.
        sa: u8,
        /// Why.
        reason: AbortReason,
        /// Whether the other side gave up.
        by_peer: bool,
    },
}

/// What was refused, since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TpCounts {
    /// Sessions refused or displaced for want of memory.
    pub refused: u64,
    /// Control messages that contradict themselves, broadcasts to an address among them.
    pub malformed: u64,
}

/// Whose sessions a transport takes part in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    /// A node; without an address it hears broadcasts only.
    Node(Option<u8>),
    /// Hears all sessions of all pairs and never sends.
    Listener,
}

/// All transport sessions of a node, in `SESSIONS` buffers of `BYTES` bytes.
#[derive(Debug, Clone)]
pub struct Transport<const SESSIONS: usize, const BYTES: usize> {
    role: Role,
    /// Most packets that a sender is cleared for at once.
    window: u8,
    held: bool,
    sessions: [Session<BYTES>; SESSIONS],
    /// Which addresses somebody has claimed.
    claimed: AddressSet,
    refusals: [Option<Frame>; REFUSALS],
    counts: TpCounts,
}

impl<const SESSIONS: usize, const BYTES: usize> Transport<SESSIONS, BYTES> {
    /// The transport of a node without an address yet. Senders are cleared for `window` packets at
    /// once, at least one.
    #[must_use]
    pub const fn new(window: u8) -> Self {
        Self::with_role(Role::Node(None), if window == 0 { 1 } else { window })
    }

    /// A transport that puts together the messages between any other nodes and never sends.
    #[must_use]
    pub const fn listener() -> Self {
        Self::with_role(Role::Listener, u8::MAX)
    }

    const fn with_role(role: Role, window: u8) -> Self {
        Self {
            role,
            window,
            held: false,
            sessions: [const { Session::free() }; SESSIONS],
            claimed: AddressSet::EMPTY,
            refusals: [None; REFUSALS],
            counts: TpCounts { refused: 0, malformed: 0 },
        }
    }

    /// Takes the address that the node has claimed, or none when it lost it. Sessions from and to
    /// the old address end without a word, for it is another node's.
    pub fn set_address(&mut self, address: Option<u8>) {
        if self.role == Role::Listener || self.role == Role::Node(address) {
            return;
        }
        self.role = Role::Node(address);
        for session in &mut self.sessions {
            let ours = session.sending || session.da != GLOBAL_ADDRESS;
            if session.is_running() && ours {
                session.fail(AbortReason::OTHER, false);
            }
        }
    }

    /// Whether senders to this node are told to wait instead of being cleared to send.
    pub const fn set_hold(&mut self, held: bool) {
        self.held = held;
    }

    /// What was refused so far.
    #[must_use]
    pub const fn counts(&self) -> TpCounts {
        self.counts
    }

    /// Sessions under way, those among them whose end nobody has asked for with [`Self::event`].
    #[must_use]
    pub fn sessions(&self) -> usize {
        self.sessions.iter().filter(|session| session.stage != Stage::Free).count()
    }

    /// Starts to send a message with a priority of 0 to 7, to everybody or to `da`; up to eight
    /// bytes go as one frame. The end is an event.
    ///
    /// # Errors
    /// Without an address, with such a message to this destination still under way, without memory,
    /// for a group that does not exist or a length that cannot be sent: none, more than 1785 bytes
    /// to everybody, more than `BYTES`.
    pub fn send(
        &mut self,
        now: Time,
        priority: u8,
        pgn: u32,
        da: u8,
        bytes: &[u8],
    ) -> Result<(), J1939Error> {
        let Role::Node(Some(sa)) = self.role else { return Err(J1939Error::NoAddress) };
        let broadcast = da == GLOBAL_ADDRESS;
        // A group that goes to everybody may be sent to one address when it is longer than a frame
        let target = Id::new(priority, pgn, if bytes.len() > 8 { GLOBAL_ADDRESS } else { da }, sa)?;
        let most =
            if broadcast { session::TP_BYTES.min(BYTES) } else { session::ETP_BYTES.min(BYTES) };
        if bytes.is_empty() || bytes.len() > most {
            return Err(J1939Error::MessageLength { pgn, len: bytes.len(), most });
        }
        let busy = J1939Error::TransportBusy { pgn, da };
        if self.sessions.iter().any(|s| s.is_running() && s.sending && s.da == da) {
            return Err(busy);
        }
        let session = self.room_for(true).ok_or(busy)?;
        session.open(target.priority(), pgn, (da, sa), bytes.len() as u32);
        (session.sending, session.stage) = (true, Stage::Announce);
        session.arm(now, TR);
        if let Some(room) = session.bytes.get_mut(..bytes.len()) {
            room.copy_from_slice(bytes);
        }
        Ok(())
    }

    /// Takes a frame that was heard at `now`, whatever it is.
    pub fn on_frame(&mut self, now: Time, frame: &Frame) {
        let id = frame.id();
        if id.pgn() == ADDRESS_CLAIMED_PGN {
            // a NAME of zero is nobody's
            if Name::claimed_in(frame).is_some_and(|name| name.0 != 0) {
                self.claimed.insert(id.sa());
            }
            return;
        }
        // who has no address has no sessions, and what comes from our own address is another's
        if id.sa() >= NULL_ADDRESS
            || id.da() == NULL_ADDRESS
            || self.role == Role::Node(Some(id.sa()))
        {
            return;
        }
        for protocol in [Protocol::Tp, Protocol::Etp] {
            if id.pgn() == protocol.data_pgn() {
                self.on_data(now, protocol, frame);
            } else if id.pgn() == protocol.control_pgn() {
                match Control::parse(protocol, frame.bytes()) {
                    Some((control, window)) => self.on_control(now, protocol, id, control, window),
                    None => self.counts.malformed += 1,
                }
            }
        }
    }

    /// Sends what is due at `now` and gives up what is overdue. Call it at every tick; what the bus
    /// has no room for goes at the next.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn poll(&mut self, now: Time, bus: &mut impl Bus) -> Result<(), BusError> {
        match self.poll_all(now, bus) {
            Err(BusError::Full(_)) => Ok(()),
            result => result,
        }
    }

    fn poll_all(&mut self, now: Time, bus: &mut impl Bus) -> Result<(), BusError> {
        let (window, held) = (self.window, self.held);
        let silent = self.role == Role::Listener;
        let mut result = Ok(());
        for refusal in &mut self.refusals {
            if result.is_ok()
                && let Some(frame) = refusal
            {
                result = bus.send(now, frame);
                *refusal = refusal.filter(|_| result.is_err());
            }
        }
        for session in &mut self.sessions {
            // one that the bus has no room for must not keep others from timing out
            let polled = if session.sending {
                session.poll_sending(now, bus)
            } else {
                session.poll_receiving(now, bus, window, held, silent)
            };
            if polled.is_err() && session.is_stuck(now) {
                session.fail(AbortReason::TIMEOUT, false);
            }
            result = result.and(polled);
        }
        result
    }

    /// The next session that has ended; its memory is free for others afterwards.
    pub fn event(&mut self) -> Option<TpEvent<'_>> {
        let ended = |s: &&mut Session<BYTES>| matches!(s.stage, Stage::Ended(_));
        // of several, the one that ended first
        let session = self.sessions.iter_mut().filter(ended).min_by_key(|s| s.armed)?;
        let Stage::Ended(outcome) = session.stage else { return None };
        session.stage = Stage::Free;
        // the destination may be in the low byte, but is no part of the group
        let pgn = Id::from_raw(session.pgn << 8).pgn();
        let (da, sa) = (session.da, session.sa);
        Some(match outcome {
            Outcome::Failed { reason, by_peer } => TpEvent::Failed { pgn, da, sa, reason, by_peer },
            Outcome::Complete if session.sending => TpEvent::Sent { pgn, da },
            Outcome::Complete => {
                let bytes = session.bytes.get(..session.len as usize).unwrap_or(&[]);
                TpEvent::Received(TpMessage { time: session.armed, pgn, da, sa, bytes })
            }
        })
    }

    /// A free session, or that of a source without a claim for one who `has_claimed`.
    fn room_for(&mut self, has_claimed: bool) -> Option<&mut Session<BYTES>> {
        let free = self.sessions.iter().position(|s| s.stage == Stage::Free);
        let weak =
            |s: &Session<BYTES>| s.is_running() && !s.sending && !self.claimed.contains(s.sa);
        let displaced = || self.sessions.iter().position(weak).filter(|_| has_claimed);
        let index = free.or_else(displaced);
        if free.is_none() {
            self.counts.refused += 1;
            let told = index.and_then(|i| self.sessions.get(i)).filter(|s| !s.is_broadcast());
            if let Some(told) = told.filter(|_| self.role != Role::Listener) {
                let what = What::Abort(AbortReason::RESOURCES);
                let abort = Control { pgn: told.pgn, what };
                self.say_later(answer(told.protocol, abort, told.sa, told.da));
            }
        }
        self.sessions.get_mut(index?)
    }

    /// Keeps a refusal until the next poll.
    fn say_later(&mut self, frame: Frame) {
        if let Some(room) = self.refusals.iter_mut().find(|refusal| refusal.is_none()) {
            *room = Some(frame);
        }
    }

    /// The running session of this protocol between two addresses.
    fn find(&mut self, protocol: Protocol, sa: u8, da: u8) -> Option<&mut Session<BYTES>> {
        let fits = |s: &&mut Session<BYTES>| {
            s.is_running() && (s.protocol, s.sa, s.da) == (protocol, sa, da)
        };
        self.sessions.iter_mut().find(fits)
    }

    fn on_control(&mut self, now: Time, protocol: Protocol, id: Id, control: Control, window: u8) {
        let (sa, da) = (id.sa(), id.da());
        let mine = match self.role {
            Role::Listener => true,
            Role::Node(address) => address.is_some_and(|own| own == da) || da == GLOBAL_ADDRESS,
        };
        if !mine {
            return;
        }
        match control.what {
            What::Bam { .. } | What::Rts { .. } => {
                self.on_announcement(now, protocol, id, control, window);
            }
            What::Dpo { offset, .. } => {
                if let Some(session) = self.find(protocol, sa, da).filter(|s| s.pgn == control.pgn)
                {
                    session.offset = offset;
                }
            }
            // these go from the receiver to the sender
            What::Cts { count, next } => {
                if let Some(session) = self.find(protocol, da, sa).filter(|s| s.pgn == control.pgn)
                {
                    session.on_cts(now, count, next);
                }
            }
            What::Eoma { .. } => {
                if let Some(session) = self.find(protocol, da, sa).filter(|s| s.pgn == control.pgn)
                {
                    session.on_end(now);
                }
            }
            // and this either way
            What::Abort(reason) => {
                for (from, to) in [(sa, da), (da, sa)] {
                    let session = self.find(protocol, from, to);
                    if let Some(session) = session.filter(|s| s.pgn == control.pgn) {
                        session.arm(now, T1);
                        session.fail(reason, true);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
