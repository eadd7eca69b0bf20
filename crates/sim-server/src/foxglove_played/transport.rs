//! Where a playback is in its recording, and how it goes on: play, pause, seek, speed.

use std::time::Duration;

use tractrix_core::Time;

/// Simulated seconds per second that can be asked for.
pub(super) const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// The place and the pace. Wall times are durations since one start.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Transport {
    first: Time,
    last: Time,
    /// Where it was at this wall time, since when nothing has changed.
    at: Time,
    since: Duration,
    speed: f64,
    is_playing: bool,
}

impl Transport {
    /// Stands at the first of these times.
    pub(super) const fn new([first, last]: [Time; 2]) -> Self {
        let since = Duration::ZERO;
        Self { first, last, at: first, since, speed: 1.0, is_playing: false }
    }

    /// Simulation time now.
    pub(super) fn now(&self, wall: Duration) -> Time {
        if !self.is_playing {
            return self.at;
        }
        let gone_s = wall.saturating_sub(self.since).as_secs_f64() * self.speed;
        // More than the longest recording becomes its end
        let gone_ns = (gone_s * 1e9).min(9e18) as i64;
        Time(self.at.0.saturating_add(gone_ns)).min(self.last)
    }

    /// Wall time from now until this simulation time; none while it stands.
    pub(super) fn until(&self, time: Time, wall: Duration) -> Option<Duration> {
        let left_s = (time.0.saturating_sub(self.now(wall).0)) as f64 * 1e-9 / self.speed;
        self.is_playing.then(|| Duration::try_from_secs_f64(left_s).unwrap_or_default())
    }

    pub(super) const fn is_playing(&self) -> bool {
        self.is_playing
    }

    pub(super) const fn speed(&self) -> f64 {
        self.speed
    }

    /// Whether the last message is due.
    pub(super) fn is_at_end(&self, wall: Duration) -> bool {
        self.now(wall) == self.last
    }

    /// Goes on from here.
    pub(super) fn play(&mut self, wall: Duration) {
        self.settle(wall);
        self.is_playing = true;
    }

    pub(super) fn pause(&mut self, wall: Duration) {
        self.settle(wall);
        self.is_playing = false;
    }

    /// Goes to a time, or to the nearest one that there is, which it says.
    pub(super) fn seek(&mut self, time: Time, wall: Duration) -> Time {
        self.settle(wall);
        self.at = time.clamp(self.first, self.last);
        self.at
    }

    /// Another speed; false if it is none of [`SPEEDS`], and nothing changes.
    pub(super) fn set_speed(&mut self, speed: f64, wall: Duration) -> bool {
        let is_one = SPEEDS.contains(&speed);
        if is_one {
            self.settle(wall);
            self.speed = speed;
        }
        is_one
    }

    fn settle(&mut self, wall: Duration) {
        self.at = self.now(wall);
        self.since = wall;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn wall(s: f64) -> Duration {
        Duration::from_secs_f64(s)
    }

    #[test]
    fn it_stands_plays_at_its_speed_and_ends() {
        let mut t = Transport::new([Time(0), Time(10 * S)]);
        assert_eq!((t.now(wall(3.0)), t.until(Time(S), wall(3.0))), (Time(0), None));
        t.play(wall(3.0));
        assert_eq!(t.now(wall(4.0)), Time(S));
        assert_eq!(t.until(Time(3 * S), wall(4.0)), Some(wall(2.0)));
        assert!(t.set_speed(4.0, wall(4.0)));
        assert_eq!(t.now(wall(5.0)), Time(5 * S), "no jump with another speed");
        t.pause(wall(5.0));
        assert_eq!(t.now(wall(50.0)), Time(5 * S));
        t.play(wall(50.0));
        assert!(!t.is_at_end(wall(51.0)) && t.is_at_end(wall(51.25)));
        assert_eq!(t.now(wall(1e9)), Time(10 * S));
    }

    #[test]
    fn a_seek_stays_inside_and_a_speed_is_one() {
        let mut t = Transport::new([Time(S), Time(10 * S)]);
        assert_eq!(t.seek(Time(0), wall(0.0)), Time(S));
        assert_eq!(t.seek(Time(i64::MAX), wall(0.0)), Time(10 * S));
        assert_eq!(t.seek(Time(4 * S), wall(0.0)), Time(4 * S));
        for speed in [0.0, -1.0, f64::NAN, f64::INFINITY, 101.0] {
            assert!(!t.set_speed(speed, wall(0.0)), "{speed}");
        }
        assert_eq!(t.speed(), 1.0);
        t.play(wall(0.0));
        assert_eq!(t.now(wall(1.0)), Time(5 * S));
    }
}
