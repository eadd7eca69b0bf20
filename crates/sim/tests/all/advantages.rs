//! What rollouts say about a change: nothing is moved by them, no thread changes them, and they are
//! what driving both courses gives.

use planner::DeciderKind;
use planner::decider::MobilConfig;
use sim::batch::{BasePolicy, Batch, Drivers, EnvSpec, EpisodeStats, Fidelity, RolloutSpec, Views};
use sim::{Scenario, SimError};

const COUNT: usize = 6;

/// Environments, some of which have an open gate after a while.
fn driven(threads: usize, fidelity: Fidelity, decisions: usize) -> (Batch, Vec<f32>, Vec<u8>) {
    let names = ["table2-medium-12.5", "table2-sparse-15"];
    let spec = |name: &&str| EnvSpec::new(Scenario::builtin(name).unwrap(), fidelity);
    let specs = names.iter().map(spec).cycle().take(COUNT).collect();
    let mut batch = Batch::new(specs, 3, threads).unwrap();
    let mut obs = Vec::new();
    let mut mask = Vec::new();
    step(&mut batch, None, &mut obs, &mut mask);
    for _ in 0..decisions {
        step(&mut batch, Some(&[1; COUNT]), &mut obs, &mut mask);
    }
    (batch, obs, mask)
}

/// One step, or the start.
fn step(batch: &mut Batch, actions: Option<&[u8]>, obs: &mut Vec<f32>, mask: &mut Vec<u8>) {
    let size = batch.observation_size() * COUNT;
    obs.resize(size, 0.0);
    mask.resize(3 * COUNT, 0);
    let mut views = Views {
        obs,
        mask,
        reward: &mut [0.0; COUNT],
        terminated: &mut [0; COUNT],
        truncated: &mut [0; COUNT],
        final_obs: &mut vec![0.0; size],
        episodes: &mut [EpisodeStats::default(); COUNT],
    };
    match actions {
        Some(actions) => batch.step(actions, &mut views).unwrap(),
        None => batch.reset(Some(&[1, 2, 3, 4, 5, 6]), &mut views).unwrap(),
    }
}

fn advantages(batch: &mut Batch, spec: &RolloutSpec) -> Vec<f32> {
    let mut out = vec![9.0; 3 * COUNT];
    batch.advantages(spec, &mut out).unwrap();
    out
}

fn mobil() -> RolloutSpec {
    let base = BasePolicy::Decider(DeciderKind::Mobil(MobilConfig::default()));
    RolloutSpec { base, horizon_s: 20.0, rollouts: 2, ..RolloutSpec::default() }
}

#[test]
fn keeping_is_worth_nothing_and_what_the_gate_refuses_is_no_number() {
    let (mut batch, _, mask) = driven(1, Fidelity::Kinematic, 20);
    let out = advantages(&mut batch, &RolloutSpec::default());
    assert!(mask.chunks(3).any(|m| m[0] == 1), "no gate is open");
    for (row, mask) in out.chunks(3).zip(mask.chunks(3)) {
        assert_eq!(row[1], 0.0);
        for a in [0, 2] {
            assert_eq!(row[a].is_nan(), mask[a] == 0, "{row:?} {mask:?}");
            assert!(row[a].is_nan() || (row[a] != 0.0 && row[a].abs() < 20.0), "{row:?}");
        }
    }
}

#[test]
fn nothing_has_moved_afterwards() {
    let (mut asked, ..) = driven(1, Fidelity::Kinematic, 20);
    let (mut alone, mut obs_alone, mut mask) = driven(1, Fidelity::Kinematic, 20);
    let mut obs = Vec::new();
    for spec in [mobil(), RolloutSpec { drivers: Drivers::Forgotten, ..mobil() }] {
        advantages(&mut asked, &spec);
        for decision in 0..15 {
            let wish = |m: &[u8]| if decision == 0 && m[0] == 1 { 0 } else { 1 };
            let actions: Vec<u8> = mask.chunks(3).map(wish).collect();
            step(&mut asked, Some(&actions), &mut obs, &mut Vec::new());
            step(&mut alone, Some(&actions), &mut obs_alone, &mut mask);
            assert!(obs == obs_alone, "decision {decision}");
        }
    }
}

