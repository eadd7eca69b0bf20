//! Who drives, decides and sees may change while a run goes on: another decider, another source of
//! the reference speed, somebody else at the wheel, a localisation or perception that stands still.

use planner::{DeciderKind, OutsideDemand, SpeedPlannerKind};
use sim::{Fault, MemoryRecorder, Scenario, StackChange, World};
use tractrix_core::{GuardReason, Maneuver};
use traffic_client::schedule::{Incident, IncidentKind};

fn flat() -> Scenario {
    let mut scenario = Scenario::builtin("flat").unwrap();
    scenario.run.duration_s = 120.0;
    scenario.run.ghost = false;
    scenario
}

fn ticks(world: &mut World, count: u32) {
    for _ in 0..count {
        world.tick(&mut ()).unwrap();
    }
}

fn speed_m_s(world: &World) -> f64 {
    world.truck().state().speed_m_s
}

/// Before the first tick a change is the same as a scenario that begins so.
#[test]
fn a_change_before_the_first_tick_is_a_scenario_that_begins_so() {
    let mut wanted = Scenario::builtin("medium-15").unwrap();
    wanted.run.duration_s = 60.0;
    let mut begun = wanted.clone();
    wanted.stack.speed_planner = SpeedPlannerKind::Predictive;
    for word in ["mobil", "rules:50", "rollout", "dqn"] {
        let decider = StackChange::decider(word).unwrap();
        let StackChange::Decider { kind, policy_file } = decider.clone() else { unreachable!() };
        (wanted.stack.decider, wanted.policy_file) = (kind, policy_file);
        begun.stack.decider = DeciderKind::KeepLane;
        let mut changed = World::new(&begun, 5).unwrap();
        changed.change(&decider).unwrap();
        let planner = StackChange::SpeedPlanner { kind: SpeedPlannerKind::Predictive };
        changed.change(&planner).unwrap();
        assert_eq!(changed.scenario_now().stack.decider, wanted.stack.decider);
        assert_eq!(changed.scenario_now().policy_file, wanted.policy_file, "{word}");
        let alone = World::new(&wanted, 5).unwrap().run(&mut ()).unwrap();
        assert_eq!(changed.run(&mut ()).unwrap().state_hash, alone.state_hash, "{word}");
    }
}

/// A decider that is changed under way decides from there on.
#[test]
fn a_truck_that_keeps_its_lane_overtakes_once_it_may() {
    let mut scenario = Scenario::builtin("medium-15").unwrap();
    scenario.stack.decider = DeciderKind::KeepLane;
    scenario.run.duration_s = 240.0;
    let mut world = World::new(&scenario, 2).unwrap();
    ticks(&mut world, 6_000);
    assert_eq!(world.summary().lane_changes, 0);
    world.change(&StackChange::decider("mobil").unwrap()).unwrap();
    let summary = world.run(&mut ()).unwrap();
    assert!(summary.lane_changes > 0 && summary.collisions == 0, "{summary:?}");
}

fn demand(world: &mut World, accel_m_s2: f64, road_wheel_rad: f64) {
    let time = world.now();
    let demand = Some(OutsideDemand { time, accel_m_s2, road_wheel_rad });
    world.change(&StackChange::Outside { demand }).unwrap();
}

#[test]
fn a_demand_from_outside_is_driven_and_one_that_grows_old_stops_the_truck_in_its_lane() {
    let mut world = World::new(&flat(), 1).unwrap();
    ticks(&mut world, 500);
    let before = speed_m_s(&world);
    // 50 Hz, 1 m/s² down for four seconds
    for _ in 0..200 {
        demand(&mut world, -1.0, 0.0);
        ticks(&mut world, 2);
    }
    let lost = before - speed_m_s(&world);
    assert!((3.4..4.6).contains(&lost), "{lost} m/s in 4 s");
    assert_eq!(world.stack().plan().maneuver, Maneuver::KeepLane);
    // To the left, and straight again
    let d_m = world.truck().state().d_m;
    for k in 0..100 {
        let wheel_rad = if k < 40 {
            0.004
        } else if k < 80 {
            -0.004
        } else {
            0.0
        };
        demand(&mut world, 0.0, wheel_rad);
        ticks(&mut world, 2);
    }
    let moved = world.truck().state().d_m - d_m;
    assert!((0.05..1.5).contains(&moved), "{moved} m to the left");
    // Nobody says anything more: 0.2 s later the truck begins to stop
    ticks(&mut world, 18);
    assert_eq!(world.stack().plan().maneuver, Maneuver::KeepLane);
    ticks(&mut world, 3);
    assert_eq!(world.stack().plan().maneuver, Maneuver::MinimalRisk);
    assert_eq!(world.stack().plan().guard, [GuardReason::Stale]);
    ticks(&mut world, 1_500);
    assert!(speed_m_s(&world) < 0.05, "{} m/s", speed_m_s(&world));
    let off_m = (world.truck().state().d_m - d_m).abs();
    assert!(off_m < 0.5, "it stands {off_m} m beside its lane's middle");
    // The truck is the stack's again
    world.change(&StackChange::Outside { demand: None }).unwrap();
    ticks(&mut world, 3_000);
    assert!(speed_m_s(&world) > 10.0, "{} m/s", speed_m_s(&world));
    assert_eq!(world.summary().off_road_events, 0);
}

