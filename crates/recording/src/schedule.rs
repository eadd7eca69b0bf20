//! Which topics of a tick are recorded: the scene at 10 Hz, the lane lines every 10 s.

use road::Road;
use tractrix_core::Time;

/// Scene, path and markers are recorded at most this often.
const SCENE_PERIOD: Time = Time(100_000_000);
/// The lane lines around the truck are repeated this often, for viewers that join or jump.
const LANES_PERIOD: Time = Time(10_000_000_000);
/// At the start they are written for so much of the road, m: 2.4 MB of points for two lanes.
pub(crate) const LANES_AT_START_M: f64 = 100_000.0;

/// What of a tick is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Due {
    /// Scene, path, markers and position on the earth.
    pub scene: bool,
    /// The lane lines around the truck; with the scene only.
    pub lanes: bool,
}

/// When what is not recorded at every tick is due again.
#[derive(Debug, Clone)]
pub struct Schedule {
    scene: Time,
    lanes: Time,
}

impl Schedule {
    /// For a recording of this road: everything but the lane lines is due at once, and these too
    /// where the start could not hold them all.
    #[must_use]
    pub fn new(road: &Road) -> Self {
        let is_long = road.length_m() > LANES_AT_START_M;
        Self { scene: Time::ZERO, lanes: if is_long { Time::ZERO } else { LANES_PERIOD } }
    }

    /// What is due at `now`, which is taken as done.
    pub fn due(&mut self, now: Time) -> Due {
        let scene = now >= self.scene;
        let lanes = scene && now >= self.lanes;
        if scene {
            self.scene = now.plus_nanos(SCENE_PERIOD.0);
        }
        if lanes {
            self.lanes = now.plus_nanos(LANES_PERIOD.0);
        }
        Due { scene, lanes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scene_comes_at_ten_hertz_and_the_lanes_every_ten_seconds() {
        let mut schedule = Schedule::new(&road::builtin::flat(1000.0));
        let due: Vec<Due> =
            (0..2001).map(|k| schedule.due(Time::ZERO.plus_nanos(k * 10_000_000))).collect();
        assert_eq!(due.iter().filter(|d| d.scene).count(), 201);
        assert_eq!(due.iter().filter(|d| d.lanes).count(), 2);
        assert!(due[1000].lanes && due[2000].lanes);
    }
}
