//! The stack drives the tests' own truck.

use crate::support::data_sheet::reference_limits;
use crate::support::{Plant, no_traffic};
use planner::pcc::{SpeedBand, TripRequest, Tuning, plan_trip};
use planner::{SpeedPlannerKind, SpeedProfile, Stack, StackConfig, drive_tick};
use road::builtin;
use tractrix_core::{PlanStatus, SpeedPoint, Time, VehicleLimits};

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

/// Two tables checked a truck's limits, one for the stack and one for the speed planner, and drew
/// eight ranges differently: a mass of 300 t or a wheel of 2.5 m was planned with and not driven.
#[test]
fn stack_and_speed_planner_refuse_the_same_limits_in_the_same_words() {
    let profile = [0.0, 500.0, 1000.0].map(|s_m| road::ProfilePoint {
        s_m,
        speed_limit_m_s: 25.0,
        ..road::ProfilePoint::default()
    });
    type Spoil = fn(&mut VehicleLimits);
    let spoils: [(&str, Spoil); 9] = [
        ("road_load.mass_kg = 300000", |l| l.road_load.mass_kg = 3e5),
        ("road_load.rolling_coeff = 0.15", |l| l.road_load.rolling_coeff = 0.15),
        ("powertrain.wheel_radius_m = 2.5", |l| l.powertrain.wheel_radius_m = 2.5),
        ("powertrain.idle_speed_rad_s = 600", |l| l.powertrain.idle_speed_rad_s = 600.0),
        ("powertrain.max_speed_rad_s = 70", |l| l.powertrain.max_speed_rad_s = 70.0),
        ("powertrain.gear_ratios[3] = 0.05", |l| l.powertrain.gear_ratios[3] = 0.05),
        ("powertrain.gear_efficiency_frac[0] = 0.2", |l| {
            l.powertrain.gear_efficiency_frac[0] = 0.2;
        }),
        ("brakes.max_decel_m_s2 = NaN", |l| l.brakes.max_decel_m_s2 = f64::NAN),
        ("1 to 32", |l| l.powertrain.rotating_mass_kg.truncate(3)),
    ];
    for (said, spoil) in spoils {
        let mut limits = reference_limits();
        spoil(&mut limits);
        let of_stack = Stack::new(StackConfig::default(), &limits).unwrap_err().to_string();
        let request = TripRequest {
            profile: &profile,
            truck: &limits,
            band: SpeedBand { set_m_s: 20.0, min_m_s: 18.0, max_m_s: 22.0 },
            trip_time_s: None,
            eco_roll: false,
            tuning: Tuning::default(),
        };
        let of_trip = plan_trip(&request).unwrap_err().to_string();
        assert_eq!(of_stack, of_trip);
        assert!(of_stack.starts_with("vehicle limits: ") && of_stack.contains(said), "{of_stack}");
    }
}
