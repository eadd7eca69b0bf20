//! The stack drives the tests' own truck.
#![allow(clippy::unwrap_used)]

mod support;

use planner::{SpeedPlannerKind, SpeedProfile, Stack, StackConfig, drive_tick};
use road::builtin;
use support::data_sheet::reference_limits;
use support::{Plant, no_traffic};
use tractrix_core::{PlanStatus, SpeedPoint, Time};

fn tick(i: i64) -> Time {
    Time(i * 10_000_000)
}

#[test]
fn on_a_straight_flat_road_the_set_speed_is_held_and_the_lane_centre_kept() {
    let road = builtin::flat(5_000.0);
    let lane = &road.lanes()[0];
    let mut plant = Plant::new(&road, reference_limits(), 100.0, lane.center_d_m(0.0) + 0.4, 18.0);
    let mut stack = Stack::new(StackConfig::default(), &reference_limits()).unwrap();
    let mut traffic = no_traffic();
    for i in 0..9000 {
        let out =
            drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        assert!(!out.guarded, "guard at {i}: {:?}", stack.plan().guard);
    }
    assert!((plant.ego.speed_m_s - 20.0).abs() < 0.05, "{}", plant.ego.speed_m_s);
    assert!((plant.ego.d_m - lane.center_d_m(0.0)).abs() < 0.01, "{}", plant.ego.d_m);
}

#[test]
fn on_the_highway_the_loaded_truck_stays_within_its_lane_through_every_curve() {
    let road = builtin::highway();
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(&road, reference_limits(), 50.0, d, 20.0);
    let mut stack = Stack::new(StackConfig::default(), &reference_limits()).unwrap();
    let mut traffic = no_traffic();
    let mut worst: f64 = 0.0;
    let mut i = 0;
    while plant.ego.s_m < road.length_m() - 200.0 && i < 200_000 {
        let out =
            drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        assert!(!out.guarded, "guard at {i}: {:?} {:?}", stack.plan().guard, plant.ego);
        worst = worst.max(stack.plan().lateral_error_m.abs());
        i += 1;
    }
    assert!(plant.ego.s_m > road.length_m() - 200.0, "only came to {} m", plant.ego.s_m);
    assert!(worst < 0.10, "{worst} m");
}

#[test]
fn a_planned_profile_is_driven_and_where_it_ends_cruise_takes_over() {
    let road = builtin::flat(5_000.0);
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(&road, reference_limits(), 100.0, d, 19.0);
    let config =
        StackConfig { speed_planner: SpeedPlannerKind::Predictive, ..StackConfig::default() };
    let mut stack = Stack::new(config, &reference_limits()).unwrap();
    let planned = |s: f64| 19.0 + (s / 400.0).sin();
    let points = (0..=80)
        .map(|i| 25.0 * f64::from(i))
        .map(|s_m| SpeedPoint { s_m, speed_m_s: planned(s_m), accel_m_s2: 0.0 })
        .collect();
    stack.set_speed_profile(Some(SpeedProfile::new(points, PlanStatus::Solved).unwrap()));
    let mut traffic = no_traffic();
    for i in 0..15_000 {
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        let s = plant.ego.s_m;
        if (300.0..1_900.0).contains(&s) {
            assert_eq!(stack.plan().speed_status, PlanStatus::Solved);
            let error = plant.ego.speed_m_s - planned(s);
            assert!(error.abs() < 0.15, "{error} m/s at {s} m");
        }
    }
    assert_eq!(stack.plan().speed_status, PlanStatus::Fallback);
    assert!((plant.ego.speed_m_s - 20.0).abs() < 0.05);
}
