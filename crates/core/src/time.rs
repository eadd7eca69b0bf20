//! Simulation and bus time as integer nanoseconds, passed in by the shell.

use serde::{Deserialize, Serialize};

/// A point in time, nanoseconds since the start of the run (or of the bus log). Signed, so that
/// differences cannot wrap. Never read from a clock below a shell.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
pub struct Time(pub i64);

impl Time {
    /// The start of a run.
    pub const ZERO: Self = Self(0);

    /// Time from seconds, rounded to the nearest nanosecond. Non-finite input gives zero.
    #[must_use]
    pub fn from_seconds(time_s: f64) -> Self {
        Self(if time_s.is_finite() { libm::round(time_s * 1e9) as i64 } else { 0 })
    }

    /// Seconds since the start of the run.
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Seconds from `earlier` to `self`; negative if `earlier` is later.
    #[must_use]
    pub fn seconds_since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }

    /// This time plus a number of nanoseconds.
    #[must_use]
    pub const fn plus_nanos(self, nanos: i64) -> Self {
        Self(self.0.saturating_add(nanos))
    }
}
