//! Of several who send a signal, the one that fills the column.

use serde::Serialize;

use super::collect::{Key, Log, Series};
use super::signals::{Candidate, Silence, What};
use crate::Channel;

/// A source must have a number for so much of the log.
const LEAST_FRESH_FRAC: f64 = 0.5;

/// Who fills a column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Choice {
    /// The column.
    pub column: &'static str,
    /// The message and signal.
    pub signal: String,
    /// Channel of the log, counted from 0.
    pub channel: usize,
    /// Address of the sender, of a request that of the receiver.
    pub address: u8,
    /// Median time between two messages, s.
    pub period_s: f64,
    /// Share of the log in which it has a number.
    pub fresh_frac: f64,
    /// Who else has it.
    pub others: Vec<String>,
}

/// A column that nobody fills.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unfilled {
    /// The column.
    pub column: &'static str,
    /// Why.
    pub why: String,
}

/// What was chosen for one place.
pub(super) struct Chosen<'a> {
    pub(super) candidate: &'a Candidate,
    pub(super) key: Key,
    pub(super) series: &'a Series,
}

/// The first candidate of the table that is fresh for half of the log; of its senders the one with
/// the highest rate, then that with the smallest address.
pub(super) fn choose(log: &Log, what: What) -> Option<Chosen<'_>> {
    let fit = |(key, series): (&Key, &'_ Series)| {
        let candidate = log.candidates.get(key.candidate)?;
        let is_request = candidate.silence == Silence::Zero && !series.samples.is_empty();
        let fresh = is_request || series.fresh_frac(log.duration_s) >= LEAST_FRESH_FRAC;
        (candidate.what == what && fresh).then_some((*key, candidate))
    };
    let mut fitting: Vec<(Key, &Candidate)> = log.series.iter().filter_map(fit).collect();
    fitting.sort_by(|a, b| {
        let period = |key: &Key| log.series.get(key).map_or(f64::INFINITY, |s| s.period_s);
        a.0.candidate
            .cmp(&b.0.candidate)
            .then(period(&a.0).total_cmp(&period(&b.0)))
            .then(a.0.cmp(&b.0))
    });
    let (key, candidate) = *fitting.first()?;
    Some(Chosen { candidate, key, series: log.series.get(&key)? })
}

impl Chosen<'_> {
    /// The value at a time, s; `NaN` where there is none.
    pub(super) fn at(&self, time_s: f64) -> f64 {
        match (self.series.at(time_s), self.candidate.silence) {
            (Some(value), _) => value,
            (None, Silence::Zero) => 0.0,
            (None, Silence::Unknown) => f64::NAN,
        }
    }

    pub(super) fn said(&self, log: &Log, channel: Channel) -> Choice {
        let others = log.series.iter().filter(|(key, series)| {
            **key != self.key && log.is_for(key, self.candidate.what) && !series.samples.is_empty()
        });
        let name = |key: &Key| {
            let signal = log.candidates.get(key.candidate).map_or("", |c| &*c.signal);
            format!("{signal} of {:02X} on channel {}", key.address, key.channel)
        };
        Choice {
            column: channel.name(),
            signal: self.candidate.signal.to_string(),
            channel: self.key.channel,
            address: self.key.address,
            period_s: self.series.period_s,
            fresh_frac: self.series.fresh_frac(log.duration_s).min(1.0),
            others: others.map(|(key, _)| name(key)).collect(),
        }
    }
}

/// Why nobody fills a column.
pub(super) fn why_not(log: &Log, what: What) -> String {
    let wanted: Vec<&str> =
        log.candidates.iter().filter(|c| c.what == what).map(|c| &*c.signal).collect();
    if wanted.is_empty() {
        return "no message of the standard has it".to_owned();
    }
    let of_it = || log.series.iter().filter(|(k, _)| log.is_for(k, what));
    let numbers: usize = of_it().map(|(_, s)| s.samples.len()).sum();
    let states: usize = of_it().map(|(_, s)| s.no_number).sum();
    let wanted = wanted.join(" or ");
    match (numbers, states) {
        (0, 0) => format!("nobody sends {wanted}"),
        (0, n) => format!("{wanted}: error or not available in all of {n} messages"),
        (n, _) => format!("{wanted}: only {n} numbers, for less than half of the log"),
    }
}
