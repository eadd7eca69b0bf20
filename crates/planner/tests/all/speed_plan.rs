//! The receding-horizon speed planner: plans, fences behind a vehicle ahead, and what the stack does
//! when there is no plan.

use crate::support::data_sheet::reference_limits;
use crate::support::{Plant, Scripted, no_traffic};
use planner::pcc::horizon::{
    HorizonConfig, HorizonFailure, HorizonPlanner, HorizonRequest, LeadAhead,
};
use planner::pcc::{SpeedBand, TripRequest, Tuning, plan_trip};
use planner::{SpeedPlannerKind, Stack, StackConfig, drive_tick};
use proptest::prelude::*;
use road::{ProfilePoint, builtin};
use tractrix_core::{
    EgoState, GearRequest, Neighbour, PlanStatus, Scene, Stamped, Time, VehicleClass,
    VehicleLimits, VehicleStatus,
};

/// Sinusoidal hills: slope amplitude, wave length in m, phase in rad.
fn hills(length_m: f64, amplitude: f64, wave_m: f64, phase: f64) -> Vec<ProfilePoint> {
    let n = (length_m / 12.5) as usize;
    (0..=n)
        .map(|i| {
            let s_m = 12.5 * i as f64;
            let slope = amplitude * (core::f64::consts::TAU * s_m / wave_m + phase).sin();
            ProfilePoint {
                s_m,
                grade_rad: slope.atan(),
                speed_limit_m_s: 25.0,
                ..ProfilePoint::default()
            }
        })
        .collect()
}

fn request<'a>(profile: &'a [ProfilePoint], limits: &'a VehicleLimits) -> HorizonRequest<'a> {
    HorizonRequest {
        profile,
        limits,
        now_s: 0.0,
        speed_m_s: 20.0,
        gear: 12,
        set_speed_m_s: 20.0,
        lead: None,
        held_up: false,
    }
}

#[test]
fn on_a_flat_road_the_plan_holds_the_set_speed_and_the_top_gear() {
    let (road, limits) = (hills(4_000.0, 0.0, 1e3, 0.0), reference_limits());
    let mut planner = HorizonPlanner::new(HorizonConfig::default(), Tuning::default());
    let plan = planner.plan(&request(&road, &limits)).unwrap();
    for k in 0..plan.driven.drive.len() {
        assert!((plan.driven.v_m_s(k) - 20.0).abs() < 0.15, "{} at node {k}", plan.driven.v_m_s(k));
        assert_eq!(plan.driven.drive[k].number(), 12);
    }
}

#[test]
fn before_a_descent_the_plan_gives_up_speed_that_the_descent_returns() {
    let limits = reference_limits();
    // level, then 3 % down from 1 km on
    let mut road = hills(4_000.0, 0.0, 1e3, 0.0);
    for p in road.iter_mut().filter(|p| (1_000.0..1_800.0).contains(&p.s_m)) {
        p.grade_rad = -0.03;
    }
    let mut planner = HorizonPlanner::new(HorizonConfig::default(), Tuning::default());
    let plan = planner.plan(&request(&road, &limits)).unwrap();
    let v = |s_m: f64| plan.at(s_m).unwrap().speed_m_s;
    assert!(v(1_000.0) < 19.0, "{} at the edge", v(1_000.0));
    assert!(v(1_800.0) > 21.0, "{} at the foot", v(1_800.0));
    assert!(plan.driven.v_m_s(40) < 22.2 + 1e-6);
}

