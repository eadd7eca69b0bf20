//! Cut-ins and aborted lane changes in closed loop with the tests' own truck.

use crate::support::data_sheet::reference_limits;
use crate::support::{Plant, Scripted};
use planner::safety::{RssConfig, SafeGap};
use planner::{DeciderKind, LaneChoice, Stack, StackConfig, drive_tick};
use road::builtin;
use tractrix_core::{EgoState, Maneuver, Neighbour, Scene, Time, VehicleClass};

fn tick(i: i64) -> Time {
    Time(i * 10_000_000)
}

fn car(id: u64, rear_s_m: f64, d_m: f64, lane: u16, speed_m_s: f64) -> Neighbour {
    Neighbour {
        id,
        class: VehicleClass::Car,
        front_s_m: rear_s_m + 4.5,
        rear_s_m,
        d_m,
        width_m: 1.8,
        speed_m_s,
        lane,
        ..Neighbour::default()
    }
}

/// A car comes in at `gap` with `v_car` in front of the truck at `v`; two seconds later it brakes
/// to a halt with 8 m/s². Returns the smallest gap.
fn cut_in(v: f64, v_car: f64, gap: f64) -> f64 {
    let road = builtin::flat(6_000.0);
    let limits = reference_limits();
    let d = road.lanes()[0].center_d_m(0.0);
    let front = limits.geometry.front_m;
    let mut plant = Plant::new(&road, limits.clone(), 200.0, d, v);
    let config = StackConfig { set_speed_m_s: v, ..StackConfig::default() };
    let mut stack = Stack::new(config, &limits).unwrap();
    let mut rear: Option<f64> = None;
    let mut speed = v_car;
    let mut least = f64::INFINITY;
    let mut traffic = Scripted(
        |now: Time, ego: &EgoState| {
            let t = now.seconds();
            if t < 3.0 {
                return Scene::default();
            }
            let accel = if t > 5.0 && speed > 0.0 { -8.0 } else { 0.0 };
            speed = f64::max(speed + accel * 0.01, 0.0);
            let s = rear.get_or_insert(ego.s_m + front + gap);
            *s += speed * 0.01;
            least = least.min(*s - ego.s_m - front);
            let mut n = car(1, *s, d, 0, speed);
            n.accel_m_s2 = accel;
            Scene { neighbours: vec![n], ..Scene::default() }
        },
        Scene::default(),
    );
    for i in 0..4000 {
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
    }
    assert!(plant.ego.speed_m_s < 0.5, "{v}/{v_car}/{gap}: still at {}", plant.ego.speed_m_s);
    least
}

#[test]
fn no_cut_in_that_was_safe_when_it_happened_ends_in_a_collision() {
    let response = RssConfig::default().ego_response(&reference_limits());
    let safe = SafeGap::new(&response, RssConfig::default().car_brake_max_m_s2, 0.0);
    let (mut tried, mut unsafe_ones) = (0, 0);
    for v in [12.0, 16.0, 20.0, 24.0] {
        for v_car in [10.0, 16.0, 22.0, 28.0, 33.0] {
            for gap in [5.0, 15.0, 30.0, 45.0, 60.0, 80.0, 110.0, 150.0] {
                if gap < safe.gap_m(v, v_car) {
                    unsafe_ones += 1;
                    continue;
                }
                tried += 1;
                let least = cut_in(v, v_car, gap);
                assert!(least > 0.0, "{v} behind {v_car} at {gap}: {least}");
            }
        }
    }
    assert!(tried > 50 && unsafe_ones > 50, "{tried} {unsafe_ones}");
}

/// A change to the left during which a fast car appears behind in the target lane at `appear_s`.
/// Returns (aborted, smallest gap to that car while the truck is in its lane).
fn abort_run(appear_s: f64) -> (bool, f64, f64) {
    let road = builtin::flat(6_000.0);
    let limits = reference_limits();
    let (d0, d1) = (road.lanes()[0].center_d_m(0.0), road.lanes()[1].center_d_m(0.0));
    let rear_m = limits.geometry.rear_m();
    let mut plant = Plant::new(&road, limits.clone(), 200.0, d0, 20.0);
    let config = StackConfig { decider: DeciderKind::External, ..StackConfig::default() };
    let mut stack = Stack::new(config, &limits).unwrap();
    let mut front: Option<f64> = None;
    let mut speed = 30.0;
    let mut least = f64::INFINITY;
    let mut traffic = Scripted(
        |now: Time, ego: &EgoState| {
            if now.seconds() < 3.0 + appear_s {
                return Scene::default();
            }
            let s = front.get_or_insert(ego.s_m - rear_m - 70.0);
            let gap = ego.s_m - rear_m - *s;
            let in_lane = (ego.d_m - d1).abs() < 2.2;
            // The driver behind reacts as the safe gap assumes, once the truck is in the lane
            let accel = if in_lane && gap < 60.0 { -4.0 } else { 0.0 };
            speed = f64::max(speed + accel * 0.01, 18.0);
            *s += speed * 0.01;
            if in_lane {
                least = least.min(ego.s_m - rear_m - *s);
            }
            Scene { neighbours: vec![car(7, *s - 4.5, d1, 1, speed)], ..Scene::default() }
        },
        Scene::default(),
    );
    let mut aborted = false;
    let mut worst_jump: f64 = 0.0;
    let mut last = (0.0, 0.0);
    for i in 0..2500 {
        if i == 300 {
            stack.request_lane_change(LaneChoice::Left);
        }
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        let plan = stack.plan();
        assert!(plan.guard.is_empty(), "{:?}", plan.guard);
        assert!(plant.ego.accel_y_m_s2.abs() < 1.6, "{}", plant.ego.accel_y_m_s2);
        assert!(plan.lateral_error_m.abs() < 0.10, "{}", plan.lateral_error_m);
        aborted |= plan.maneuver == Maneuver::AbortChange;
        let slope = plan.target_d_m - last.0;
        if i > 1 {
            worst_jump = worst_jump.max((slope - last.1).abs());
        }
        last = (plan.target_d_m, slope);
    }
    let end = if aborted { d0 } else { d1 };
    assert!((plant.ego.d_m - end).abs() < 0.05, "appear {appear_s}: ended at {}", plant.ego.d_m);
    (aborted, least, worst_jump)
}

#[test]
fn a_change_is_aborted_while_still_inside_the_lane_and_finished_afterwards_without_a_jump() {
    let mut aborts = Vec::new();
    for i in 0..14 {
        let appear_s = 0.1 + 0.4 * f64::from(i);
        let (aborted, least, jump) = abort_run(appear_s);
        aborts.push(aborted);
        assert!(least > 0.0, "appear {appear_s}: {least}");
        // The target's slope changes by less than a_y dt² v-free bound of one tick: no step in d'
        assert!(jump < 1e-3, "appear {appear_s}: slope jumps by {jump} m per tick");
    }
    let first_finish = aborts.iter().position(|a| !a).unwrap();
    assert!(first_finish >= 3, "aborts early on: {aborts:?}");
    assert!(aborts[first_finish..].iter().all(|a| !a), "and never later: {aborts:?}");
}
