//! What the stack sends when its inputs are wrong: a safe command, always, and the reason with it.

use crate::support::data_sheet::reference_limits;
use crate::support::{Plant, no_traffic};
use planner::{DriveError, Stack, StackConfig, drive_tick};
use proptest::prelude::*;
use road::{Road, builtin};
use tractrix_core::{
    BrakeMode, Command, EgoState, GuardReason, Maneuver, Neighbour, SafetySignal, Scene, Stamped,
    Time, TrafficSource, Vehicle, VehicleFault, VehicleLimits, VehicleStatus,
};

fn tick(i: i64) -> Time {
    Time(i * 10_000_000)
}

/// Drives 5 s in order, then `seconds` with `spoil` applied to what the stack is told.
fn spoilt(
    seconds: f64,
    mut spoil: impl FnMut(i64, &mut Stamped<EgoState>, &mut Scene, &mut VehicleStatus),
    mut look: impl FnMut(f64, &Stack, &EgoState),
) {
    let road = builtin::flat(5_000.0);
    let limits = reference_limits();
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(&road, limits.clone(), 200.0, d, 20.0);
    let mut stack = Stack::new(StackConfig::default(), &limits).unwrap();
    let last = 500 + (seconds * 100.0) as i64;
    for i in 0..last {
        let now = tick(i);
        let mut ego = plant.ego(now).unwrap();
        let mut scene = Scene { time: now, neighbours: Vec::new() };
        let mut status = VehicleStatus::default();
        if i >= 500 {
            spoil(i, &mut ego, &mut scene, &mut status);
        }
        let command = stack.tick(now, &ego, &status, &scene, &road, &limits).command;
        command.check_finite().unwrap();
        plant.command(now, &command).unwrap();
        if i < 500 {
            assert!(stack.plan().guard.is_empty(), "{:?}", stack.plan().guard);
        } else {
            look((i - 500) as f64 * 0.01, &stack, &plant.ego);
        }
    }
}

fn brakes_in_lane(reason: GuardReason) -> impl FnMut(f64, &Stack, &EgoState) {
    move |time_s, stack, truth| {
        let plan = stack.plan();
        assert_eq!(plan.command.accelerator_pedal_frac, 0.0, "at {time_s}");
        assert_eq!(plan.maneuver, Maneuver::MinimalRisk);
        assert!(plan.guard.contains(&reason), "{:?} at {time_s}", plan.guard);
        assert!(plan.command.xbr_decel_m_s2 <= 2.5 + 1e-9);
        assert!(time_s < 2.0 || plan.command.brake_mode == BrakeMode::Maximum);
        let road = builtin::flat(5_000.0);
        let off = truth.d_m - road.lanes()[0].center_d_m(0.0);
        assert!(off.abs() < 0.5, "{off} m off the centre at {time_s}");
    }
}

#[test]
fn a_state_that_is_not_a_number_brings_the_truck_to_rest_in_its_lane() {
    let mut at_end = 99.0;
    let mut check = brakes_in_lane(GuardReason::NonFinite);
    spoilt(
        14.0,
        |_, ego, _, _| ego.value.yaw_rate_rad_s = f64::NAN,
        |t, stack, truth| {
            check(t, stack, truth);
            at_end = truth.speed_m_s;
        },
    );
    assert!(at_end < 0.1, "{at_end} m/s");
}

#[test]
fn a_state_that_is_no_longer_renewed_is_stale() {
    let mut kept: Option<Stamped<EgoState>> = None;
    let mut check = brakes_in_lane(GuardReason::Stale);
    spoilt(
        3.0,
        move |_, ego, _, _| *ego = *kept.get_or_insert(*ego),
        |t, stack, truth| {
            if t > 0.2 {
                check(t, stack, truth);
            }
        },
    );
}

#[test]
fn a_state_that_is_renewed_in_its_stamp_alone_is_frozen() {
    let mut kept: Option<EgoState> = None;
    let mut check = brakes_in_lane(GuardReason::Frozen);
    spoilt(
        3.0,
        move |_, ego, _, _| ego.value = *kept.get_or_insert(ego.value),
        |t, stack, truth| {
            if t > 0.35 {
                check(t, stack, truth);
            }
        },
    );
}

#[test]
fn a_jump_is_answered_by_braking_and_forgotten_once_the_position_is_steady_again() {
    let mut seen = false;
    spoilt(
        3.0,
        |_, ego, _, _| ego.value.s_m += 40.0,
        |t, stack, _| {
            let plan = stack.plan();
            seen |= plan.guard.contains(&GuardReason::Jump);
            let recovering = t < 0.5;
            assert_eq!(plan.maneuver == Maneuver::MinimalRisk, recovering, "at {t}");
        },
    );
    assert!(seen);
}

