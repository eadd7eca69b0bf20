//! What is on the bus between stack and truck: each message with its rate, who claimed which
//! address, and what of the truck is not in order.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use j1939::{Assembler, Frame, Id, Name};
use sim::BusFigures;
use tractrix_core::{BusRecorder, BusTrouble, RawFrame, Stamped, Time, VehicleStatus};

/// Messages that are kept, at most; others are counted.
const MOST_MESSAGES: usize = 512;
/// Share of a new interval in the mean one.
const NEW_SHARE: f64 = 0.1;
/// Transport sessions at once, and the longest message (SAE J1939-21).
const SESSIONS: usize = 8;
const LONGEST: usize = 1785;

/// A message as it came or went last.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Latest {
    /// Its bytes.
    pub(crate) bytes: Vec<u8>,
    /// How often it was there.
    pub(crate) count: u64,
    /// When it was there last.
    pub(crate) last: Time,
    /// Mean time between two, s; none before the second.
    pub(crate) period_s: Option<f64>,
}

/// Whether the stack sent it, and its identifier.
pub(crate) type Key = (bool, u32);

/// What is known of the bus. Empty where the truck is driven directly.
#[derive(Clone)]
pub(crate) struct Board {
    /// How the truck is reached: `direct`, `bus`, `can:can0`.
    pub(crate) vehicle: String,
    /// Time of the latest reading.
    pub(crate) now: Time,
    pub(crate) messages: BTreeMap<Key, Latest>,
    /// Messages that found no place here.
    pub(crate) left_out: u64,
    pub(crate) claims: BTreeMap<u8, Name>,
    /// Readings and sendings that failed.
    pub(crate) errors: u64,
    pub(crate) figures: Option<BusFigures>,
    pub(crate) status: VehicleStatus,
    packets: Box<Assembler<SESSIONS, LONGEST>>,
}

impl Default for Board {
    fn default() -> Self {
        Self {
            vehicle: "direct".to_owned(),
            now: Time::ZERO,
            messages: BTreeMap::new(),
            left_out: 0,
            claims: BTreeMap::new(),
            errors: 0,
            figures: None,
            status: VehicleStatus::default(),
            packets: Box::default(),
        }
    }
}

impl Board {
    fn take(&mut self, is_sent: bool, time: Time, id: Id, bytes: &[u8]) {
        let key = (is_sent, id.raw());
        if self.messages.len() >= MOST_MESSAGES && !self.messages.contains_key(&key) {
            self.left_out += 1;
            return;
        }
        let new = || Latest { bytes: Vec::new(), count: 0, last: time, period_s: None };
        let latest = self.messages.entry(key).or_insert_with(new);
        if latest.count > 0 {
            let since_s = time.seconds_since(latest.last);
            let mean_s = |was: f64| was + NEW_SHARE * (since_s - was);
            latest.period_s = Some(latest.period_s.map_or(since_s, mean_s));
        }
        latest.bytes.clear();
        latest.bytes.extend_from_slice(bytes);
        (latest.count, latest.last) = (latest.count + 1, time);
    }

    fn frame(&mut self, is_sent: bool, time: Time, raw: RawFrame) {
        let frame = Frame::from(raw);
        let (id, bytes) = (frame.id(), frame.bytes());
        if let Some(name) = Name::claimed_in(&frame) {
            self.claims.insert(id.sa(), name);
        }
        self.take(is_sent, time, id, bytes);
        if !Assembler::<SESSIONS, LONGEST>::is_packet(id) {
            return;
        }
        let mut whole = Vec::new();
        let heard = self.packets.hear(time, &frame, &mut |message| {
            whole.extend(message.map(|m| (m.id, m.bytes.to_vec())));
            Ok::<(), Infallible>(())
        });
        let Ok(()) = heard;
        for (id, bytes) in whole {
            self.take(is_sent, time, id, &bytes);
        }
    }
}

