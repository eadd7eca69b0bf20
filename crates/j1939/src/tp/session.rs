//! One session: what both directions have in common.

use tractrix_core::Time;

use super::control::{Control, PACKET_BYTES, Protocol, What, packets};
use super::{AbortReason, T3, T4};
use crate::bus::{Bus, BusError};
use crate::{Frame, GLOBAL_ADDRESS, Id};

/// Longest message of TP, bytes: 255 packets.
pub(super) const TP_BYTES: usize = 1785;
/// Longest message of ETP, bytes: 2^24 - 1 packets.
pub(super) const ETP_BYTES: usize = 117_440_505;
/// Offset of an ETP window whose offset has not come: its packets cannot be told.
pub(super) const NO_OFFSET: u32 = u32::MAX;
/// Priority of answers (SAE J1939-21 gives 7 to TP.CM and TP.DT).
const ANSWER_PRIORITY: u8 = 7;

/// Where a session is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    Free,
    /// Sender: the announcement is to be sent.
    Announce,
    /// Sender: waits for clear-to-send or the end of message.
    Wait,
    /// Sender of ETP: the offset of the window is to be sent.
    Offset,
    /// Sender: packets are to be sent; receiver: packets are expected.
    Data,
    /// Receiver: clear-to-send is to be sent.
    Grant,
    /// Receiver: a hold was sent.
    Hold,
    /// Receiver: the end of message is to be sent.
    Acknowledge,
    /// An abort is to be sent.
    Abort(AbortReason),
    /// Over, and nobody has asked yet.
    Ended(Outcome),
}

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    Complete,
    Failed { reason: AbortReason, by_peer: bool },
}

/// A message under way.
#[derive(Debug, Clone)]
pub(super) struct Session<const BYTES: usize> {
    pub(super) stage: Stage,
    pub(super) protocol: Protocol,
    pub(super) sending: bool,
    priority: u8,
    pub(super) pgn: u32,
    pub(super) da: u8,
    pub(super) sa: u8,
    pub(super) len: u32,
    /// The next packet to send or to receive, from 1. Wider than the eight bits of the wire: next
    /// and a window of 255 add up.
    pub(super) next: u32,
    /// Last packet of the window.
    pub(super) window_end: u32,
    /// Most packets that the sender wants in a window.
    pub(super) sender_window: u8,
    /// ETP: packets count from behind this one.
    pub(super) offset: u32,
    /// The packet that was asked for last.
    pub(super) asked: u32,
    /// How often in a row the same packet was asked for again.
    pub(super) retries: u8,
    /// How often in a row the sender was held.
    pub(super) holds: u8,
    /// When the timer started.
    pub(super) armed: Time,
    /// When it runs out, ns after that.
    wait: i64,
    pub(super) bytes: [u8; BYTES],
}

impl<const BYTES: usize> Session<BYTES> {
    pub(super) const fn free() -> Self {
        Self {
            stage: Stage::Free,
            protocol: Protocol::Tp,
            sending: false,
            priority: 0,
            pgn: 0,
            da: 0,
            sa: 0,
            len: 0,
            next: 1,
            window_end: 0,
            sender_window: u8::MAX,
            offset: 0,
            asked: 0,
            retries: 0,
            holds: 0,
            armed: Time::ZERO,
            wait: 0,
            bytes: [0; BYTES],
        }
    }

    /// Takes over the session for a new message; stage and direction are the caller's.
    pub(super) fn open(&mut self, priority: u8, pgn: u32, (da, sa): (u8, u8), len: u32) {
        self.protocol = if len as usize > TP_BYTES { Protocol::Etp } else { Protocol::Tp };
        (self.priority, self.pgn, self.da, self.sa, self.len) = (priority, pgn, da, sa, len);
        (self.next, self.window_end) = (1, 0);
        (self.asked, self.retries, self.holds) = (0, 0, 0);
        self.offset = if self.protocol == Protocol::Etp { NO_OFFSET } else { 0 };
        self.sender_window = u8::MAX;
    }

