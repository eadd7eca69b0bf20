//! What was said on a bus, one series for each signal and each who says it.

use std::collections::BTreeMap;

use j1939::message::{Tsc1, Xbr};
use j1939::{Id, Message};
use tractrix_core::Time;

use super::dbc::Dbc;
use super::signals::{Candidate, Read, What, standard};
use crate::DiagnosisError;

/// Most samples that are kept of a log, all signals together: two days of every signal at its usual
/// rate, 3 GB.
const MOST_SAMPLES: usize = 200_000_000;
/// A signal holds for so many of its periods, s at least and at most.
const HOLDS_PERIODS: f64 = 3.0;
const HOLDS_S: [f64; 2] = [0.3, 30.0];

/// Who says what: the number of the candidate, the channel of the log, the address.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    pub(super) candidate: usize,
    pub(super) channel: usize,
    pub(super) address: u8,
}

/// What one source says of one signal.
#[derive(Debug, Default)]
pub(super) struct Series {
    /// Time, s since the start of the log, and value, in order.
    pub(super) samples: Vec<(f64, f64)>,
    /// Messages that had no number for it.
    pub(super) no_number: usize,
    /// How long a value holds, s.
    pub(super) holds_s: f64,
    /// Median time between two messages, s.
    pub(super) period_s: f64,
}

impl Series {
    /// The last value up to a time that still holds.
    pub(super) fn at(&self, time_s: f64) -> Option<f64> {
        let after = self.samples.partition_point(|s| s.0 <= time_s + 1e-9);
        let (t, value) = *self.samples.get(after.checked_sub(1)?)?;
        (time_s - t <= self.holds_s).then_some(value)
    }

    /// Share of a duration in which a value holds.
    pub(super) fn fresh_frac(&self, duration_s: f64) -> f64 {
        let steps = self.samples.windows(2).map(|w| (w[1].0 - w[0].0).min(self.holds_s));
        let last = self.samples.last().map_or(0.0, |s| (duration_s - s.0).min(self.holds_s));
        (steps.sum::<f64>() + last) / duration_s.max(1e-9)
    }

    fn settle(&mut self) {
        // blocks of a log may be out of order
        self.samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut steps: Vec<f64> = self.samples.windows(2).map(|w| w[1].0 - w[0].0).collect();
        let middle = steps.len() / 2;
        self.period_s = match steps.get(middle) {
            Some(_) => *steps.select_nth_unstable_by(middle, f64::total_cmp).1,
            None => f64::INFINITY,
        };
        self.holds_s = (HOLDS_PERIODS * self.period_s).clamp(HOLDS_S[0], HOLDS_S[1]);
    }
}

/// A log of a bus, message by message.
#[derive(Debug)]
pub struct Log {
    /// What can fill a column, the better first.
    pub(super) candidates: Vec<Candidate>,
    pub(super) series: BTreeMap<Key, Series>,
    first: Option<Time>,
    pub(super) duration_s: f64,
    samples: usize,
    pub(super) messages: u64,
}

impl Log {
    /// An empty log, of whose signals some are a maker's own.
    ///
    /// The signals that the user named come before the standard's, those found by their number (SPN)
    /// after them.
    #[must_use]
    pub fn new(dbc: Option<&Dbc>) -> Self {
        let (named, by_number) = dbc.map(Dbc::candidates).unwrap_or_default();
        let candidates = [named, standard(), by_number].concat();
        let series = BTreeMap::new();
        Self { candidates, series, first: None, duration_s: 0.0, samples: 0, messages: 0 }
    }

    /// Takes a message, of one frame or put together by the transport, heard on a channel of the log.
    /// What no column needs is passed over.
    ///
    /// # Errors
    /// [`DiagnosisError::LongLog`] when there is more than a machine can hold.
    pub fn hear(
        &mut self,
        time: Time,
        channel: usize,
        id: Id,
        bytes: &[u8],
    ) -> Result<(), DiagnosisError> {
        let first = *self.first.get_or_insert(time);
        let time_s = time.seconds_since(first);
        self.messages += 1;
        self.duration_s = self.duration_s.max(time_s);
        for (candidate, c) in self.candidates.iter().enumerate() {
            if c.pgn != id.pgn() {
                continue;
            }
            // requests go to somebody, all else comes from somebody
            let is_request = REQUESTS.contains(&c.pgn) && matches!(c.read, Read::Standard(_));
            let address = if is_request { id.da() } else { id.sa() };
            if !c.only.is_empty() && !c.only.contains(&address) {
                continue;
            }
            let series = self.series.entry(Key { candidate, channel, address }).or_default();
            match c.value(id, bytes) {
                Some(value) => {
                    self.samples += 1;
                    series.samples.push((time_s, value));
                }
                None => series.no_number += 1,
            }
        }
        if self.samples > MOST_SAMPLES {
            return Err(DiagnosisError::LongLog { samples: MOST_SAMPLES, until_s: time_s });
        }
        Ok(())
    }

    /// Brings every series in order.
    pub(super) fn settle(&mut self) {
        self.series.values_mut().for_each(Series::settle);
    }

    /// Whether what a key names is wanted for this.
    pub(super) fn is_for(&self, key: &Key, what: What) -> bool {
        self.candidates.get(key.candidate).is_some_and(|c| c.what == what)
    }

    /// The median of what a signal says, from whoever says it most.
    pub(super) fn median(&self, what: What) -> Option<f64> {
        let of_it = self.series.iter().filter(|(k, _)| self.is_for(k, what));
        let (_, series) = of_it.max_by_key(|(_, s)| s.samples.len())?;
        let mut values: Vec<f64> = series.samples.iter().map(|s| s.1).collect();
        let middle = values.len() / 2;
        values.get(middle)?;
        Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
    }
}

/// Groups that ask somebody for something.
const REQUESTS: [u32; 2] = [Tsc1::TABLE.pgn, Xbr::TABLE.pgn];
