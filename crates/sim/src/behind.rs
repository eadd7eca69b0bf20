//! Who brakes hard behind the truck because of it.

use planner::safety::{RssConfig, SafeGap};
use tractrix_core::{EgoState, Geometry, Maneuver, Neighbour, Scene, Time};

/// Braking of others from which it is hard, m/s².
const HARD_M_S2: f64 = 3.0;
/// Braking of the ego that may be its cause, m/s².
const EGO_BRAKES_M_S2: f64 = 1.0;
/// Time after the ego's entry into a lane for which braking behind it is its doing, s.
const ENTERED_S: f64 = 5.0;
/// Room for those who brake one after the other: more are not in one braking.
const ROOM: usize = 16;

/// A vehicle behind the truck in its lane brakes harder than 3 m/s² within twice its safe gap while
/// the truck brakes harder than 1 m/s², or has entered its lane within the last 5 s; once per vehicle
/// and braking.
#[derive(Debug)]
pub(crate) struct Behind {
    entered: Option<Time>,
    braking: Vec<u64>,
}

impl Default for Behind {
    fn default() -> Self {
        Self { entered: None, braking: Vec::with_capacity(ROOM) }
    }
}

/// A copy has the room too; `clone_from` copies into it.
impl Clone for Behind {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, from: &Self) {
        self.entered = from.entered;
        self.braking.clone_from(&from.braking);
    }
}

impl Behind {
    /// Forgets everybody.
    pub(crate) fn clear(&mut self) {
        self.entered = None;
        self.braking.clear();
    }

    /// Whether somebody begins to now.
    pub(crate) fn begins_to_brake(
        &mut self,
        now: Time,
        ego: &EgoState,
        scene: &Scene,
        maneuver: Maneuver,
        geometry: &Geometry,
        rss: &RssConfig,
    ) -> bool {
        if matches!(maneuver, Maneuver::ChangeLeft | Maneuver::ChangeRight) {
            self.entered = Some(now);
        }
        let entered = self.entered.is_some_and(|t| now.seconds_since(t) < ENTERED_S);
        let cause = entered || ego.accel_x_m_s2 < -EGO_BRAKES_M_S2;
        let rear_m = ego.s_m - geometry.rear_m();
        let beside =
            |n: &&Neighbour| (n.d_m - ego.d_m).abs() < 0.5 * (n.width_m + geometry.width_m);
        let behind = scene
            .neighbours
            .iter()
            .filter(|n| n.front_s_m < rear_m)
            .filter(beside)
            .max_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m));
        let hard = behind.filter(|n| n.accel_m_s2 < -HARD_M_S2 && n.speed_m_s > 0.5);
        let Some(n) = hard else {
            self.braking.clear();
            return false;
        };
        let safe = SafeGap::new(&rss.behind(n.class), rss.ego_brake_max_m_s2, 0.0);
        let near_m = 2.0 * safe.gap_m(n.speed_m_s, ego.speed_m_s).max(10.0);
        let begins = cause && rear_m - n.front_s_m < near_m && !self.braking.contains(&n.id);
        if begins {
            self.braking.push(n.id);
        }
        begins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Behind a truck at 20 m/s whose rear is at 88 m.
    fn watch(watch: &mut Behind, second: i64, changes: bool, gap_m: f64, accel_m_s2: f64) -> bool {
        let geometry = Geometry { trailer_rear_m: 12.0, width_m: 2.5, ..Geometry::default() };
        let n = Neighbour { front_s_m: 88.0 - gap_m, speed_m_s: 22.0, ..Neighbour::default() };
        let n = Neighbour { id: 7, rear_s_m: n.front_s_m - 4.0, width_m: 1.8, accel_m_s2, ..n };
        let scene = Scene { neighbours: vec![n], ..Scene::default() };
        let now = Time::ZERO.plus_nanos(second * 1_000_000_000);
        let maneuver = if changes { Maneuver::ChangeLeft } else { Maneuver::KeepLane };
        let ego = EgoState { s_m: 100.0, speed_m_s: 20.0, ..EgoState::default() };
        watch.begins_to_brake(now, &ego, &scene, maneuver, &geometry, &RssConfig::default())
    }

    #[test]
    fn hard_braking_counts_once_and_only_where_the_truck_is_the_cause() {
        let mut behind = Behind::default();
        assert!(!watch(&mut behind, 0, false, 10.0, -4.0), "the truck has done nothing");
        assert!(!watch(&mut behind, 1, true, 10.0, -2.0), "not hard");
        assert!(watch(&mut behind, 2, false, 10.0, -4.0), "1 s after the change");
        assert!(!watch(&mut behind, 3, false, 8.0, -4.0), "still the same braking");
        assert!(!watch(&mut behind, 4, false, 8.0, 0.0));
        assert!(watch(&mut behind, 5, false, 8.0, -4.0), "another one");
        assert!(!watch(&mut behind, 9, false, 8.0, 0.0));
        assert!(!watch(&mut behind, 10, false, 8.0, -4.0), "9 s after the change");
        assert!(!watch(&mut behind, 11, true, 400.0, -4.0), "far away");
    }
}