#[test]
fn without_a_fresh_scene_the_truck_brakes_but_goes_on_steering() {
    let mut check = brakes_in_lane(GuardReason::Stale);
    spoilt(
        3.0,
        |_, _, scene, _| scene.time = tick(500),
        |t, stack, truth| {
            if t > 0.55 {
                check(t, stack, truth);
                assert!(stack.plan().lateral_error_m.abs() < 0.05);
            }
        },
    );
}

#[test]
fn with_a_silent_engine_the_truck_stops_and_is_steered_as_before() {
    let mut at_end = 99.0;
    let mut check = brakes_in_lane(GuardReason::Bus);
    spoilt(
        14.0,
        |_, _, _, status| {
            status.raise(VehicleFault::SignalLost, tick(500));
            status.set_age_s(SafetySignal::Engine, f64::INFINITY);
        },
        |t, stack, truth| {
            check(t, stack, truth);
            assert_eq!(stack.plan().guard, [GuardReason::Bus], "steering is in order");
            assert!(stack.plan().lateral_error_m.abs() < 0.05);
            at_end = truth.speed_m_s;
        },
    );
    assert!(at_end < 0.1, "{at_end} m/s");
}

#[test]
fn an_old_signal_that_steers_makes_the_state_stale() {
    let mut check = brakes_in_lane(GuardReason::Stale);
    spoilt(
        2.0,
        |i, _, _, status| {
            let age_s = (i - 500) as f64 * 0.01;
            status.set_age_s(SafetySignal::SteeringAngle, age_s);
            status.set_age_s(SafetySignal::Pedals, 10.0 * age_s);
        },
        |t, stack, truth| {
            if t > 0.155 {
                check(t, stack, truth);
            } else {
                assert!(stack.plan().guard.is_empty(), "at {t}");
            }
        },
    );
}

#[test]
fn an_intruder_is_answered_in_the_same_tick_and_the_truck_goes_on_when_he_has_gone() {
    spoilt(
        2.0,
        |i, _, _, status| {
            if i < 550 {
                status.raise(VehicleFault::Spoofed, tick(i));
                status.raise(VehicleFault::Flooded, tick(i));
            }
        },
        |t, stack, _| {
            let (now, plan) = ((100.0 * t).round() as i64, stack.plan());
            let wrong = [GuardReason::Bus, GuardReason::Intruder];
            assert_eq!(plan.guard, if now < 50 { &wrong[..] } else { &[] }, "at {t}");
            assert_eq!(plan.maneuver == Maneuver::MinimalRisk, now < 99, "at {t}");
        },
    );
}

#[test]
fn nothing_is_asked_of_a_truck_that_the_driver_has_taken() {
    spoilt(
        3.0,
        |i, ego, _, status| {
            if i < 600 {
                status.raise(VehicleFault::DriverOverride, tick(500));
                ego.value.steering_wheel_rad = 0.02;
            }
            if i < 550 {
                status.raise(VehicleFault::SignalLost, tick(500));
            }
        },
        |t, stack, _| {
            let plan = stack.plan();
            assert_ne!(plan.maneuver, Maneuver::MinimalRisk, "at {t}");
            if t < 0.995 {
                let held = Command { steering_wheel_rad: 0.02, ..Command::default() };
                assert_eq!(plan.command, held, "at {t}");
                assert!(plan.guard.contains(&GuardReason::Driver));
            } else {
                assert!(plan.guard.is_empty(), "{:?} at {t}", plan.guard);
            }
        },
    );
}

#[derive(Debug, thiserror::Error)]
#[error("unplugged")]
struct Unplugged;

/// A truck whose state cannot be read any more, and that keeps its last command.
struct Deaf(Command, VehicleLimits);

impl Vehicle for Deaf {
    type Error = Unplugged;
    fn ego(&mut self, _: Time) -> Result<Stamped<EgoState>, Unplugged> {
        Err(Unplugged)
    }
    fn command(&mut self, _: Time, command: &Command) -> Result<(), Unplugged> {
        self.0 = *command;
        Ok(())
    }
    fn limits(&self) -> &VehicleLimits {
        &self.1
    }
}

struct Gone;

impl TrafficSource for Gone {
    type Error = Unplugged;
    fn advance(&mut self, _: Time, _: &EgoState) -> Result<&Scene, Unplugged> {
        Err(Unplugged)
    }
}

