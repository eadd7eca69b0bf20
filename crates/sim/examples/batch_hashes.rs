//! Hash of all that batches of environments give (observations, masks, rewards, ends, figures, what
//! changes are worth), for showing that a change of the code changes no environment:
//! `cargo run --release -p sim --example batch_hashes -- [DECISIONS] [WORD]` (default 300 each; with
//! a word, only the rows that have it in their label).
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_macros,
    reason = "a program that compares may stop"
)]

use sim::Scenario;
use sim::batch::{Batch, EnvSnapshot, EnvSpec, EpisodeStats, Fidelity, RolloutSpec, Views};
use traffic_client::native::WindowConfig;

/// FNV-1a, 64 bit, over numbers.
struct Hash(u64);

impl Hash {
    fn add(&mut self, number: u64) {
        self.0 = (self.0 ^ number).wrapping_mul(0x0100_0000_01b3);
        self.0 ^= self.0 >> 29;
    }

    fn add_all(&mut self, numbers: &[f32]) {
        numbers.iter().for_each(|x| self.add(u64::from(x.to_bits())));
    }

    fn add_views(&mut self, views: &Views<'_>) {
        self.add_all(views.obs);
        self.add_all(views.reward);
        self.add_all(views.final_obs);
        for flags in [&*views.mask, views.terminated, views.truncated] {
            flags.iter().for_each(|&x| self.add(u64::from(x)));
        }
        for e in &*views.episodes {
            let counts = [e.decisions, e.lane_changes, e.aborted, e.refused, e.hard_braking_caused];
            counts.into_iter().for_each(|n| self.add(u64::from(n)));
            let numbers = [e.time_s, e.reward_s, e.distance_m, e.delta_speed_frac()];
            numbers.into_iter().for_each(|x| self.add(x.to_bits()));
            self.add(e.fuel_g.map_or(1, f64::to_bits));
            self.add(e.seed ^ u64::from(e.collided) ^ u64::from(e.collision_caused) << 1);
        }
    }
}

/// Hash of a batch that is driven by a fixed mixture of actions, refused ones among them; halfway the
/// second environment goes on from the state of the first.
fn hash(specs: Vec<EnvSpec>, seed: u64, decisions: usize) -> u64 {
    let fidelity = specs[0].fidelity;
    let mut batch = Batch::new(specs, seed, 1).unwrap();
    let (count, size) = (batch.len(), batch.observation_size());
    let (mut obs, mut final_obs) = (vec![0.0; count * size], vec![0.0; count * size]);
    let (mut mask, mut reward) = (vec![0; 3 * count], vec![0.0; count]);
    let (mut terminated, mut truncated) = (vec![0; count], vec![0; count]);
    let mut episodes = vec![EpisodeStats::default(); count];
    let mut views = Views {
        obs: &mut obs,
        mask: &mut mask,
        reward: &mut reward,
        terminated: &mut terminated,
        truncated: &mut truncated,
        final_obs: &mut final_obs,
        episodes: &mut episodes,
    };
    batch.reset(None, &mut views).unwrap();
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    let mut kept = EnvSnapshot::default();
    for step in 0..decisions {
        hash.add_views(&views);
        let wish = |(i, mask): (usize, &[u8])| match (step + 3 * i) % 11 {
            0 if mask[0] == 1 => 0,
            5 if mask[2] == 1 => 2,
            8 => (step / 11 % 3) as u8,
            _ => 1,
        };
        let actions: Vec<u8> = views.mask.chunks(3).enumerate().map(wish).collect();
        batch.step(&actions, &mut views).unwrap();
        if step == decisions / 2 {
            batch.save(0, &mut kept);
            batch.restore(1, &kept);
        }
        if fidelity == Fidelity::Kinematic && step % 97 == 50 {
            let mut worth = vec![0.0; 3 * count];
            batch.advantages(&RolloutSpec::default(), &mut worth).unwrap();
            hash.add_all(&worth);
        }
    }
    hash.add_views(&views);
    hash.0
}

fn main() {
    let mut args = std::env::args().skip(1);
    let decisions: usize = args.next().map_or(300, |n| n.parse().unwrap());
    let word = args.next().unwrap_or_default();
    println!("| batch | hash |\n|---|---|");
    let row = |label: &str, spec: EnvSpec, decisions: usize| {
        // The first ends in between.
        let episode_s = 0.7 * decisions as f64 * spec.decision_s;
        let spec = EnvSpec { episode_s, start_spread_m: 1000.0, ..spec };
        for seed in [1, 2] {
            let label = format!("{label}, seed {seed}");
            if label.contains(&word) {
                println!("| {label} | `{:016x}` |", hash(vec![spec.clone(); 3], seed, decisions));
            }
        }
    };
    for name in Scenario::names() {
        let scenario = Scenario::builtin(name).unwrap();
        let spec = EnvSpec::new(scenario.clone(), Fidelity::Kinematic);
        if Batch::new(vec![spec.clone()], 1, 1).is_err() {
            continue;
        }
        row(name, spec.clone(), decisions);
        if !name.starts_with("table2") {
            continue;
        }
        row(&format!("{name}, whole"), EnvSpec { window: None, ..spec.clone() }, decisions);
        row(&format!("{name}, paper"), EnvSpec::paper(scenario, Fidelity::Kinematic), decisions);
        for awake_m in [600.0, 1500.0] {
            let window = WindowConfig { awake_m: Some(awake_m), ..WindowConfig::default() };
            let spec = EnvSpec { window: Some(window), ..spec.clone() };
            row(&format!("{name}, awake {awake_m}"), spec, decisions);
        }
    }
    for name in ["highway", "table2-medium-15", "sparse-12.5"] {
        let spec = EnvSpec::new(Scenario::builtin(name).unwrap(), Fidelity::Truck);
        row(&format!("{name}, truck"), spec.clone(), decisions / 6);
        let spec = EnvSpec { window: Some(WindowConfig::default()), ..spec };
        row(&format!("{name}, truck, window"), spec, decisions / 6);
    }
}
