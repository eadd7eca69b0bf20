//! Environments in batches: the same bits as a world, on any number of threads, and what the mask
//! says is what the gate does.

use crate::arrays::{Arrays, allowed};
use sim::batch::{Batch, EnvSnapshot, EnvSpec, Fidelity};
use sim::{Metrics, Scenario, SimError, Status, World};

fn spec(name: &str, fidelity: Fidelity) -> EnvSpec {
    EnvSpec { start_spread_m: 500.0, ..EnvSpec::new(Scenario::builtin(name).unwrap(), fidelity) }
}

/// A batch measures collisions alone; what is driven keeps every bit, hashed here by a recorder of the
/// test's own.
#[test]
fn a_world_that_measures_collisions_alone_drives_bit_for_bit_as_one_that_measures_all() {
    let scenario = Scenario::builtin("table2-dense-12.5").unwrap();
    let truck = dynamics::TruckParameters::load("reference").unwrap();
    // It is the yardstick of the figures, not what is driven.
    let limits = dynamics::TruckModel::new(truck, 20e3).unwrap().vehicle_limits().unwrap();
    let drive = |only_collisions: bool| {
        let mut world = World::new(&scenario, 7).unwrap();
        if only_collisions {
            world.only_collisions();
        }
        let road = std::sync::Arc::new(scenario.load_road().unwrap());
        let mut hashed = Metrics::new(&limits, &scenario.stack.rss, road);
        let hashes: Vec<String> = (0..3_000)
            .map(|_| {
                assert_eq!(world.tick(&mut hashed).unwrap(), Status::Running);
                hashed.summary().state_hash
            })
            .collect();
        (hashes, world.collisions(), world.summary().state_hash)
    };
    let (all, only) = (drive(false), drive(true));
    assert_eq!(all.0, only.0);
    assert_eq!(all.1, only.1);
    assert!(all.2 != only.2, "the world itself hashes no more");
}

