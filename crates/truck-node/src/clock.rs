//! The program's time: nanoseconds since its start, on a clock that never goes back.

use std::time::{Duration, Instant};

use tractrix_core::Time;

/// The clock.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock(Instant);

impl Clock {
    #[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    pub(crate) fn elapsed(self) -> Duration {
        self.0.elapsed()
    }

    pub(crate) fn now(self) -> Time {
        Time(i64::try_from(self.elapsed().as_nanos()).unwrap_or(i64::MAX))
    }

    /// Sleeps until so long after the start.
    #[expect(clippy::disallowed_methods, reason = "the shell waits for its next tick")]
    pub(crate) fn sleep_until(self, due: Duration) {
        std::thread::sleep(due.saturating_sub(self.elapsed()));
    }
}
