//! A log as a bus.

use std::collections::VecDeque;
use std::io::BufRead;

use tractrix_core::{Stamped, Time};

use super::read::{Entry, Reader};
use crate::Frame;
use crate::bus::{Bus, BusError};

/// Frames that are sorted by time: recorders write several channels in blocks, whose frames may
/// come after later ones.
const SORTED: usize = 16;

/// How fast a log goes by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// Each frame when it is due.
    Recorded,
    /// Each frame as soon as it is asked for.
    Full,
}

/// One channel of a log as a bus: frames carry the time that they would have if the first one came
/// at `start`. What is sent to it goes nowhere: the log is the past.
#[derive(Debug)]
pub struct Replay<R> {
    reader: Reader<R>,
    channel: Option<String>,
    pace: Pace,
    start: Time,
    /// Time of the first frame in the log.
    first: Option<Time>,
    /// In the order of time, those of equal time in the order of the log.
    ahead: VecDeque<Stamped<Frame>>,
    failed: Option<BusError>,
}

impl<R: BufRead> Replay<R> {
    /// A replay of the channel of that name, or of the channel that the log begins with: two
    /// channels merged would double what a gateway carries over.
    pub fn new(reader: Reader<R>, channel: Option<&str>, pace: Pace, start: Time) -> Self {
        let channel = channel.map(str::to_owned);
        let ahead = VecDeque::with_capacity(SORTED);
        Self { reader, channel, pace, start, first: None, ahead, failed: None }
    }

    /// What has been read so far.
    pub const fn reader(&self) -> &Reader<R> {
        &self.reader
    }

    /// Reads ahead. An error counts when the frames before it have gone by.
    fn fill(&mut self) {
        while self.ahead.len() < SORTED && self.failed.is_none() {
            match self.reader.next() {
                None => return,
                Some(Err(error)) => self.failed = Some(error),
                Some(Ok(entry)) if self.is_wanted(&entry) => {
                    let at = self.ahead.partition_point(|held| held.time <= entry.heard.time);
                    self.ahead.insert(at, entry.heard);
                }
                Some(Ok(_)) => {}
            }
        }
    }

    fn is_wanted(&self, entry: &Entry) -> bool {
        let wanted = self.channel.as_ref();
        wanted.map_or(entry.channel == 0, |name| {
            self.reader.channels().get(entry.channel) == Some(name)
        })
    }
}

impl<R: BufRead> Bus for Replay<R> {
    fn send(&mut self, _now: Time, _frame: &Frame) -> Result<(), BusError> {
        Ok(())
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        self.fill();
        let Some(next) = self.ahead.front() else {
            return self.failed.clone().map_or(Ok(None), Err);
        };
        let first = *self.first.get_or_insert(next.time);
        let since = next.time.0.saturating_sub(first.0);
        let heard = Stamped { time: self.start.plus_nanos(since), value: next.value };
        if self.pace == Pace::Recorded && heard.time > now {
            return Ok(None);
        }
        self.ahead.pop_front();
        Ok(Some(heard))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "(5.010) can0 18F00E00#01\n(5.011) can1 18F00E00#A1\n(5.030) can0 18F00E00#03\n\
                       (5.020) can0 18F00E00#02\n(5.040) can0 18F00E00#04\n";

    fn replay(channel: Option<&str>, pace: Pace) -> Replay<&'static [u8]> {
        Replay::new(Reader::new(LOG.as_bytes()), channel, pace, Time(1_000))
    }

    fn drain(bus: &mut impl Bus, now: Time) -> Vec<(i64, u8)> {
        let next = || bus.receive(now).unwrap();
        std::iter::from_fn(next).map(|h| (h.time.0, h.value.bytes()[0])).collect()
    }

    #[test]
    fn frames_come_when_they_are_due_and_in_the_order_of_time() {
        let mut bus = replay(None, Pace::Recorded);
        let ms = 1_000_000;
        assert_eq!(drain(&mut bus, Time(1_000)), [(1_000, 1)]);
        assert_eq!(drain(&mut bus, Time(10 * ms)), []);
        let later = [(1_000 + 10 * ms, 2), (1_000 + 20 * ms, 3)];
        assert_eq!(drain(&mut bus, Time(20 * ms + 1_000)), later);
        assert_eq!(drain(&mut bus, Time(i64::MAX)), [(1_000 + 30 * ms, 4)]);
    }

    #[test]
    fn at_full_pace_all_come_at_once_and_a_channel_is_chosen_by_name() {
        assert_eq!(drain(&mut replay(None, Pace::Full), Time::ZERO).len(), 4);
        assert_eq!(drain(&mut replay(Some("can1"), Pace::Full), Time::ZERO), [(1_000, 0xA1)]);
        assert_eq!(drain(&mut replay(Some("can7"), Pace::Full), Time::ZERO), []);
    }

    #[test]
    fn an_error_of_the_log_comes_after_the_frames_before_it() {
        let log = "(0.1) can0 18F00E00#01\nnonsense\n";
        let mut bus = Replay::new(Reader::new(log.as_bytes()), None, Pace::Full, Time::ZERO);
        assert!(bus.receive(Time::ZERO).unwrap().is_some());
        for _ in 0..2 {
            let error = bus.receive(Time::ZERO).unwrap_err().to_string();
            assert!(error.starts_with("line 2: "), "{error}");
        }
    }
}