#[test]
fn the_number_of_threads_and_what_was_asked_before_change_no_bit() {
    let bits = |threads: usize| -> Vec<u32> {
        let (mut batch, ..) = driven(threads, Fidelity::Kinematic, 20);
        let first = advantages(&mut batch, &mobil());
        let again = advantages(&mut batch, &mobil());
        let out: Vec<u32> = first.iter().map(|x| x.to_bits()).collect();
        assert!(out.iter().copied().eq(again.iter().map(|x| x.to_bits())));
        out
    };
    let one = bits(1);
    assert!(one == bits(2) && one == bits(4));
}

#[test]
fn without_discount_it_is_the_difference_of_what_both_courses_earn() {
    let (mut batch, _, mask) = driven(1, Fidelity::Kinematic, 20);
    let env = mask.chunks(3).position(|m| m[0] == 1).unwrap();
    let spec = RolloutSpec { discount_frac_s: 1.0, horizon_s: 10.0, ..RolloutSpec::default() };
    let said = advantages(&mut batch, &spec)[3 * env];
    let mut earned = |first: u8| {
        let mut start = sim::batch::EnvSnapshot::default();
        batch.save(env, &mut start);
        let mut sum = 0.0;
        for number in 0..10 {
            let mut reward = [0.0; COUNT];
            let mut actions = [1; COUNT];
            actions[env] = if number == 0 { first } else { 1 };
            let size = batch.observation_size() * COUNT;
            let mut views = Views {
                obs: &mut vec![0.0; size],
                mask: &mut [0; 3 * COUNT],
                reward: &mut reward,
                terminated: &mut [0; COUNT],
                truncated: &mut [0; COUNT],
                final_obs: &mut vec![0.0; size],
                episodes: &mut [EpisodeStats::default(); COUNT],
            };
            batch.step(&actions, &mut views).unwrap();
            sum += reward[env];
        }
        batch.restore(env, &start);
        sum
    };
    let by_hand = earned(0) - earned(1);
    // Drivers judge with other draws in the rollout.
    assert!((said - by_hand).abs() < 0.1, "{said} and {by_hand}");
    assert!(said.abs() > 0.2, "the cost of a change alone is 0.25 s: {said}");
}

#[test]
fn what_cannot_be_asked_is_named() {
    let (mut batch, ..) = driven(1, Fidelity::Kinematic, 0);
    let mut out = vec![0.0; 3 * COUNT];
    let mut refusal = |spec: RolloutSpec| batch.advantages(&spec, &mut out).unwrap_err();
    let good = RolloutSpec::default();
    for (bad, named) in [
        (RolloutSpec { horizon_s: f64::NAN, ..good.clone() }, "horizon_s"),
        (RolloutSpec { rollouts: 0, ..good.clone() }, "rollouts"),
        (RolloutSpec { discount_frac_s: 1.5, ..good.clone() }, "discount_frac_s"),
        (
            RolloutSpec {
                base: BasePolicy::Decider(DeciderKind::Rules { distance_m: 1.0 }),
                ..good.clone()
            },
            "decider.rules.distance_m",
        ),
    ] {
        let text = refusal(bad).to_string();
        assert!(text.contains(named), "{text}");
    }
    assert!(matches!(batch.advantages(&good, &mut [0.0]), Err(SimError::Batch { .. })));
    let (mut trucks, ..) = driven(1, Fidelity::Truck, 0);
    let text = trucks.advantages(&good, &mut [0.0; 3 * COUNT]).unwrap_err().to_string();
    assert!(text.contains("fidelity = truck"), "{text}");
}

#[test]
fn wishes_are_those_of_the_decider() {
    let (mut batch, mut obs, mut mask) = driven(1, Fidelity::Kinematic, 0);
    let mut wishes = vec![9; COUNT];
    let mut seen = [0; 3];
    for _ in 0..120 {
        batch.wishes(DeciderKind::KeepLane, &mut wishes).unwrap();
        assert_eq!(wishes, [1; COUNT]);
        batch.wishes(DeciderKind::Rules { distance_m: 150.0 }, &mut wishes).unwrap();
        wishes.iter().for_each(|&wish| seen[usize::from(wish)] += 1);
        step(&mut batch, Some(&wishes), &mut obs, &mut mask);
    }
    assert!(seen[0] > 0 && seen[1] > seen[0], "{seen:?}");
    let refused = batch.wishes(DeciderKind::External, &mut wishes).unwrap_err().to_string();
    assert!(refused.contains("decider = External"), "{refused}");
}