/// A board that one thread writes and others read.
#[derive(Clone, Default)]
pub(crate) struct BusBoard(Arc<Mutex<Board>>);

impl BusBoard {
    fn board(&self) -> MutexGuard<'_, Board> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Another run, whose truck is reached in this way.
    pub(crate) fn begin(&self, vehicle: &str) {
        *self.board() = Board { vehicle: vehicle.to_owned(), ..Board::default() };
    }

    /// Takes how the bus does, and what of the truck is not in order; says what failed so far.
    pub(crate) fn note(&self, figures: Option<BusFigures>, status: VehicleStatus) -> u64 {
        let mut board = self.board();
        (board.figures, board.status) = (figures, status);
        board.errors
    }

    /// What is known now.
    pub(crate) fn now(&self) -> Board {
        self.board().clone()
    }
}

impl BusRecorder for BusBoard {
    fn received(&mut self, now: Time, what: Result<Option<Stamped<RawFrame>>, BusTrouble>) {
        let mut board = self.board();
        board.now = now;
        match what {
            Ok(Some(heard)) => board.frame(false, heard.time, heard.value),
            Ok(None) => {}
            Err(_) => board.errors += 1,
        }
    }

    fn sent(&mut self, now: Time, frame: RawFrame, trouble: Option<BusTrouble>) {
        let mut board = self.board();
        match trouble {
            None => board.frame(true, now, frame),
            Some(_) => board.errors += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(id: u32, data: [u8; 8]) -> RawFrame {
        RawFrame { id, len: 8, data }
    }

    #[test]
    fn messages_have_their_rates_claims_their_names_and_packets_are_put_together() {
        let mut board = BusBoard::default();
        board.begin("bus");
        for k in 0..100 {
            let time = Time(k * 20_000_000);
            let heard = Stamped { time, value: raw(0x0CF0_0400, [k as u8; 8]) };
            board.received(time, Ok(Some(heard)));
            board.sent(time, raw(0x0C00_0027, [0; 8]), None);
        }
        let name = Name(0x8000_0000_0000_0007);
        let claim = name.claim(0x27);
        board.sent(Time(2_000_000_000), RawFrame::from(&claim), None);
        // DM1 of the brakes with two codes: ten bytes in two packets, broadcast
        for (id, data) in [
            (0x1CEC_FF0B, [0x20, 10, 0, 2, 0xFF, 0xCA, 0xFE, 0x00]),
            (0x1CEB_FF0B, [1, 0x00, 0xFF, 0xBF, 0x00, 0x09, 0x01, 0x6E]),
            (0x1CEB_FF0B, [2, 0x00, 0x13, 0x01, 0xFF, 0xFF, 0xFF, 0xFF]),
        ] {
            let time = Time(2_100_000_000);
            board.received(time, Ok(Some(Stamped { time, value: raw(id, data) })));
        }
        board.received(Time(2_200_000_000), Err(BusTrouble::Other));
        let now = board.now();
        let heard = &now.messages[&(false, 0x0CF0_0400)];
        assert_eq!((heard.count, heard.bytes[0]), (100, 99));
        assert!((heard.period_s.unwrap() - 0.02).abs() < 1e-9);
        assert!(now.messages.contains_key(&(true, 0x0C00_0027)));
        assert_eq!((now.claims[&0x27], now.errors), (name, 1));
        let whole = now.messages.iter().find(|(key, _)| Id::from_raw(key.1).pgn() == 0xFECA);
        assert_eq!(whole.unwrap().1.bytes.len(), 10);
    }

    #[test]
    fn a_bus_with_more_messages_than_there_are_is_counted_not_kept() {
        let mut board = BusBoard::default();
        for id in 0..2_000 {
            board.sent(Time(0), raw(0x18FF_0000 + id, [0; 8]), None);
        }
        let now = board.now();
        assert_eq!((now.messages.len(), now.left_out), (MOST_MESSAGES, 2_000 - 512));
    }
}