    pub(super) const fn is_running(&self) -> bool {
        !matches!(self.stage, Stage::Free | Stage::Ended(_))
    }

    pub(super) const fn is_broadcast(&self) -> bool {
        self.da == GLOBAL_ADDRESS
    }

    pub(super) const fn packets(&self) -> u32 {
        packets(self.len)
    }

    pub(super) const fn arm(&mut self, now: Time, wait_nanos: i64) {
        (self.armed, self.wait) = (now, wait_nanos);
    }

    /// Whether the bus has taken nothing for longer than any peer waits.
    pub(super) const fn is_stuck(&self, now: Time) -> bool {
        now.0.saturating_sub(self.armed.0) >= T3
    }

    /// Whether the timer has run out. A clock that goes back far counts as run out: nobody waits
    /// for it to come again.
    pub(super) const fn is_overdue(&self, now: Time) -> bool {
        let elapsed = now.0.saturating_sub(self.armed.0);
        elapsed >= self.wait || elapsed < -T4
    }

    pub(super) const fn complete(&mut self, now: Time) {
        self.armed = now;
        self.stage = Stage::Ended(Outcome::Complete);
    }

    pub(super) const fn fail(&mut self, reason: AbortReason, by_peer: bool) {
        self.stage = Stage::Ended(Outcome::Failed { reason, by_peer });
    }

    /// Sends a control message to the other side; the sender's with the priority of the message.
    pub(super) fn say(&self, now: Time, bus: &mut impl Bus, what: What) -> Result<(), BusError> {
        let control = Control { pgn: self.pgn, what };
        let frame = if self.sending {
            let pgn = self.protocol.control_pgn();
            control_frame(self.priority, pgn, self.da, self.sa, control.bytes(self.protocol))
        } else {
            answer(self.protocol, control, self.sa, self.da)
        };
        bus.send(now, &frame)
    }

    /// Sends the abort that is due and ends.
    pub(super) fn abort(
        &mut self,
        now: Time,
        bus: &mut impl Bus,
        reason: AbortReason,
    ) -> Result<(), BusError> {
        if !self.is_broadcast() {
            self.say(now, bus, What::Abort(reason))?;
        }
        self.armed = now;
        self.fail(reason, false);
        Ok(())
    }

    /// The data of a packet, counted from 1.
    pub(super) fn packet(&self, number: u32) -> &[u8] {
        let start = PACKET_BYTES * number.saturating_sub(1) as usize;
        let end = (start + PACKET_BYTES).min(self.len as usize);
        self.bytes.get(start..end).unwrap_or(&[])
    }

    /// The frame of a packet, filled up with 0xFF (not available).
    pub(super) fn data_frame(&self, number: u32) -> Frame {
        let mut data = [0xFF; 8];
        let [sequence, rest @ ..] = &mut data;
        *sequence = number.saturating_sub(self.offset) as u8;
        for (to, from) in rest.iter_mut().zip(self.packet(number)) {
            *to = *from;
        }
        control_frame(self.priority, self.protocol.data_pgn(), self.da, self.sa, data)
    }

    /// The message as one frame, when it fits.
    pub(super) fn single_frame(&self) -> Option<Frame> {
        let id = Id::new(self.priority, self.pgn, self.da, self.sa).ok()?;
        Frame::new(id, self.bytes.get(..self.len as usize)?).ok()
    }
}

/// A frame of one of the four groups of the transport, all of which carry a destination.
fn control_frame(priority: u8, pgn: u32, da: u8, sa: u8, data: [u8; 8]) -> Frame {
    let raw = u32::from(priority) << 26 | (pgn | u32::from(da)) << 8 | u32::from(sa);
    Frame::of(Id::from_raw(raw), data)
}

/// A receiver's answer from `from` to `to`.
pub(super) fn answer(protocol: Protocol, control: Control, to: u8, from: u8) -> Frame {
    control_frame(ANSWER_PRIORITY, protocol.control_pgn(), to, from, control.bytes(protocol))
}