#[test]
fn a_failed_seam_is_reported_after_a_braking_command_has_been_sent() {
    let road = builtin::flat(2_000.0);
    let limits = reference_limits();
    let mut stack = Stack::new(StackConfig::default(), &limits).unwrap();
    let mut deaf = Deaf(Command { accelerator_pedal_frac: 0.7, ..Command::default() }, limits);
    let mut traffic = no_traffic();
    for i in 0..50 {
        let out = drive_tick(tick(i), &mut deaf, &mut traffic, &mut stack, &road, &mut ());
        assert!(matches!(out, Err(DriveError::Ego(_))));
        assert_eq!(deaf.0.accelerator_pedal_frac, 0.0);
        assert!(deaf.0.xbr_decel_m_s2 > 0.0);
    }
    let d = road.lanes()[0].center_d_m(0.0);
    let mut plant = Plant::new(&road, reference_limits(), 200.0, d, 20.0);
    let mut stack = Stack::new(StackConfig::default(), &reference_limits()).unwrap();
    for i in 0..50 {
        let out = drive_tick(tick(i), &mut plant, &mut Gone, &mut stack, &road, &mut ());
        assert!(matches!(out, Err(DriveError::Traffic(_))));
        assert!(plant.command.xbr_decel_m_s2 > 0.0);
        assert_eq!(plant.command.accelerator_pedal_frac, 0.0);
    }
}

/// A road whose only lane ends at 300 m: beyond it there is no plan.
#[test]
fn where_there_is_no_lane_there_is_no_plan_and_the_truck_stops() {
    let flat = builtin::flat(2_000.0);
    let mut lane = flat.lanes()[0].clone();
    lane.s_end_m = 300.0;
    let limits = vec![(0.0, 25.0)];
    let road = Road::new("short", flat.line().clone(), vec![lane.clone()], limits).unwrap();
    let sheet = reference_limits();
    let mut plant = Plant::new(&road, sheet.clone(), 400.0, lane.center_d_m(0.0), 15.0);
    let mut stack = Stack::new(StackConfig::default(), &sheet).unwrap();
    let mut traffic = no_traffic();
    for i in 0..1500 {
        drive_tick(tick(i), &mut plant, &mut traffic, &mut stack, &road, &mut ()).unwrap();
        assert!(stack.plan().guard.contains(&GuardReason::NoPlan));
    }
    assert!(plant.ego.speed_m_s < 0.1, "{}", plant.ego.speed_m_s);
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -60.0..60.0,
        1 => prop::num::f64::ANY,
        1 => Just(f64::NAN),
        1 => Just(1e300),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn whatever_comes_in_the_command_is_finite_and_in_range(
        numbers in prop::collection::vec(any_number(), 24),
        stamps in prop::collection::vec(-2_000_000_000_i64..2_000_000_000, 2),
        faults in prop::collection::vec(prop::sample::select(&VehicleFault::ALL), 0..3),
        age_s in any_number(),
    ) {
        let mut status = VehicleStatus::default();
        for fault in faults {
            status.raise(fault, Time(stamps[0]));
        }
        status.set_age_s(SafetySignal::YawRate, age_s);
        let road = builtin::highway();
        let limits = reference_limits();
        let mut stack = Stack::new(StackConfig::default(), &limits).unwrap();
        for (i, n) in numbers.chunks_exact(8).enumerate() {
            let now = tick(i as i64);
            let ego = EgoState {
                s_m: n[0] * 100.0,
                d_m: n[1],
                speed_m_s: n[2],
                yaw_rad: n[3],
                yaw_rate_rad_s: 0.1 * n[4],
                lateral_speed_m_s: n[5],
                ..EgoState::default()
            };
            let ego = Stamped { time: Time(now.0 + stamps[0] / 4), value: ego };
            let neighbour = Neighbour {
                front_s_m: n[6] + 5.0,
                rear_s_m: n[6],
                d_m: n[1],
                speed_m_s: n[7],
                accel_m_s2: n[3],
                width_m: 2.0,
                ..Neighbour::default()
            };
            let scene = Scene {
                time: Time(now.0 + stamps[1] / 4),
                neighbours: vec![neighbour],
            };
            let c = stack.tick(now, &ego, &status, &scene, &road, &limits).command;
            prop_assert!(c.check_finite().is_ok());
            prop_assert!((0.0..=1.0).contains(&c.accelerator_pedal_frac));
            prop_assert!((0.0..=1.0).contains(&c.retarder_frac));
            prop_assert!((0.0..=12.5).contains(&c.xbr_decel_m_s2));
            prop_assert!(c.steering_wheel_rad.abs() <= 0.7 * 24.0 + 1e-9);
        }
    }
}
