//! The main job without its server: 15 km, 55 t, closed loop on the built-in highway.

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use road::Road;
use sim::{MemoryRecorder, Scenario, Status, World};

fn world(name: &str, seed: u64) -> World {
    World::new(&Scenario::builtin(name).unwrap(), seed).unwrap()
}

#[test]
fn the_default_run_reaches_the_end_of_the_road_in_its_lane_without_touching_anyone() {
    let mut world = world("highway", 1);
    let summary = world.run(&mut ()).unwrap();
    assert_eq!(world.status(), Status::RoadEnd);
    assert!(summary.distance_m > 14_900.0, "{summary:#?}");
    assert_eq!(summary.collisions, 0, "{summary:#?}");
    assert!(summary.max_lateral_error_m < 0.15, "{summary:#?}");
    // A 2.55 m wide trailer in a 3.75 m lane has 0.60 m on each side.
    assert!(summary.max_trailer_lateral_error_m < 0.60, "{summary:#?}");
    assert!(summary.mean_speed_m_s > 15.0, "{summary:#?}");
    assert!(summary.fuel_g > 1_000.0 && summary.fuel_g < 20_000.0, "{summary:#?}");
}

#[test]
fn other_seeds_bring_other_traffic_and_no_collision() {
    let runs: Vec<_> = (2..5).map(|seed| world("highway", seed).run(&mut ()).unwrap()).collect();
    assert!(runs.iter().all(|r| r.collisions == 0), "{runs:#?}");
    assert!(runs.windows(2).all(|w| w[0].state_hash != w[1].state_hash));
}

#[test]
fn the_same_seed_gives_the_same_bits_with_and_without_a_recorder() {
    let mut scenario = Scenario::builtin("highway").unwrap();
    scenario.run.duration_s = 60.0;
    let run = |recorded: bool| {
        let mut world = World::new(&scenario, 7).unwrap();
        if recorded {
            world.run(&mut MemoryRecorder::every(3)).unwrap()
        } else {
            world.run(&mut ()).unwrap()
        }
    };
    let plain = run(false);
    assert_eq!(plain, run(true));
    assert_eq!(plain, run(false));
}

#[test]
fn a_clone_is_a_snapshot_that_continues_bit_for_bit() {
    let mut scenario = Scenario::builtin("highway").unwrap();
    scenario.run.duration_s = 40.0;
    let mut world = World::new(&scenario, 3).unwrap();
    for _ in 0..1_500 {
        world.tick(&mut ()).unwrap();
    }
    let mut copy = world.clone();
    assert_eq!(world.run(&mut ()).unwrap(), copy.run(&mut ()).unwrap());
}

#[test]
fn the_recorder_sees_every_tick_in_order() {
    let mut scenario = Scenario::builtin("flat").unwrap();
    scenario.run.duration_s = 5.0;
    let mut recorder = MemoryRecorder::every(1);
    World::new(&scenario, 1).unwrap().run(&mut recorder).unwrap();
    assert_eq!(recorder.records.len(), 500);
    assert!(recorder.records.windows(2).all(|w| w[1].time.0 - w[0].time.0 == 10_000_000));
}

/// Instrument faults of a truck file stood in the file and did nothing in the closed loop.
#[test]
fn a_speedometer_that_reads_five_percent_high_makes_the_truck_slower() {
    let mut scenario = Scenario::builtin("flat").unwrap();
    scenario.run.duration_s = 120.0;
    let drive = |speed_scale: f64| {
        let truck = TruckParameters::load(&scenario.truck.file)
            .unwrap()
            .with_parameter("instruments.speed_scale_coeff", speed_scale)
            .unwrap();
        let model = Arc::new(TruckModel::new(truck, scenario.truck.payload_kg).unwrap());
        let road = Arc::new(Road::load(&scenario.road).unwrap());
        let mut world = World::assemble(&scenario, 1, road, model).unwrap();
        world.run(&mut ()).unwrap();
        world.truck().state().speed_m_s
    };
    let ratio = drive(1.05) / drive(1.0);
    assert!((ratio - 1.0 / 1.05).abs() < 0.003, "{ratio}");
}
