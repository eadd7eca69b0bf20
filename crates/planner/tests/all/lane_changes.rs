//! Lane changes in closed loop with the tests' own truck.

use crate::support::data_sheet::reference_limits;
use crate::support::{Misfit, Plant, no_traffic};
use planner::{DeciderKind, LaneChoice, Stack, StackConfig, drive_tick};
use road::{Road, builtin};
use tractrix_core::{
    LaneChangeReason, LaneChangeRefusal, Maneuver, Neighbour, Scene, Time, Vehicle, VehicleStatus,
};

fn tick(i: i64) -> Time {
    Time(i * 10_000_000)
}

fn external() -> StackConfig {
    StackConfig { decider: DeciderKind::External, ..StackConfig::default() }
}

struct Errors {
    tractor_m: f64,
    trailer_m: f64,
    lateral_accel_m_s2: f64,
    duration_s: f64,
}

/// Drives one change to the left at 20 m/s with the given misfit between truck and data sheet.
fn one_change(road: &Road, misfit: Misfit) -> Errors {
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(road, reference_limits(), 200.0, d, 20.0);
    plant.misfit = misfit;
    let mut stack = Stack::new(external(), &reference_limits()).unwrap();
    let mut traffic = no_traffic();
    let mut out =
        Errors { tractor_m: 0.0, trailer_m: 0.0, lateral_accel_m_s2: 0.0, duration_s: 0.0 };
    let left = road.left_of(0, 200.0).unwrap();
    for i in 0..3000 {
        if i == 500 {
            stack.request_lane_change(LaneChoice::Left);
        }
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, road, &mut ()).unwrap();
        let plan = stack.plan();
        assert!(plan.guard.is_empty(), "guard at {i}: {:?}", plan.guard);
        if i < 500 {
            continue;
        }
        out.tractor_m = out.tractor_m.max(plan.lateral_error_m.abs());
        out.lateral_accel_m_s2 = out.lateral_accel_m_s2.max(plant.ego.accel_y_m_s2.abs());
        if plan.maneuver == Maneuver::ChangeLeft {
            out.duration_s += 0.01;
        }
        // The trailer against the path that its axles are to follow: the one of the tractor.
        let (x, y) = plant.trailer_position();
        let at = road.project(x, y, Some(plant.ego.s_m)).unwrap();
        if let Some(behind) = path_behind(plan, at.s_m) {
            out.trailer_m = out.trailer_m.max((at.d_m - behind).abs());
        }
    }
    let centre = road.lanes()[usize::from(left)].center_d_m(plant.ego.s_m);
    assert!((plant.ego.d_m - centre).abs() < 0.02, "ended {} off", plant.ego.d_m - centre);
    out
}

thread_local! {
    static DRIVEN: std::cell::RefCell<Vec<(f64, f64)>> = const { std::cell::RefCell::new(Vec::new()) };
}

/// The planned offset at a station that the tractor has already passed.
fn path_behind(plan: &tractrix_core::Plan, s_m: f64) -> Option<f64> {
    DRIVEN.with_borrow_mut(|driven| {
        let s = plan.path.first().map_or(0.0, |p| p.s_m);
        if driven.last().is_some_and(|l| l.0 > s + 1.0) {
            driven.clear();
        }
        if driven.last().is_none_or(|l| l.0 < s) {
            driven.push((s, plan.path.first()?.d_m));
        }
        let i = driven.iter().position(|p| p.0 >= s_m).filter(|&i| i > 0)?;
        let (a, b) = (driven[i - 1], driven[i]);
        Some(a.1 + (b.1 - a.1) * (s_m - a.0) / (b.0 - a.0))
    })
}

#[test]
fn a_lane_change_at_72_km_h_with_55_t_keeps_to_its_path() {
    let road = builtin::flat(5_000.0);
    let e = one_change(&road, Misfit { mass_factor: 1.0, stiffness_factor: 1.0 });
    assert!(e.tractor_m < 0.10, "tractor {}", e.tractor_m);
    assert!(e.trailer_m < 0.20, "trailer {}", e.trailer_m);
    assert!(e.lateral_accel_m_s2 < 0.9, "{} m/s2", e.lateral_accel_m_s2);
    assert!((6.0..10.0).contains(&e.duration_s), "{} s", e.duration_s);
}

#[test]
fn it_still_does_when_stiffness_and_mass_are_wrong_by_a_fifth() {
    let road = builtin::flat(5_000.0);
    for (mass_factor, stiffness_factor) in [(1.2, 0.8), (1.2, 1.2), (0.8, 0.8), (0.8, 1.2)] {
        let e = one_change(&road, Misfit { mass_factor, stiffness_factor });
        assert!(
            e.tractor_m < 0.15,
            "mass {mass_factor} stiffness {stiffness_factor}: {}",
            e.tractor_m
        );
        assert!(
            e.trailer_m < 0.20,
            "mass {mass_factor} stiffness {stiffness_factor}: {}",
            e.trailer_m
        );
    }
}

/// The first plan that has a reason for a lane change, behind a slow truck or on an empty road.
fn first_reasoned(decider: DeciderKind, wish: LaneChoice, slow: bool) -> tractrix_core::Plan {
    let road = builtin::flat(3000.0);
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(&road, reference_limits(), 200.0, d, 20.0);
    let config = StackConfig { decider, ..StackConfig::default() };
    let mut stack = Stack::new(config, &reference_limits()).unwrap();
    stack.request_lane_change(wish);
    let truck = Neighbour {
        id: 7,
        front_s_m: 266.0,
        rear_s_m: 250.0,
        d_m: d,
        width_m: 2.5,
        speed_m_s: 15.0,
        ..Neighbour::default()
    };
    for i in 0..300 {
        let ego = plant.ego(tick(i)).unwrap();
        let neighbours = if slow { vec![truck] } else { Vec::new() };
        let scene = Scene { time: tick(i), neighbours };
        let plan = stack.tick(
            tick(i),
            &ego,
            &VehicleStatus::default(),
            &scene,
            &road,
            &reference_limits(),
        );
        if plan.reason.is_some() {
            return plan.clone();
        }
        let command = plan.command;
        plant.command(tick(i), &command).unwrap();
    }
    panic!("no change was wished");
}

#[test]
fn a_change_says_why_it_is_wished_and_a_refused_one_too() {
    let rules = DeciderKind::Rules { distance_m: 100.0 };
    let overtakes = first_reasoned(rules, LaneChoice::Keep, true);
    assert_eq!(overtakes.reason, Some(LaneChangeReason::SlowerAhead));
    let asked = first_reasoned(DeciderKind::External, LaneChoice::Left, false);
    assert_eq!(asked.reason, Some(LaneChangeReason::Requested));
    assert_eq!((asked.maneuver, asked.refusal), (Maneuver::ChangeLeft, None));
    let refused = first_reasoned(DeciderKind::External, LaneChoice::Right, false);
    assert_eq!(refused.reason, Some(LaneChangeReason::Requested));
    assert_eq!(refused.refusal, Some(LaneChangeRefusal::NoTargetLane));
}