#[test]
fn a_batch_with_the_full_truck_is_a_world_bit_for_bit() {
    let scenario = Scenario::builtin("table2-medium-15").unwrap();
    let spec = EnvSpec { decision_s: 0.1, ..EnvSpec::new(scenario.clone(), Fidelity::Truck) };
    let mut batch = Batch::new(vec![spec], 1, 1).unwrap();
    let mut arrays = Arrays::of(&batch);
    batch.reset(Some(&[7]), &mut arrays.views()).unwrap();
    let mut alone = scenario;
    alone.stack.decider = planner::DeciderKind::External;
    let mut world = World::new(&alone, 7).unwrap();
    for step in 0..400 {
        let action = if step % 50 == 20 { allowed(&arrays.mask, step) } else { 1 };
        world.stack_mut().request_lane_change(sim::batch::ACTIONS[usize::from(action)]);
        // The batch has looked at what the next tick sees.
        let seen = *batch.world(0).unwrap().truck().state();
        batch.step(&[action], &mut arrays.views()).unwrap();
        for tick in 0..10 {
            assert_eq!(world.tick(&mut ()).unwrap(), Status::Running);
            assert!(tick > 0 || *world.truck().state() == seen, "step {step}");
        }
        let batched = batch.world(0).unwrap();
        assert_eq!(batched.stack().plan(), world.stack().plan(), "step {step}");
        assert_eq!(batched.collisions(), world.collisions(), "step {step}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let run = |threads: usize| {
        let specs = ["table2-dense-12.5", "table2-medium-15", "table2-sparse-15"];
        let specs = specs
            .iter()
            .cycle()
            .take(7)
            .map(|name| EnvSpec { episode_s: 20.0, ..spec(name, Fidelity::Kinematic) });
        let mut batch = Batch::new(specs.collect(), 5, threads).unwrap();
        let mut arrays = Arrays::of(&batch);
        batch.reset(None, &mut arrays.views()).unwrap();
        let mut bits = Vec::new();
        for step in 0..45 {
            let actions: Vec<u8> =
                (0..7).map(|i| allowed(&arrays.mask[3 * i..3 * i + 3], step + i)).collect();
            batch.step(&actions, &mut arrays.views()).unwrap();
            bits.extend(arrays.obs.iter().chain(&arrays.reward).map(|x| x.to_bits()));
            bits.extend(arrays.final_obs.iter().map(|x| x.to_bits()));
        }
        bits
    };
    let one = run(1);
    assert!(one == run(2) && one == run(4));
}

#[test]
fn an_episode_ends_with_its_last_observation_and_begins_again_in_the_same_step() {
    let spec = EnvSpec { episode_s: 5.0, ..spec("table2-medium-12.5", Fidelity::Kinematic) };
    let mut batch = Batch::new(vec![spec.clone(), spec], 3, 1).unwrap();
    let mut arrays = Arrays::of(&batch);
    batch.reset(Some(&[11, 12]), &mut arrays.views()).unwrap();
    let size = batch.observation_size();
    let first = arrays.obs.clone();
    for step in 1..=5 {
        batch.step(&[1, 1], &mut arrays.views()).unwrap();
        let over = u8::from(step == 5);
        assert_eq!((&arrays.truncated[..], &arrays.terminated[..]), (&[over; 2][..], &[0; 2][..]));
    }
    let of = |i: usize| i * size..(i + 1) * size;
    for i in 0..2 {
        let ended = arrays.episodes[i];
        assert_eq!((ended.decisions, ended.seed), (5, 11 + i as u64));
        assert!((ended.time_s - 5.0).abs() < 1e-9 && ended.distance_m > 30.0, "{ended:?}");
        // The last observation still has a frame of 3 s ago, the new episode has none.
        assert!(arrays.final_obs[of(i)][3 * 54] == 1.0 && arrays.obs[of(i)][3 * 54] == 0.0);
        assert_ne!(arrays.obs[of(i)], first[of(i)], "another seed");
    }
    batch.reset(Some(&[11, 12]), &mut arrays.views()).unwrap();
    assert_eq!(arrays.obs, first, "the same seeds, the same bits");
}

/// What follows a seed hung on how many episodes had ended before it: the counter went on.
#[test]
fn what_follows_a_seed_does_not_hang_on_what_was_before() {
    let spec = EnvSpec { episode_s: 3.0, ..spec("table2-medium-15", Fidelity::Kinematic) };
    let mut batch = Batch::new(vec![spec], 5, 1).unwrap();
    let mut arrays = Arrays::of(&batch);
    let mut after_seven = |before: usize| {
        batch.reset(Some(&[3]), &mut arrays.views()).unwrap();
        for _ in 0..before {
            batch.step(&[1], &mut arrays.views()).unwrap();
        }
        batch.reset(Some(&[7]), &mut arrays.views()).unwrap();
        let mut kept = EnvSnapshot::default();
        batch.save(0, &mut kept);
        let mut drive = |batch: &mut Batch| -> Vec<Vec<u32>> {
            let step = |_| {
                batch.step(&[1], &mut arrays.views()).unwrap();
                arrays.obs.iter().map(|x| x.to_bits()).collect()
            };
            (0..10).map(step).collect()
        };
        let first = drive(&mut batch);
        batch.restore(0, &kept);
        assert_eq!(first, drive(&mut batch));
        first
    };
    assert_eq!(after_seven(0), after_seven(4));
}

#[test]
fn a_kept_state_goes_on_with_the_same_bits() {
    for fidelity in [Fidelity::Kinematic, Fidelity::Truck] {
        let mut batch = Batch::new(vec![spec("table2-dense-15", fidelity)], 9, 1).unwrap();
        let mut arrays = Arrays::of(&batch);
        batch.reset(None, &mut arrays.views()).unwrap();
        let mut drive = |batch: &mut Batch, steps: usize| {
            let mut bits = Vec::new();
            for _ in 0..steps {
                batch.step(&[1], &mut arrays.views()).unwrap();
                bits.extend(arrays.obs.iter().map(|x| x.to_bits()));
            }
            bits
        };
        drive(&mut batch, 6);
        let mut kept = EnvSnapshot::default();
        batch.save(0, &mut kept);
        let first = drive(&mut batch, 8);
        batch.restore(0, &kept);
        assert!(first == drive(&mut batch, 8), "{fidelity:?}");
    }
}

#[test]
fn what_the_mask_says_is_what_the_gate_does() {
    // Every wish that the mask allows is driven, every one that it forbids is refused.
    let names = ["table2-dense-12.5", "table2-medium-12.5", "table2-sparse-12.5"];
    let specs = names.iter().cycle().take(6).map(|name| spec(name, Fidelity::Kinematic));
    let mut batch = Batch::new(specs.collect(), 2, 1).unwrap();
    let mut arrays = Arrays::of(&batch);
    batch.reset(None, &mut arrays.views()).unwrap();
    let (mut passed, mut forbidden) = (0, 0);
    for step in 0..240_usize {
        let actions: Vec<u8> = (0..6).map(|i| [0, 2, 1, 1][(step + i) % 4]).collect();
        let (mask, before) = (arrays.mask.clone(), arrays.episodes.clone());
        batch.step(&actions, &mut arrays.views()).unwrap();
        for i in 0..6 {
            let (was, is) = (before[i], arrays.episodes[i]);
            let refused = is.refused - was.refused;
            if actions[i] == 1 {
                assert_eq!(refused, 0);
            } else if mask[3 * i + usize::from(actions[i])] == 1 {
                assert_eq!((refused, is.lane_changes - was.lane_changes), (0, 1));
                passed += 1;
            } else {
                assert_eq!((refused, is.lane_changes - was.lane_changes), (1, 0));
                forbidden += 1;
            }
        }
        assert!(arrays.terminated.iter().all(|&t| t == 0), "no collision");
    }
    assert!(passed > 10 && forbidden > 100, "{passed} {forbidden}");
}

#[test]
fn the_reward_equals_figures_by_hand() {
    let scenario = Scenario::builtin("table2-sparse-15").unwrap();
    let spec = EnvSpec { decision_s: 0.1, ..EnvSpec::new(scenario, Fidelity::Kinematic) };
    let mut batch = Batch::new(vec![spec], 4, 1).unwrap();
    let mut arrays = Arrays::of(&batch);
    batch.reset(Some(&[3]), &mut arrays.views()).unwrap();
    // 14 m/s at the start, 16.67 m/s wished: (1 - 2.67 / 20) * 0.1 s.
    batch.step(&[1], &mut arrays.views()).unwrap();
    assert!((arrays.reward[0] - 0.086_65).abs() < 1e-6, "{}", arrays.reward[0]);
    assert!((arrays.episodes[0].delta_speed_frac() - 2.67 / 16.67).abs() < 1e-9);
    while arrays.mask[0] == 0 {
        batch.step(&[1], &mut arrays.views()).unwrap();
    }
    let v = f64::from(arrays.obs[3]) * 40.0;
    batch.step(&[0], &mut arrays.views()).unwrap();
    let by_hand = (1.0 - (16.67 - v) / 20.0) * 0.1 - 0.25;
    assert!((f64::from(arrays.reward[0]) - by_hand).abs() < 1e-5, "a change begins");
    assert_eq!(arrays.episodes[0].lane_changes, 1);
}

#[test]
fn what_cannot_be_is_named() {
    let told = |result: Result<(), SimError>| result.unwrap_err().to_string();
    let spec = spec("table2-sparse-12.5", Fidelity::Kinematic);
    let mut batch = Batch::new(vec![spec.clone(); 2], 1, 1).unwrap();
    let mut arrays = Arrays::of(&batch);
    let early = told(batch.step(&[1, 1], &mut arrays.views()));
    assert!(early.contains("reset begins one"), "{early}");
    batch.reset(None, &mut arrays.views()).unwrap();
    let action = told(batch.step(&[1, 3], &mut arrays.views()));
    assert!(action.contains("action = 3: 0 left, 1 keep, 2 right"), "{action}");
    let few = told(batch.step(&[1], &mut arrays.views()));
    assert!(few.contains("actions = 1 numbers: 2 numbers"), "{few}");
    let mut views = arrays.views();
    views.mask = &mut views.mask[..5];
    let mask = told(batch.step(&[1, 1], &mut views));
    assert!(mask.contains("mask = 5 numbers: 6 numbers"), "{mask}");
    let new = |spec: EnvSpec| told(Batch::new(vec![spec], 1, 1).map(drop));
    assert!(new(EnvSpec { decision_s: 0.3, ..spec.clone() }).contains("decision_s = 0.3"));
    assert!(new(EnvSpec { episode_s: f64::NAN, ..spec.clone() }).contains("episode_s = NaN"));
    let empty = EnvSpec::new(Scenario::builtin("flat").unwrap(), Fidelity::Kinematic);
    assert!(new(empty).contains("scenario = flat: kinematic"));
    assert!(told(Batch::new(vec![spec], 1, 0).map(drop)).contains("threads = 0"));
}
