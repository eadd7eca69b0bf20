//! Messages that must come, and commands that few may send.

use tractrix_core::Time;

use super::BusFault;
use crate::check::{Checker, Policy, Protection, Verdict};
use crate::{AddressSet, Frame};

/// Frames that may come ahead of time before a message comes too often.
const EARLY: i64 = 6;

/// A message that must come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watch {
    /// Its parameter group.
    pub pgn: u32,
    /// Its source.
    pub sa: u8,
    /// Its shortest period, ns. A fifth more often is tolerated for long.
    pub period_nanos: i64,
    /// After this time without it, it is lost, ns. Counted from the first time that it came.
    pub timeout_nanos: i64,
    /// Counter and checksum, and what is demanded of them.
    pub protection: Option<(Protection, Policy)>,
}

/// A command to an address that only some sources may give.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exclusive {
    /// Its parameter group.
    pub pgn: u32,
    /// The address that obeys.
    pub da: u8,
    /// Who may give it; when nobody is named, who gives it first.
    pub senders: AddressSet,
}

/// A message and what has been seen of it.
#[derive(Debug, Clone)]
pub(super) struct Watched {
    watch: Watch,
    checker: Option<Checker>,
    latest: Option<Time>,
    /// How far ahead of its time the message is, ns.
    ahead_nanos: i64,
}

impl Watched {
    pub(super) fn new(watch: Watch) -> Self {
        let checker = watch.protection.map(|(protection, policy)| Checker::new(protection, policy));
        Self { watch, checker, latest: None, ahead_nanos: 0 }
    }

    pub(super) const fn is(&self, pgn: u32, sa: u8) -> bool {
        self.watch.pgn == pgn && self.watch.sa == sa
    }

    /// What is wrong with a frame, if it is one of these.
    pub(super) fn on_frame(&mut self, now: Time, frame: &Frame) -> [Option<BusFault>; 2] {
        let (pgn, sa) = (frame.id().pgn(), frame.id().sa());
        if !self.is(pgn, sa) {
            return [None; 2];
        }
        let period = self.watch.period_nanos;
        let passed = self.latest.map_or(0, |latest| now.0.saturating_sub(latest.0).max(0));
        self.latest = Some(now);
        self.ahead_nanos =
            self.ahead_nanos.saturating_sub(passed.saturating_add(passed / 5)).max(0);
        self.ahead_nanos = self.ahead_nanos.saturating_add(period);
        let too_often = self.ahead_nanos > EARLY.saturating_mul(period);
        if too_often {
            self.ahead_nanos = EARLY.saturating_mul(period);
        }
        let verdict = self.checker.as_mut().map(|checker| checker.check(frame));
        let wrong = match verdict {
            None | Some(Verdict::Good | Verdict::Unprotected) => None,
            Some(Verdict::Missing | Verdict::Checksum { .. }) => {
                Some(BusFault::Checksum { pgn, sa })
            }
            Some(Verdict::Stuck { .. }) => Some(BusFault::CounterStuck { pgn, sa }),
            Some(Verdict::Jump { .. }) => Some(BusFault::CounterJump { pgn, sa }),
        };
        [too_often.then_some(BusFault::RateViolation { pgn, sa }), wrong]
    }

    /// Whether the message stays away.
    pub(super) fn overdue(&self, now: Time) -> Option<BusFault> {
        let since = now.0.saturating_sub(self.latest?.0);
        let Watch { pgn, sa, timeout_nanos, .. } = self.watch;
        (since > timeout_nanos).then_some(BusFault::SignalLost { pgn, sa })
    }
}

/// A command and who may give it.
#[derive(Debug, Clone)]
pub(super) struct Command(Exclusive);

impl Command {
    pub(super) const fn new(exclusive: Exclusive) -> Self {
        Self(exclusive)
    }

    /// Whether a frame is another one, or from a source that may give this command.
    pub(super) fn permits(&mut self, frame: &Frame) -> bool {
        let Exclusive { pgn, da, senders } = &mut self.0;
        if frame.id().pgn() != *pgn || frame.id().da() != *da {
            return true;
        }
        if senders.is_empty() {
            senders.insert(frame.id().sa());
        }
        senders.contains(frame.id().sa())
    }
}
