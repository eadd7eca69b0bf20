//! Steps of environments per CPU second on one thread.
//!
//! `cargo run --release -p sim --example batch_speed -- [SCENARIO] [kinematic|truck] [ENVIRONMENTS] [DECISIONS] [AWAKE_M]`
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_macros,
    reason = "a program that measures may stop"
)]

use rustix::time::{ClockId, clock_gettime};
use sim::Scenario;
use sim::batch::{Batch, EnvSnapshot, EnvSpec, EpisodeStats, Fidelity, SUBSTEP_S, Views};
use traffic_client::native::WindowConfig;

/// CPU time of this thread, s.
fn cpu_s() -> f64 {
    let t = clock_gettime(ClockId::ThreadCPUTime);
    t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
}

fn main() {
    let mut args = std::env::args().skip(1);
    let name = args.next().unwrap_or_else(|| "table2-dense-12.5".to_owned());
    let fidelity = match args.next().as_deref() {
        Some("truck") => Fidelity::Truck,
        _ => Fidelity::Kinematic,
    };
    let count: usize = args.next().map_or(64, |n| n.parse().unwrap());
    let decisions: usize = args.next().map_or(120, |n| n.parse().unwrap());
    let mut spec = EnvSpec::new(Scenario::named(&name).unwrap(), fidelity);
    let awake_m: Option<f64> = args.next().map(|m| m.parse().unwrap());
    spec.window = spec.window.map(|window| WindowConfig { awake_m, ..window });
    let per_decision = (spec.decision_s / SUBSTEP_S).round();
    let mut batch = Batch::new(vec![spec; count], 1, 1).unwrap();
    let size = batch.observation_size();
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
    let start_s = cpu_s();
    batch.reset(None, &mut views).unwrap();
    let first_s = cpu_s();
    batch.reset(None, &mut views).unwrap();
    let began_s = cpu_s();
    for step in 0..decisions {
        let actions: Vec<u8> =
            views.mask.chunks(3).map(|m| if step % 7 == 0 && m[0] == 1 { 0 } else { 1 }).collect();
        batch.step(&actions, &mut views).unwrap();
    }
    let spent_s = cpu_s() - began_s;
    let mut kept = EnvSnapshot::default();
    batch.save(0, &mut kept);
    let copies = if fidelity == Fidelity::Kinematic { 10_000 } else { 100 };
    let saved_s = cpu_s();
    for _ in 0..copies {
        batch.save(0, &mut kept);
        batch.restore(0, &kept);
    }
    let copied_s = (cpu_s() - saved_s) / f64::from(copies);
    let steps = (count * decisions) as f64 * per_decision;
    println!(
        "{name}, {fidelity:?}, {count} environments: {:.0} steps of 0.1 s per CPU second, \
         {:.1} us per step; reset {:.3} ms, the first {:.3} ms; save and \
         restore {:.2} us; {} changes",
        steps / spent_s,
        1e6 * spent_s / steps,
        1e3 * (began_s - first_s) / count as f64,
        1e3 * (first_s - start_s) / count as f64,
        1e6 * copied_s,
        views.episodes.iter().map(|e| e.lane_changes).sum::<u32>(),
    );
}
