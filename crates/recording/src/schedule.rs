//! Which topics of a tick are recorded: the scene at 10 Hz, the diagnostics at 1 Hz, the lane lines
//! every 10 s.

use road::Road;
use tractrix_core::Time;

/// Scene, path and markers are recorded at most this often.
const SCENE_PERIOD: Time = Time(100_000_000);
/// The state of the stack's parts.
const DIAGNOSTICS_PERIOD: Time = Time(1_000_000_000);
/// The lane lines around the truck are repeated this often, for viewers that join or jump.
const LANES_PERIOD: Time = Time(10_000_000_000);
/// At the start they are written for so much of the road, m: 2.4 MB of points for two lanes.
pub(crate) const LANES_AT_START_M: f64 = 100_000.0;

/// What of a tick is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Due {
    /// Scene, path, markers and position on the earth.
    pub scene: bool,
    /// The state of the stack's parts; with the scene only.
    pub diagnostics: bool,
    /// The lane lines around the truck; with the scene only.
    pub lanes: bool,
}

/// When what is not recorded at every tick is due again.
#[derive(Debug, Clone)]
pub struct Schedule {
    scene: Time,
    diagnostics: Time,
    lanes: Time,
}

impl Schedule {
    /// For a recording of this road: everything but the lane lines is due at once, and these too
    /// where the start could not hold them all.
    #[must_use]
    pub fn new(road: &Road) -> Self {
        let is_long = road.length_m() > LANES_AT_START_M;
        let lanes = if is_long { Time::ZERO } else { LANES_PERIOD };
        Self { scene: Time::ZERO, diagnostics: Time::ZERO, lanes }
    }

    /// What is due at `now`, which is taken as done.
    pub fn due(&mut self, now: Time) -> Due {
        let scene = now >= self.scene;
        let diagnostics = scene && now >= self.diagnostics;
        let lanes = scene && now >= self.lanes;
        if scene {
            self.scene = now.plus_nanos(SCENE_PERIOD.0);
        }
        if diagnostics {
            self.diagnostics = now.plus_nanos(DIAGNOSTICS_PERIOD.0);
        }
        if lanes {
            self.lanes = now.plus_nanos(LANES_PERIOD.0);
        }
        Due { scene, diagnostics, lanes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scene_diagnostics_and_lanes_come_at_their_rates() {
        let mut schedule = Schedule::new(&road::builtin::flat(1000.0));
        let due: Vec<Due> =
            (0..2001).map(|k| schedule.due(Time::ZERO.plus_nanos(k * 10_000_000))).collect();
        assert_eq!(due.iter().filter(|d| d.scene).count(), 201);
        assert_eq!(due.iter().filter(|d| d.diagnostics).count(), 21);
        assert_eq!(due.iter().filter(|d| d.lanes).count(), 2);
        assert!(due[1000].lanes && due[2000].lanes);
    }
}
