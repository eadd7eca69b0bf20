//! How long ticks take on the wall clock of the shell that measures them.

use std::time::Duration;

use hdrhistogram::Histogram;
use serde::Serialize;

/// Wall time of a tick, µs, recording hand-over included.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TickTime {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Longest.
    pub max: f64,
}

/// Longer ticks count as this long, ns: one hour.
const LONGEST_NS: u64 = 3_600_000_000_000;

/// Collects tick times with three significant digits.
#[derive(Debug, Clone)]
pub struct TickTimes(Histogram<u64>);

impl TickTimes {
    /// Nothing collected.
    #[must_use]
    #[expect(clippy::expect_used, reason = "constant bounds that the crate accepts")]
    pub fn new() -> Self {
        Self(Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("valid bounds"))
    }

    /// Adds one tick.
    pub fn add(&mut self, time: Duration) {
        self.0.saturating_record(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    }

    /// The figures; zero when nothing was collected.
    #[must_use]
    pub fn tick_time_us(&self) -> TickTime {
        let us = |ns: u64| ns as f64 * 1e-3;
        TickTime {
            p50: us(self.0.value_at_quantile(0.5)),
            p99: us(self.0.value_at_quantile(0.99)),
            max: us(self.0.max()),
        }
    }
}

impl Default for TickTimes {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_collected_times() {
        let mut times = TickTimes::new();
        for us in 1..=100 {
            times.add(Duration::from_micros(us));
        }
        let t = times.tick_time_us();
        assert!((t.p50 - 50.0).abs() < 0.1 && (t.p99 - 99.0).abs() < 0.1, "{t:?}");
        assert!((t.max - 100.0).abs() < 0.1, "{t:?}");
    }
}
