//! The decider that drives ahead on board, in closed loop: it touches nobody, and it is held up less
//! than the paper's rule.

use planner::DeciderKind;
use planner::decider::RolloutConfig;
use sim::batch::{Batch, EnvSpec, EpisodeStats, Fidelity, Views};
use sim::{Scenario, Status, World};

/// Seeds of a scenario.
const SEEDS: usize = 24;

/// Mean delta speed of a decider in a scenario, and its changes and collisions.
fn driven(name: &str, kind: DeciderKind) -> (f64, u32, usize) {
    let spec = EnvSpec {
        episode_s: 300.0,
        start_spread_m: 1000.0,
        ..EnvSpec::new(Scenario::builtin(name).unwrap(), Fidelity::Kinematic)
    };
    let mut batch = Batch::new(vec![spec; SEEDS], 1, 2).unwrap();
    let size = batch.observation_size() * SEEDS;
    let mut wishes = vec![1; SEEDS];
    let mut episodes = [EpisodeStats::default(); SEEDS];
    let mut views = Views {
        obs: &mut vec![0.0; size],
        mask: &mut [0; 3 * SEEDS],
        reward: &mut [0.0; SEEDS],
        terminated: &mut [0; SEEDS],
        truncated: &mut [0; SEEDS],
        final_obs: &mut vec![0.0; size],
        episodes: &mut episodes,
    };
    let seeds: Vec<u64> = (1..=SEEDS as u64).collect();
    batch.reset(Some(&seeds), &mut views).unwrap();
    let mut collided = 0;
    for _ in 0..300 {
        batch.wishes(kind, &mut wishes).unwrap();
        batch.step(&wishes, &mut views).unwrap();
        collided += views.terminated.iter().filter(|&&t| t == 1).count();
    }
    let mean = |of: &dyn Fn(&EpisodeStats) -> f64| episodes.iter().map(of).sum::<f64>();
    let delta_frac = mean(&EpisodeStats::delta_speed_frac) / SEEDS as f64;
    (delta_frac, episodes.iter().map(|e| e.lane_changes).sum(), collided)
}

#[test]
fn it_is_held_up_less_than_the_rule_and_touches_nobody() {
    let name = "table2-medium-12.5";
    let (rule, ..) = driven(name, DeciderKind::Rules { distance_m: 50.0 });
    let (ahead, changes, collided) = driven(name, DeciderKind::Rollout(RolloutConfig::default()));
    assert_eq!(collided, 0);
    assert!(changes > 0 && ahead < rule, "{ahead} against {rule}, {changes} changes");
}

#[test]
fn it_drives_the_full_truck() {
    let mut scenario = Scenario::builtin("table2-medium-12.5").unwrap();
    scenario.stack.decider = DeciderKind::Rollout(RolloutConfig::default());
    scenario.run.duration_s = 120.0;
    let mut world = World::new(&scenario, 3).unwrap();
    while world.tick(&mut ()).unwrap() == Status::Running {}
    assert_eq!((world.status(), world.collisions()), (Status::TimeOver, 0));
}
