//! What is ahead of the truck: the vehicle that it follows and the speed that is planned.

use planner::pcc::horizon::HorizonPlan;
use serde::Serialize;
use tractrix_core::{EgoState, Neighbour, Plan, Scene};

use super::strip::round;

/// Spacing of the planned speed as it is sent, m, and how far it reaches, m.
const STEP_M: f64 = 50.0;
const REACH_M: f64 = 4000.0;
/// Below this speed a time gap says nothing, m/s.
const SLOWEST_M_S: f64 = 0.5;
/// A gap that closes more slowly is taken to stay, m/s.
const LEAST_CLOSING_M_S: f64 = 0.05;

/// The vehicle ahead, bumper to bumper.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Lead {
    id: u64,
    speed_m_s: f64,
    gap_m: f64,
    /// None while the truck stands.
    time_gap_s: Option<f64>,
    /// None while the gap does not close.
    time_to_collision_s: Option<f64>,
}

impl Lead {
    /// The vehicle that the plan follows, otherwise the nearest one ahead in the truck's lane.
    pub(super) fn of(plan: &Plan, ego: &EgoState, scene: &Scene, front_m: f64) -> Option<Self> {
        let nose_s_m = ego.s_m + front_m;
        let gap_m = |n: &Neighbour| n.rear_s_m - nose_s_m;
        let followed = scene.neighbours.iter().find(|n| plan.following == Some(n.id));
        let in_lane = || {
            let ahead = |n: &&Neighbour| n.lane == plan.lane && n.front_s_m > nose_s_m;
            let all = scene.neighbours.iter().filter(ahead);
            all.min_by(|a, b| a.rear_s_m.total_cmp(&b.rear_s_m))
        };
        let n = followed.or_else(in_lane)?;
        let closing_m_s = ego.speed_m_s - n.speed_m_s;
        let time_gap_s = gap_m(n) / ego.speed_m_s;
        let time_to_collision_s = gap_m(n).max(0.0) / closing_m_s;
        Some(Self {
            id: n.id,
            speed_m_s: round(n.speed_m_s, 1e2),
            gap_m: round(gap_m(n), 10.0),
            time_gap_s: (ego.speed_m_s > SLOWEST_M_S).then(|| round(time_gap_s, 1e2)),
            time_to_collision_s: (closing_m_s > LEAST_CLOSING_M_S)
                .then(|| round(time_to_collision_s, 10.0)),
        })
    }
}

/// The planned speed from the truck on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct SpeedAhead {
    from_m: f64,
    step_m: f64,
    speed_m_s: Vec<f64>,
}

impl SpeedAhead {
    /// What the controller follows, then the predictive planner's speed as far as it goes.
    pub(super) fn of(plan: &Plan, horizon: Option<&HorizonPlan>, s_m: f64) -> Self {
        let near = |s_m: f64| {
            let i = plan.speed.partition_point(|p| p.s_m <= s_m);
            let (a, b) = (plan.speed.get(i.checked_sub(1)?)?, plan.speed.get(i)?);
            let share = (s_m - a.s_m) / (b.s_m - a.s_m);
            Some(a.speed_m_s + share * (b.speed_m_s - a.speed_m_s))
        };
        let far = |s_m: f64| horizon?.at(s_m).map(|p| p.speed_m_s);
        let first_m = plan.speed.first().map_or(s_m, |p| p.s_m.max(s_m));
        let stations = (0..=(REACH_M / STEP_M) as usize).map(|i| first_m + i as f64 * STEP_M);
        let speeds = stations.map_while(|s_m| near(s_m).or_else(|| far(s_m)));
        let speed_m_s = speeds.map(|v| round(v, 1e2)).collect();
        Self { from_m: round(first_m, 10.0), step_m: STEP_M, speed_m_s }
    }
}

#[cfg(test)]
mod tests {
    use tractrix_core::SpeedPoint;

    use super::*;

    fn car(id: u64, lane: u16, rear_s_m: f64, speed_m_s: f64) -> Neighbour {
        let front_s_m = rear_s_m + 4.5;
        Neighbour { id, lane, rear_s_m, front_s_m, speed_m_s, ..Neighbour::default() }
    }

    fn ego(speed_m_s: f64) -> EgoState {
        EgoState { s_m: 100.0, speed_m_s, ..EgoState::default() }
    }

    #[test]
    fn gap_time_gap_and_time_to_collision_are_those_between_the_bumpers() {
        let scene = Scene {
            neighbours: vec![car(1, 0, 90.0, 20.0), car(2, 1, 110.0, 5.0), car(3, 0, 165.0, 16.0)],
            ..Scene::default()
        };
        let plan = Plan::default();
        let lead = Lead::of(&plan, &ego(20.0), &scene, 5.0).unwrap();
        assert_eq!((lead.id, lead.gap_m), (3, 60.0));
        assert_eq!((lead.time_gap_s, lead.time_to_collision_s), (Some(3.0), Some(15.0)));
        let slower = Lead::of(&plan, &ego(10.0), &scene, 5.0).unwrap();
        assert_eq!(slower.time_to_collision_s, None);
        assert_eq!(Lead::of(&plan, &ego(0.0), &scene, 5.0).unwrap().time_gap_s, None);
        let followed = Plan { following: Some(2), ..Plan::default() };
        assert_eq!(Lead::of(&followed, &ego(20.0), &scene, 5.0).unwrap().id, 2);
        assert_eq!(Lead::of(&plan, &ego(20.0), &Scene::default(), 5.0), None);
    }

    #[test]
    fn the_speed_ahead_is_the_reference_as_far_as_it_goes() {
        let point = |s_m: f64, speed_m_s: f64| SpeedPoint { s_m, speed_m_s, accel_m_s2: 0.0 };
        let plan = Plan { speed: vec![point(90.0, 20.0), point(190.0, 10.0)], ..Plan::default() };
        let ahead = SpeedAhead::of(&plan, None, 100.0);
        assert_eq!((ahead.from_m, ahead.speed_m_s), (100.0, vec![19.0, 14.0]));
        assert_eq!(SpeedAhead::of(&Plan::default(), None, 100.0).speed_m_s, Vec::<f64>::new());
    }
}