/// The guard alone stood before demands from outside once, and it looked into the lane that the
/// stack drives in: none. It is the last resort and touches at 8 m/s; car following keeps a distance.
#[test]
fn who_drives_from_outside_towards_a_stopped_vehicle_is_stopped() {
    for speed_m_s in [8.0, 14.0, 20.0, 24.0] {
        let mut scenario = Scenario::builtin("medium-15").unwrap();
        scenario.run.duration_s = 90.0;
        scenario.ego.speed_m_s = speed_m_s;
        scenario.traffic.family = None;
        scenario.traffic.native.initial_density_1_km = Some(0.0);
        scenario.traffic.native.spawn_probability = 0.0;
        let kind = IncidentKind::StoppedVehicle;
        let (s_m, length_m, lane) = (600.0, 15.0, 0);
        scenario.traffic.incident =
            vec![Incident { kind, s_m, length_m, lane, from_s: 0.0, to_s: None }];
        let mut world = World::new(&scenario, 1).unwrap();
        for _ in 0..4_000 {
            demand(&mut world, 0.0, 0.0);
            ticks(&mut world, 2);
        }
        let truck = world.truck();
        assert!(truck.state().speed_m_s < 0.5, "{speed_m_s} m/s");
        assert_eq!(world.summary().collisions, 0, "{speed_m_s} m/s");
        let left_m = 600.0 - truck.state().s_m;
        assert!((3.0..60.0).contains(&left_m), "{speed_m_s} m/s: it stands {left_m} m before");
    }
}

/// What was never seen is not driven into: a localisation or perception that stands still ends in
/// the minimal-risk manoeuvre, is measured with the truth, and goes on when it is mended.
#[test]
fn a_localisation_or_perception_that_stands_still_stops_the_truck_until_it_is_mended() {
    for fault in [Fault::Localisation, Fault::Perception] {
        let mut world = World::new(&flat(), 1).unwrap();
        let mut memory = MemoryRecorder::every(1);
        for _ in 0..500 {
            world.tick(&mut memory).unwrap();
        }
        let before = world.summary().distance_m;
        world.set_fault(fault, true).unwrap();
        assert_eq!(world.faults().collect::<Vec<_>>(), [fault]);
        for _ in 0..800 {
            world.tick(&mut memory).unwrap();
        }
        assert_eq!(world.stack().plan().maneuver, Maneuver::MinimalRisk, "{fault:?}");
        assert!(speed_m_s(&world) < 8.0, "{fault:?}: {} m/s", speed_m_s(&world));
        let driven = world.summary().distance_m - before;
        assert!((40.0..200.0).contains(&driven), "{fault:?}: {driven} m are measured");
        world.set_fault(fault, false).unwrap();
        ticks(&mut world, 3_000);
        assert_eq!(world.stack().plan().maneuver, Maneuver::KeepLane, "{fault:?}");
        assert!(speed_m_s(&world) > 10.0, "{fault:?}: {} m/s", speed_m_s(&world));
        assert_eq!(world.summary().off_road_events, 0, "{fault:?}");
    }
    let refused = World::new(&flat(), 1).unwrap().set_fault(Fault::WheelSpeeds, true);
    assert!(refused.unwrap_err().to_string().contains("--vehicle bus"));
}
