//! Lane changes in front of drivers that make no room: broken off, or driven without a collision.

use crate::support::data_sheet::reference_limits;
use planner::safety::{RssConfig, SafeGap};
use planner::{DeciderKind, LaneChoice, RatesConfig, Situation, StackConfig, Tactics};
use road::builtin;
use tractrix_core::{EgoState, Maneuver, Neighbour, Scene, Time, VehicleClass};

const TICK_S: f64 = 0.05;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Refused,
    Aborted,
    Driven,
    Collided,
}

/// A change to the left at 20 m/s in front of a car at `gap_m` with `car_m_s`, which accelerates
/// with `pushes_m_s2` as soon as it sees the change begin, and brakes only once the safe gap behind
/// a truck in its lane is undershot and its reaction time has passed.
fn change(gap_m: f64, car_m_s: f64, pushes_m_s2: f64) -> Outcome {
    let (road, limits) = (builtin::flat(6_000.0), reference_limits());
    let config = StackConfig {
        decider: DeciderKind::External,
        rates: RatesConfig::for_tick(TICK_S),
        ..StackConfig::default()
    };
    let rss = RssConfig::default();
    let response = rss.behind(VehicleClass::Car);
    let safe = SafeGap::new(&response, rss.ego_brake_max_m_s2, 0.0);
    let mut tactics = Tactics::new(config, None).unwrap();
    let (g, lane) = (limits.geometry, &road.lanes()[1]);
    let d_m = road.lanes()[0].center_d_m(0.0);
    let mut ego = EgoState { s_m: 500.0, d_m, speed_m_s: 20.0, ..EgoState::default() };
    let front_s_m = ego.s_m - g.rear_m() - gap_m;
    let mut car = Neighbour {
        front_s_m,
        rear_s_m: front_s_m - 4.5,
        d_m: lane.center_d_m(0.0),
        width_m: 1.8,
        speed_m_s: car_m_s,
        lane: 1,
        ..Neighbour::default()
    };
    let (mut aborted, mut undershot_s) = (false, None);
    for i in 0..600 {
        let now = Time::from_seconds(f64::from(i) * TICK_S);
        let scene = Scene { time: now, neighbours: vec![car] };
        let at = Situation { now, ego: &ego, scene: &scene, road: &road, limits: &limits };
        if i == 20 {
            tactics.request_lane_change(LaneChoice::Left);
        }
        let plan = tactics.tick(&at).unwrap();
        if plan.refusal.is_some() && plan.maneuver == Maneuver::KeepLane {
            return Outcome::Refused;
        }
        aborted |= plan.maneuver == Maneuver::AbortChange;
        let front_d_m = plan.path.at(&road, ego.s_m + g.front_m).d_m;
        let reach_m = 0.5 * (lane.width_m(0.0) + g.width_m);
        let inside = (car.d_m - ego.d_m).abs().min((car.d_m - front_d_m).abs()) < reach_m;
        let gap = ego.s_m - g.rear_m() - car.front_s_m;
        let beside = (car.d_m - ego.d_m).abs() < 0.5 * (car.width_m + g.width_m);
        if beside && gap < 0.0 && car.rear_s_m < ego.s_m + g.front_m {
            return Outcome::Collided;
        }
        let now_s = now.seconds();
        if inside && gap < safe.gap_m(car.speed_m_s, ego.speed_m_s) {
            undershot_s.get_or_insert(now_s);
        }
        let answers = undershot_s.is_some_and(|since| now_s - since >= response.reaction_s);
        car.accel_m_s2 = match answers {
            true if car.speed_m_s > ego.speed_m_s => -response.brake_min_m_s2,
            false if i > 20 && !aborted => pushes_m_s2,
            _ => 0.0,
        };
        let moved = car.speed_m_s * TICK_S;
        car.speed_m_s += car.accel_m_s2 * TICK_S;
        (car.front_s_m, car.rear_s_m) = (car.front_s_m + moved, car.rear_s_m + moved);
        ego.s_m += ego.speed_m_s * TICK_S;
        ego.speed_m_s = (ego.speed_m_s + plan.target_accel_m_s2 * TICK_S).max(0.0);
        ego.d_m = plan.path.at(&road, ego.s_m).d_m;
    }
    if aborted { Outcome::Aborted } else { Outcome::Driven }
}

#[test]
fn in_front_of_drivers_that_make_no_room_a_change_is_broken_off_or_driven_without_a_collision() {
    let mut seen = std::collections::HashMap::new();
    for gap_m in (1..30).map(|i| 6.0 * f64::from(i)) {
        for car_m_s in [18.0, 21.0, 24.0, 28.0] {
            for pushes_m_s2 in [0.0, 0.7, 1.5] {
                let outcome = change(gap_m, car_m_s, pushes_m_s2);
                let case = format!("{gap_m} m, {car_m_s} m/s, {pushes_m_s2} m/s²");
                assert_ne!(outcome, Outcome::Collided, "{case}");
                *seen.entry(format!("{outcome:?}")).or_insert(0) += 1;
            }
        }
    }
    let bites = ["Refused", "Aborted", "Driven"].map(|o| seen.get(o).copied().unwrap_or(0));
    assert!(bites.iter().all(|n| *n > 10), "{seen:?}");
}
