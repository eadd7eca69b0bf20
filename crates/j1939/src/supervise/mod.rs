//! Notices what is wrong on a bus: messages that stay away, come too often, twice or from somebody
//! else, addresses that are taken over, floods.
//!
//! A CAN bus authenticates nobody. What can be noticed is a contradiction: a counter that jumps, a
//! checksum that does not fit, more frames than one sender makes, a command from a source that does
//! not give commands, a second NAME for an address. Who sends in place of a silent unit, at its rate
//! and with its counters, is not noticed here.

mod messages;
mod sources;

pub use messages::{Exclusive, Watch};
pub use sources::Sources;
use tractrix_core::Time;

use crate::{ADDRESS_CLAIMED_PGN, BitRate, BusLoad, Frame, NULL_ADDRESS, Name};
use messages::{Command, Watched};

/// Different things that are wrong at the same time; more are counted only.
const EVENTS: usize = 32;
/// What has not come again for so long is over, ns.
const OVER: i64 = 5_000_000_000;
/// Window in which announcements of the transport are counted, ns.
const FLOOD_WINDOW: i64 = 1_000_000_000;
/// Groups that announce a long message, with their command bytes.
const ANNOUNCEMENTS: [(u32, &[u8]); 2] = [(60_416, &[16, 32]), (51_200, &[20])];

/// What is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BusFault {
    /// A message stays away.
    SignalLost {
        /// Its parameter group.
        pgn: u32,
        /// Its source.
        sa: u8,
    },
    /// Its counter moved by more than one.
    CounterJump {
        /// Its parameter group.
        pgn: u32,
        /// Its source.
        sa: u8,
    },
    /// Its counter stands still.
    CounterStuck {
        /// Its parameter group.
        pgn: u32,
        /// Its source.
        sa: u8,
    },
    /// Its checksum does not fit, or is missing though it is demanded.
    Checksum {
        /// Its parameter group.
        pgn: u32,
        /// Its source.
        sa: u8,
    },
    /// It comes more often than one sender sends it: there may be a second.
    RateViolation {
        /// Its parameter group.
        pgn: u32,
        /// Its source.
        sa: u8,
    },
    /// Somebody sends what is another's to send, or from our own address.
    Spoofed {
        /// Its parameter group.
        pgn: u32,
        /// The source that should not send it.
        sa: u8,
    },
    /// An address that has an owner is claimed with another NAME.
    AddressConflict {
        /// The address.
        address: u8,
    },
    /// An address is claimed with a NAME of zero, which beats every other and belongs to nobody.
    NullName {
        /// The address.
        address: u8,
    },
    /// More long messages are announced than a truck has.
    Flooded,
    /// The bus is busier than it may be.
    Overloaded,
}

/// Something wrong, from when to when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BusEvent {
    /// What is wrong.
    pub fault: BusFault,
    /// When it was first seen.
    pub since: Time,
    /// When it was last seen.
    pub latest: Time,
    /// How often it was seen.
    pub count: u32,
}

/// Bounds of a bus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BusBounds {
    /// Its speed.
    pub rate: BitRate,
    /// Share of the time in which it may be busy, 0 to 1.
    pub load_max: f64,
    /// Announcements of long messages a second.
    pub announcements_max: u32,
}

impl BusBounds {
    /// What no log of a healthy truck comes near: 85 % load, 40 announcements a second.
    #[must_use]
    pub const fn usual(rate: BitRate) -> Self {
        Self { rate, load_max: 0.85, announcements_max: 40 }
    }
}

/// Supervises a bus: `W` messages that must come, `E` commands that few may send.
#[derive(Debug, Clone)]
pub struct Supervisor<const W: usize, const E: usize> {
    address: Option<u8>,
    watched: [Watched; W],
    commands: [Command; E],
    /// NAME that an address was first claimed with; 0 while none was.
    names: [u64; 256],
    bounds: BusBounds,
    load: BusLoad,
    window_start: Time,
    announcements: u32,
    events: [Option<(BusEvent, bool)>; EVENTS],
    dropped: u64,
}

impl<const W: usize, const E: usize> Supervisor<W, E> {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(bounds: BusBounds, watches: [Watch; W], exclusives: [Exclusive; E]) -> Self {
        Self {
            address: None,
            watched: watches.map(Watched::new),
            commands: exclusives.map(Command::new),
            names: [0; 256],
            bounds,
            load: BusLoad::new(bounds.rate),
            window_start: Time::ZERO,
            announcements: 0,
            events: [None; EVENTS],
            dropped: 0,
        }
    }

