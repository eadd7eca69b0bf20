//! The sender's side of a session.

use tractrix_core::Time;

use super::control::What;
use super::session::{NO_OFFSET, Session, Stage};
use super::{AbortReason, BAM_GAP, HOLDS, Protocol, RETRIES, T3, T4, TR};
use crate::bus::{Bus, BusError};

impl<const BYTES: usize> Session<BYTES> {
    /// Sends what is due at `now`.
    pub(super) fn poll_sending(&mut self, now: Time, bus: &mut impl Bus) -> Result<(), BusError> {
        // each round sends a frame or waits: a window of 255 and the messages around it
        for _ in 0..u32::from(u8::MAX) + 4 {
            match self.stage {
                Stage::Announce if self.len <= 8 => {
                    if let Some(frame) = self.single_frame() {
                        bus.send(now, &frame)?;
                    }
                    self.complete(now);
                }
                Stage::Announce if self.is_broadcast() => {
                    self.say(now, bus, What::Bam { len: self.len })?;
                    self.go_on(now, Stage::Data, BAM_GAP);
                }
                Stage::Announce => {
                    self.say(now, bus, What::Rts { len: self.len })?;
                    self.go_on(now, Stage::Wait, T3);
                }
                Stage::Wait if self.is_overdue(now) => {
                    self.stage = Stage::Abort(AbortReason::TIMEOUT);
                }
                Stage::Offset => {
                    let offset = self.next - 1;
                    let count = (self.window_end - offset) as u8;
                    self.say(now, bus, What::Dpo { count, offset })?;
                    self.offset = offset;
                    self.go_on(now, Stage::Data, TR);
                }
                Stage::Data if self.is_broadcast() => {
                    if !self.is_overdue(now) {
                        return Ok(());
                    }
                    bus.send(now, &self.data_frame(self.next))?;
                    self.arm(now, BAM_GAP);
                    self.next += 1;
                    if self.next > self.packets() {
                        self.complete(now);
                    }
                }
                Stage::Data => {
                    bus.send(now, &self.data_frame(self.next))?;
                    self.next += 1;
                    let (stage, wait) = if self.next > self.window_end {
                        (Stage::Wait, T3)
                    } else {
                        (Stage::Data, TR)
                    };
                    self.go_on(now, stage, wait);
                }
                Stage::Abort(reason) => return self.abort(now, bus, reason),
                _ => return Ok(()),
            }
        }
        Ok(())
    }

    fn go_on(&mut self, now: Time, stage: Stage, wait_nanos: i64) {
        self.stage = stage;
        self.arm(now, wait_nanos);
    }

    /// Clear to send `count` packets from `next` on.
    pub(super) fn on_cts(&mut self, now: Time, count: u8, next: u32) {
        if !self.sending {
            // heard between others: they are still at it, and ETP counts from a new offset
            if self.protocol == Protocol::Etp {
                self.offset = NO_OFFSET;
            }
            return self.arm(now, T3);
        }
        if self.stage == Stage::Data || self.stage == Stage::Offset {
            // the same window again is a repeated frame
            let again = (next..=self.window_end).contains(&self.next) && count > 0;
            if !again {
                self.stage = Stage::Abort(AbortReason::CTS_WHILE_SENDING);
            }
            return;
        }
        if self.stage != Stage::Wait {
            return;
        }
        if count == 0 {
            self.holds = self.holds.saturating_add(1);
            self.arm(now, T4);
            if self.holds > HOLDS {
                self.stage = Stage::Abort(AbortReason::TIMEOUT);
            }
            return;
        }
        if next == 0 || next > self.next || next > self.packets() {
            self.stage = Stage::Abort(AbortReason::BAD_SEQUENCE);
            return;
        }
        self.retries = if next == self.asked { self.retries.saturating_add(1) } else { 0 };
        (self.asked, self.holds) = (next, 0);
        if self.retries > RETRIES {
            self.stage = Stage::Abort(AbortReason::RETRANSMIT_LIMIT);
            return;
        }
        self.next = next;
        self.window_end = (next + u32::from(count) - 1).min(self.packets());
        let stage = if self.protocol == Protocol::Etp { Stage::Offset } else { Stage::Data };
        self.go_on(now, stage, TR);
    }

    /// The receiver has everything.
    pub(super) fn on_end(&mut self, now: Time) {
        if self.sending && self.stage == Stage::Wait && self.next > self.packets() {
            self.complete(now);
        }
    }
}
