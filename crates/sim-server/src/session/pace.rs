//! How fast simulated time runs against the wall clock.

use std::str::FromStr;
use std::time::Duration;

use serde::Serialize;

/// The pace of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Pace {
    /// As fast as the machine can.
    Max,
    /// This many simulated seconds per second.
    Factor(f64),
}

impl Pace {
    /// One simulated second per second.
    pub(crate) const REALTIME: Self = Self::Factor(1.0);
    /// What a pace can be, in words.
    pub(crate) const VALUES: &str = "realtime, max or a factor from 0.01 to 10000";

    /// A pace as JSON has it: a word or a number.
    pub(crate) fn from_json(value: &serde_json::Value) -> Option<Self> {
        match value {
            serde_json::Value::String(text) => text.parse().ok(),
            serde_json::Value::Number(factor) => factor.to_string().parse().ok(),
            _ => None,
        }
    }
}

/// Paces that make sense to a viewer and to a clock.
const FACTORS: std::ops::RangeInclusive<f64> = 0.01..=10_000.0;

impl FromStr for Pace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "realtime" => Ok(Self::REALTIME),
            "max" => Ok(Self::Max),
            _ => text
                .parse()
                .ok()
                .filter(|factor| FACTORS.contains(factor))
                .map(Self::Factor)
                .ok_or_else(|| format!("a pace is {}", Self::VALUES)),
        }
    }
}

impl std::fmt::Display for Pace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Max => f.write_str("max"),
            Self::Factor(1.0) => f.write_str("realtime"),
            Self::Factor(factor) => write!(f, "{factor}"),
        }
    }
}

impl Serialize for Pace {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Which tick is due when. Wall times are durations since the start of the process' run.
#[derive(Debug, Clone)]
pub(crate) struct Pacer {
    pace: Pace,
    tick_s: f64,
    /// Wall time at which tick 0 of the present stretch was due.
    start: Duration,
    /// Ticks since then.
    ticks: u64,
    missed_deadlines: u64,
}

/// A world that is further behind than this gives up the lost time instead of racing after it.
const LONGEST_LAG: Duration = Duration::from_millis(250);

impl Pacer {
    /// A pacer whose first tick is due at `now`.
    pub(crate) const fn new(pace: Pace, tick_s: f64, now: Duration) -> Self {
        Self { pace, tick_s, start: now, ticks: 0, missed_deadlines: 0 }
    }

    /// The pace.
    pub(crate) const fn pace(&self) -> Pace {
        self.pace
    }

    /// Ticks whose work ended after their deadline, the time at which the next one was due.
    pub(crate) const fn missed_deadlines(&self) -> u64 {
        self.missed_deadlines
    }

    /// Starts a new stretch, after a pause or with another pace.
    pub(crate) const fn restart(&mut self, pace: Pace, now: Duration) {
        self.pace = pace;
        self.start = now;
        self.ticks = 0;
    }

    /// Time until the next tick is due; zero when it is.
    pub(crate) fn wait(&self, now: Duration) -> Duration {
        self.due(self.ticks).map_or(Duration::ZERO, |due| due.saturating_sub(now))
    }

    /// Notes that a tick has ended; true if that was after its deadline.
    pub(crate) fn tick_ended(&mut self, now: Duration) -> bool {
        self.ticks += 1;
        let Some(deadline) = self.due(self.ticks).filter(|&deadline| now > deadline) else {
            return false;
        };
        self.missed_deadlines += 1;
        if now - deadline > LONGEST_LAG {
            self.restart(self.pace, now);
        }
        true
    }

    fn due(&self, tick: u64) -> Option<Duration> {
        let Pace::Factor(factor) = self.pace else { return None };
        Some(self.start + Duration::from_secs_f64(tick as f64 * self.tick_s / factor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_pace_is_a_word_or_a_positive_factor() {
        assert_eq!("realtime".parse(), Ok(Pace::REALTIME));
        assert_eq!("max".parse(), Ok(Pace::Max));
        assert_eq!("2.5".parse(), Ok(Pace::Factor(2.5)));
        for bad in ["0", "-1", "NaN", "inf", "fast", ""] {
            assert!(bad.parse::<Pace>().is_err(), "{bad}");
        }
    }

    #[test]
    fn ticks_are_due_at_multiples_of_the_scaled_period() {
        let mut pacer = Pacer::new(Pace::Factor(2.0), 0.01, 100 * MS);
        assert_eq!(pacer.wait(100 * MS), Duration::ZERO);
        pacer.tick_ended(101 * MS);
        assert_eq!(pacer.wait(101 * MS), 4 * MS);
        assert_eq!(pacer.missed_deadlines(), 0);
    }

    #[test]
    fn a_tick_that_ends_after_its_deadline_is_counted_and_long_lags_are_given_up() {
        let mut pacer = Pacer::new(Pace::REALTIME, 0.01, Duration::ZERO);
        pacer.tick_ended(12 * MS);
        assert_eq!(pacer.missed_deadlines(), 1);
        assert_eq!(pacer.wait(12 * MS), Duration::ZERO, "catches up");
        pacer.tick_ended(2000 * MS);
        pacer.tick_ended(2001 * MS);
        assert_eq!(pacer.missed_deadlines(), 2);
        assert_eq!(pacer.wait(2001 * MS), 9 * MS, "does not race after two lost seconds");
    }

    #[test]
    fn at_full_speed_nothing_is_ever_late() {
        let mut pacer = Pacer::new(Pace::Max, 0.01, Duration::ZERO);
        pacer.tick_ended(Duration::from_secs(1));
        assert_eq!((pacer.missed_deadlines(), pacer.wait(Duration::ZERO)), (0, Duration::ZERO));
    }
}