    /// Takes the address of this node: who else sends from it is a spoofer.
    pub const fn set_address(&mut self, address: Option<u8>) {
        self.address = address;
    }

    /// Takes a frame that was heard at `now`; not those that this node sent.
    pub fn on_frame(&mut self, now: Time, frame: &Frame) {
        let (pgn, sa) = (frame.id().pgn(), frame.id().sa());
        self.load.add(now, frame);
        match Name::claimed_in(frame) {
            Some(name) if sa < NULL_ADDRESS => self.on_claim(now, sa, name),
            _ if self.address == Some(sa) && pgn != ADDRESS_CLAIMED_PGN => {
                self.report(now, BusFault::Spoofed { pgn, sa });
            }
            _ => {}
        }
        for at in 0..W {
            let found = self.watched.get_mut(at).map_or([None; 2], |w| w.on_frame(now, frame));
            if self.watched.get(at).is_some_and(|w| w.is(pgn, sa)) {
                self.clear(BusFault::SignalLost { pgn, sa });
            }
            found.into_iter().flatten().for_each(|fault| self.report(now, fault));
        }
        for at in 0..E {
            if self.commands.get_mut(at).is_some_and(|command| !command.permits(frame)) {
                self.report(now, BusFault::Spoofed { pgn, sa });
            }
        }
        let announces = |(group, commands): &(u32, &[u8])| {
            *group == pgn && frame.bytes().first().is_some_and(|c| commands.contains(c))
        };
        if ANNOUNCEMENTS.iter().any(announces) {
            self.on_announcement(now);
        }
    }

    /// Notices what stays away. Call it at every tick.
    pub fn poll(&mut self, now: Time) {
        for at in 0..W {
            if let Some(fault) = self.watched.get(at).and_then(|w| w.overdue(now)) {
                self.report(now, fault);
            }
        }
        if self.load.share(now) > self.bounds.load_max {
            self.report(now, BusFault::Overloaded);
        }
        for slot in &mut self.events {
            *slot = slot.filter(|(event, _)| now.0.saturating_sub(event.latest.0) < OVER);
        }
    }

    /// What is wrong now or was a moment ago. A lost message is in the list until it comes again,
    /// everything else until it has not been seen for 5 s.
    pub fn events(&self) -> impl Iterator<Item = &BusEvent> {
        self.events.iter().flatten().map(|(event, _)| event)
    }

    /// The next event that has not been taken yet, each once.
    pub fn take_new(&mut self) -> Option<BusEvent> {
        let (event, taken) = self.events.iter_mut().flatten().find(|(_, taken)| !taken)?;
        *taken = true;
        Some(*event)
    }

    /// Events that found no room in the list.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Share of the last second in which the bus was busy, 0 to 1.
    #[must_use]
    pub fn load(&mut self, now: Time) -> f64 {
        self.load.share(now)
    }

    fn on_claim(&mut self, now: Time, address: u8, name: Name) {
        if name.0 == 0 {
            return self.report(now, BusFault::NullName { address });
        }
        let Some(owner) = self.names.get_mut(usize::from(address)) else { return };
        if *owner == 0 {
            *owner = name.0;
        }
        if *owner != name.0 || self.address == Some(address) {
            self.report(now, BusFault::AddressConflict { address });
        }
    }

    fn on_announcement(&mut self, now: Time) {
        if !(0..FLOOD_WINDOW).contains(&now.0.saturating_sub(self.window_start.0)) {
            (self.window_start, self.announcements) = (now, 0);
        }
        self.announcements += 1;
        if self.announcements > self.bounds.announcements_max {
            self.report(now, BusFault::Flooded);
        }
    }

    fn report(&mut self, now: Time, fault: BusFault) {
        let known = self.events.iter_mut().flatten().find(|(event, _)| event.fault == fault);
        if let Some((event, _)) = known {
            (event.latest, event.count) = (now, event.count.saturating_add(1));
        } else if let Some(free) = self.events.iter_mut().find(|slot| slot.is_none()) {
            *free = Some((BusEvent { fault, since: now, latest: now, count: 1 }, false));
        } else {
            self.dropped += 1;
        }
    }

    fn clear(&mut self, fault: BusFault) {
        for slot in &mut self.events {
            *slot = slot.filter(|(event, _)| event.fault != fault);
        }
    }
}

#[cfg(test)]
mod tests;