#[test]
fn eco_roll_opens_the_driveline_where_that_pays_and_never_where_the_truck_brakes() {
    // 19 t: the engine's drag weighs more than with 55 t
    let mut limits = reference_limits();
    limits.road_load.mass_kg = 19_000.0;
    let road = hills(10_000.0, 0.02, 2_000.0, 0.0);
    let plan = |eco_roll: bool| {
        let band = SpeedBand { set_m_s: 20.0, min_m_s: 17.0, max_m_s: 23.0 };
        let tuning = Tuning::default();
        let (profile, truck) = (&road[..], &limits);
        plan_trip(&TripRequest { profile, truck, band, trip_time_s: None, eco_roll, tuning })
            .unwrap()
    };
    let (closed, open) = (plan(false), plan(true));
    assert!(closed.rows.iter().all(|r| r.gear != 0));
    let (without, with) = (closed.plan.fuel_g, open.plan.fuel_g);
    assert!(with < 0.999 * without, "{with:.1} g against {without:.1} g");
    assert!(open.plan.trip_time_s < closed.plan.trip_time_s * 1.002);
    let (mut phase_m, mut phases) = (0.0, Vec::new());
    for w in open.rows.windows(2) {
        if w[0].gear == 0 {
            assert!(w[0].brake_force_n < 50.0, "{:?}", w[0]);
            phase_m += w[1].s_m - w[0].s_m;
        } else if phase_m > 0.0 {
            phases.push(phase_m);
            phase_m = 0.0;
        }
    }
    assert!(!phases.is_empty());
    assert!(phases.iter().all(|&m| m > 199.0), "{phases:?}");
}

