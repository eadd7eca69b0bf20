//! The receiver's side of a session.

use tractrix_core::Time;

use super::control::{Control, PACKET_BYTES, Protocol, What};
use super::session::{NO_OFFSET, Session, Stage, answer};
use super::{AbortReason, RETRIES, Role, T1, T2, T3, TH, Transport};
use crate::bus::{Bus, BusError};
use crate::{Frame, GLOBAL_ADDRESS, Id};

impl<const SESSIONS: usize, const BYTES: usize> Transport<SESSIONS, BYTES> {
    /// Somebody wants to send.
    pub(super) fn on_announcement(
        &mut self,
        now: Time,
        protocol: Protocol,
        id: Id,
        control: Control,
        window: u8,
    ) {
        let (da, sa) = (id.da(), id.sa());
        let (len, broadcast) = match control.what {
            What::Bam { len } => (len, true),
            What::Rts { len } => (len, false),
            _ => return,
        };
        let is_tp = len as usize <= super::session::TP_BYTES;
        if broadcast != (da == GLOBAL_ADDRESS) || is_tp != (protocol == Protocol::Tp) {
            self.counts.malformed += 1;
            return;
        }
        // A source that starts again has given up what it did before, unless that is another group:
        // its packets could not be told apart.
        if let Some(running) = self.find(protocol, sa, da) {
            if !broadcast && running.pgn != control.pgn {
                return self.refuse(protocol, control, id, AbortReason::BUSY);
            }
            running.stage = Stage::Free;
        }
        let has_claimed = self.claimed.contains(sa);
        let fits = len as usize <= BYTES;
        let silent = self.role == Role::Listener;
        let Some(session) = fits.then(|| self.room_for(has_claimed)).flatten() else {
            return self.refuse(protocol, control, id, AbortReason::RESOURCES);
        };
        session.open(id.priority(), control.pgn, (da, sa), len);
        session.sending = false;
        session.sender_window = window;
        if broadcast || silent {
            (session.stage, session.window_end) = (Stage::Data, session.packets());
            session.arm(now, if silent && !broadcast { T3 } else { T1 });
        } else {
            session.stage = Stage::Grant;
            session.arm(now, T2);
        }
    }

    /// Says no to a request to send; a broadcast is dropped without a word.
    fn refuse(&mut self, protocol: Protocol, control: Control, id: Id, reason: AbortReason) {
        if self.role == Role::Listener || id.da() == GLOBAL_ADDRESS {
            return;
        }
        let abort = Control { pgn: control.pgn, what: What::Abort(reason) };
        self.say_later(answer(protocol, abort, id.sa(), id.da()));
    }

    /// A packet.
    pub(super) fn on_data(&mut self, now: Time, protocol: Protocol, frame: &Frame) {
        let (da, sa) = (frame.id().da(), frame.id().sa());
        let silent = self.role == Role::Listener;
        if let Some(session) = self.find(protocol, sa, da)
            && let Some((sequence, data)) = frame.bytes().split_first()
        {
            session.on_packet(now, u32::from(*sequence), data, silent);
        }
    }
}

impl<const BYTES: usize> Session<BYTES> {
    /// Takes a packet if it is the next one. A repeated one is harmless; one after a gap has to
    /// come again.
    fn on_packet(&mut self, now: Time, sequence: u32, data: &[u8], silent: bool) {
        if self.stage != Stage::Data || sequence == 0 {
            return;
        }
        let number = self.offset.saturating_add(sequence);
        let start = PACKET_BYTES * self.next.saturating_sub(1) as usize;
        let end = (start + PACKET_BYTES).min(self.len as usize);
        if number == self.next
            && let Some(room) = self.bytes.get_mut(start..end)
            && let Some(data) = data.get(..room.len())
        {
            room.copy_from_slice(data);
            (self.next, self.retries) = (self.next + 1, 0);
            self.arm(now, if silent && !self.is_broadcast() { T3 } else { T1 });
        } else if number > self.next && self.is_broadcast() {
            // nobody can be asked for what is missing
            return self.fail(AbortReason::BAD_SEQUENCE, false);
        }
        if self.next > self.packets() {
            match self.is_broadcast() || silent {
                true => self.complete(now),
                false => self.stage = Stage::Acknowledge,
            }
        } else if number == self.window_end && !self.is_broadcast() && !silent {
            // the window is over: go on, or ask again for what is missing
            if self.next <= self.window_end {
                self.retry(AbortReason::RETRANSMIT_LIMIT);
            } else {
                self.stage = Stage::Grant;
            }
        }
    }

    /// Asks again, or gives up.
    fn retry(&mut self, reason: AbortReason) {
        self.retries += 1;
        self.stage = if self.retries > RETRIES { Stage::Abort(reason) } else { Stage::Grant };
    }

    /// Sends what is due at `now`.
    pub(super) fn poll_receiving(
        &mut self,
        now: Time,
        bus: &mut impl Bus,
        window: u8,
        held: bool,
        silent: bool,
    ) -> Result<(), BusError> {
        if self.stage == Stage::Data && self.is_overdue(now) {
            if self.is_broadcast() || silent {
                self.fail(AbortReason::TIMEOUT, false);
            } else {
                self.retry(AbortReason::TIMEOUT);
            }
        }
        if self.stage == Stage::Hold && (!held || self.is_overdue(now)) {
            self.stage = Stage::Grant;
        }
        match self.stage {
            Stage::Grant if held => {
                self.say(now, bus, What::Cts { count: 0, next: self.next })?;
                self.stage = Stage::Hold;
                self.arm(now, TH);
            }
            Stage::Grant => {
                let left = self.packets() + 1 - self.next;
                let count = left.min(u32::from(window.min(self.sender_window)));
                self.say(now, bus, What::Cts { count: count as u8, next: self.next })?;
                self.window_end = self.next + count - 1;
                if self.protocol == Protocol::Etp {
                    self.offset = NO_OFFSET;
                }
                self.stage = Stage::Data;
                // Asked again while the sender still waits (its T3), given up after T2.
                self.arm(now, if self.retries < RETRIES { T1 } else { T2 });
            }
            Stage::Acknowledge => {
                self.say(now, bus, What::Eoma { len: self.len })?;
                self.complete(now);
            }
            Stage::Abort(reason) => self.abort(now, bus, reason)?,
            _ => {}
        }
        Ok(())
    }
}