#[test]
fn the_horizon_opens_the_driveline_only_if_it_may() {
    let mut limits = reference_limits();
    limits.road_load.mass_kg = 19_000.0;
    let road = hills(4_000.0, 0.015, 2_000.0, 0.0);
    for eco_roll in [false, true] {
        let config = HorizonConfig { eco_roll, ..HorizonConfig::default() };
        let mut planner = HorizonPlanner::new(config, Tuning::default());
        let plan = planner.plan(&request(&road, &limits)).unwrap();
        let open = plan.driven.drive.iter().filter(|d| d.number() == 0).count();
        assert_eq!(open >= 8, eco_roll, "{open} intervals open");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// The safe side of the linearised fence: however few iterations, the true drive keeps the gap.
    #[test]
    fn however_early_the_iteration_stops_the_gap_to_the_vehicle_ahead_is_kept(
        amplitude in 0.0_f64..0.03,
        wave_m in 600.0_f64..2_500.0,
        phase in 0.0_f64..6.0,
        lead_m_s in 12.0_f64..19.5,
        spare_m in 0.0_f64..150.0,
        sqp_iterations in 1_u32..4,
    ) {
        let (road, limits) = (hills(4_000.0, amplitude, wave_m, phase), reference_limits());
        let config = HorizonConfig { sqp_iterations, ..HorizonConfig::default() };
        let mut planner = HorizonPlanner::new(config, Tuning::default());
        let wanted_gap_m = 60.0;
        // Far enough that 0.4 m/s² slow the truck down in time.
        let closing = 20.0 - lead_m_s;
        let gap_m = wanted_gap_m + closing * closing / 0.8 + 5.0 + spare_m;
        let lead = LeadAhead { id: 1, gap_m, speed_m_s: lead_m_s, wanted_gap_m };
        let asked = HorizonRequest { lead: Some(lead), ..request(&road, &limits) };
        let plan = planner.plan(&asked).unwrap();
        for (k, &t) in plan.driven.time_s.iter().enumerate() {
            let earliest = (k as f64 * plan.h_m + wanted_gap_m - gap_m) / lead_m_s;
            if earliest <= config.lead_s {
                let gap = gap_m + lead_m_s * t - k as f64 * plan.h_m;
                prop_assert!(gap >= wanted_gap_m - 0.1, "gap {gap} at node {k}, {plan:?}");
            }
        }
    }
}

#[test]
fn a_vehicle_that_cuts_in_too_close_is_given_room_gently() {
    let (road, limits) = (hills(4_000.0, 0.0, 1e3, 0.0), reference_limits());
    let mut planner = HorizonPlanner::new(HorizonConfig::default(), Tuning::default());
    let lead = LeadAhead { id: 1, gap_m: 25.0, speed_m_s: 19.0, wanted_gap_m: 60.0 };
    let plan = planner.plan(&HorizonRequest { lead: Some(lead), ..request(&road, &limits) });
    let plan = plan.unwrap();
    assert!(plan.fenced);
    let hardest = plan.driven.brake_m_s2.iter().fold(0.0_f64, |a, &b| a.max(b));
    assert!(hardest < 0.8, "{hardest} m/s2");
    let (k, t) = (40, plan.driven.time_s[40]);
    assert!(25.0 + 19.0 * t - k as f64 * plan.h_m > 30.0, "the gap does not open");
}

#[test]
fn a_used_up_iteration_budget_and_an_unusable_truck_are_failures_that_keep_the_last_plan() {
    let (road, limits) = (hills(4_000.0, 0.02, 1e3, 0.0), reference_limits());
    let config = HorizonConfig { iteration_budget: 10, ..HorizonConfig::default() };
    let mut planner = HorizonPlanner::new(config, Tuning::default());
    let failure = planner.plan(&request(&road, &limits)).unwrap_err();
    assert!(matches!(failure, HorizonFailure::Solver { .. }), "{failure}");

    let mut planner = HorizonPlanner::new(HorizonConfig::default(), Tuning::default());
    planner.plan(&request(&road, &limits)).unwrap();
    let mut broken = reference_limits();
    broken.powertrain.gear_efficiency_frac.pop();
    let failure = planner.plan(&request(&road, &broken)).unwrap_err();
    assert!(failure.to_string().contains("gear_efficiency_frac"), "{failure}");
    assert!(planner.last().is_some());
    let failure = planner.plan(&request(&road[..3], &limits)).unwrap_err();
    assert!(failure.to_string().contains("25 m of road"), "{failure}");
    let slow = HorizonRequest { speed_m_s: 2.0, ..request(&road, &limits) };
    assert!(planner.plan(&slow).unwrap_err().to_string().contains("2.0 m/s"));
}

fn tick(i: i64) -> Time {
    Time(i * 10_000_000)
}

fn predictive() -> StackConfig {
    StackConfig { speed_planner: SpeedPlannerKind::Predictive, ..StackConfig::default() }
}

/// Commands that cannot hurt: nothing guarded, nobody brakes hard.
fn is_calm(stack: &Stack) {
    let plan = stack.plan();
    assert!(plan.guard.is_empty(), "{:?}", plan.guard);
    assert!(plan.command.check_finite().is_ok());
    assert!(plan.command.xbr_decel_m_s2 < 1.0, "{:?}", plan.command);
}

#[test]
fn a_solver_that_hits_its_iteration_limit_leaves_cruise_control_in_charge() {
    let road = builtin::flat(5_000.0);
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(&road, reference_limits(), 100.0, d, 18.0);
    let mut config = predictive();
    config.speed_plan.iteration_budget = 1;
    let mut stack = Stack::new(config, &reference_limits()).unwrap();
    let mut traffic = no_traffic();
    for i in 0..6_000 {
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        is_calm(&stack);
        assert_eq!(stack.plan().speed_status, PlanStatus::Fallback);
    }
    assert!(matches!(stack.speed_plan_failure(), Some(HorizonFailure::Solver { .. })));
    assert!((plant.ego.speed_m_s - 20.0).abs() < 0.05, "{}", plant.ego.speed_m_s);
}

#[test]
fn when_planning_breaks_down_the_last_profile_is_driven_to_its_end_and_cruise_goes_on() {
    let road = builtin::flat(12_000.0);
    let d = road.lanes()[0].center_d_m(0.0);
    let limits = reference_limits();
    let mut plant = Plant::new(&road, limits.clone(), 100.0, d, 20.0);
    let mut config = predictive();
    config.speed_plan.length_m = 1_000.0;
    let mut stack = Stack::new(config, &limits).unwrap();
    // From 10 s on the truck reports a table of another length: the planner refuses it.
    let mut broken = limits.clone();
    broken.powertrain.rotating_mass_kg.pop();
    let mut seen = Vec::new();
    for i in 0..9_000 {
        let now = tick(i);
        let ego = Stamped {
            time: now,
            value: tractrix_core::Vehicle::ego(&mut plant, now).unwrap().value,
        };
        let told = if i < 1_000 { &limits } else { &broken };
        let scene = Scene { time: now, ..Scene::default() };
        let command = stack.tick(now, &ego, &VehicleStatus::default(), &scene, &road, told).command;
        tractrix_core::Vehicle::command(&mut plant, now, &command).unwrap();
        is_calm(&stack);
        let status = stack.plan().speed_status;
        if seen.last() != Some(&status) {
            seen.push(status);
        }
        assert!((plant.ego.speed_m_s - 20.0).abs() < 0.2, "{}", plant.ego.speed_m_s);
    }
    assert_eq!(seen, [PlanStatus::Solved, PlanStatus::LastProfile, PlanStatus::Fallback]);
}

#[test]
fn where_the_road_ends_ahead_there_is_no_plan_and_the_truck_drives_on() {
    let road = builtin::flat(1_000.0);
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(&road, reference_limits(), 880.0, d, 20.0);
    let mut stack = Stack::new(predictive(), &reference_limits()).unwrap();
    let mut traffic = no_traffic();
    for i in 0..400 {
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        assert_eq!(stack.plan().speed_status, PlanStatus::Fallback);
        assert!(stack.plan().command.check_finite().is_ok());
    }
    assert!(matches!(stack.speed_plan_failure(), Some(HorizonFailure::RoadEnds { .. })));
}

#[test]
fn a_slow_car_is_approached_without_braking_hard_and_followed_at_its_speed() {
    let road = builtin::flat(9_000.0);
    let lane = road.lanes()[0].clone();
    let limits = reference_limits();
    let mut plant = Plant::new(&road, limits.clone(), 100.0, lane.center_d_m(0.0), 20.0);
    let mut stack = Stack::new(predictive(), &limits).unwrap();
    let car = |rear_s_m: f64| Neighbour {
        id: 7,
        class: VehicleClass::Car,
        front_s_m: rear_s_m + 4.5,
        rear_s_m,
        d_m: lane.center_d_m(rear_s_m),
        width_m: 1.8,
        speed_m_s: 15.0,
        ..Neighbour::default()
    };
    let mut traffic = Scripted(
        |now: Time, _: &EgoState| Scene {
            neighbours: vec![car(450.0 + 15.0 * now.seconds())],
            ..Scene::default()
        },
        Scene::default(),
    );
    let (mut hardest, mut fenced) = (0.0_f64, false);
    for i in 0..12_000 {
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        is_calm(&stack);
        hardest = hardest.max(-plant.ego.accel_x_m_s2);
        fenced |= stack.speed_plan().is_some_and(|plan| plan.fenced);
    }
    assert!(fenced && hardest < 0.3, "{hardest} m/s2");
    let gap_m = 450.0 + 15.0 * 120.0 - plant.ego.s_m - limits.geometry.front_m;
    assert!((plant.ego.speed_m_s - 15.0).abs() < 0.6, "{}", plant.ego.speed_m_s);
    assert!((45.0..200.0).contains(&gap_m), "{gap_m} m");
}

#[test]
fn gears_are_asked_for_and_each_is_kept_for_a_while() {
    let road = builtin::test_site();
    let d = road.lanes()[0].center_d_m(100.0);
    let mut plant = Plant::new(&road, reference_limits(), 100.0, d, 20.0);
    let mut stack = Stack::new(predictive(), &reference_limits()).unwrap();
    let mut traffic = no_traffic();
    let (mut last, mut since, mut asked) = (GearRequest::Automatic, 1_000, 0);
    for i in 0..20_000 {
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        let gear = stack.plan().command.gear;
        since += 1;
        if gear != last {
            let both = matches!((last, gear), (GearRequest::Gear(_), GearRequest::Gear(_)));
            assert!(!both || since > 390, "{last:?} to {gear:?} after {since} ticks at tick {i}");
            (last, since) = (gear, 0);
        }
        asked += u32::from(matches!(gear, GearRequest::Gear(_)));
    }
    assert!(asked > 10_000, "asked in {asked} of 20000 ticks");
}
