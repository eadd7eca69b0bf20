//! How far traffic with a window is that of the whole road.
//!
//! `cargo run --release -p traffic-client --example window -- [SEEDS] [SECONDS] [FAMILY] [AWAKE_M]`
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_macros,
    reason = "a program that measures may stop"
)]

mod measure;

use measure::{Run, compare, families, run};
use traffic_client::native::WindowConfig;

fn main() {
    let mut args = std::env::args().skip(1);
    let seeds: u64 = args.next().map_or(20, |n| n.parse().unwrap());
    let duration_s: f64 = args.next().map_or(600.0, |n| n.parse().unwrap());
    let only = args.next();
    let awake_m = args.next().map(|m| m.parse().unwrap());
    let near = WindowConfig { awake_m, ..WindowConfig::default() };
    println!(
        "| family | whole: 1/km, m/s, delta | window | difference | KS (95 % of chance) | least gap |"
    );
    for family in families().iter().filter(|f| only.as_ref().is_none_or(|o| f.name.starts_with(o)))
    {
        let runs = |window: Option<WindowConfig>| -> Vec<Run> {
            (0..seeds).map(|seed| run(family, window, seed, duration_s)).collect()
        };
        let (whole, window) = (runs(None), runs(Some(near)));
        let mean = |runs: &[Run], of: fn(&Run) -> f64| {
            runs.iter().map(of).sum::<f64>() / runs.len() as f64
        };
        let row = |runs: &[Run]| {
            let (k, v) = (mean(runs, |r| r.density_1_km), mean(runs, |r| r.speed_m_s));
            format!("{k:.2}, {v:.2}, {:.1} %", 100.0 * mean(runs, |r| r.delta_frac))
        };
        let least = |runs: &[Run]| runs.iter().map(|r| r.least_gap_m).fold(f64::INFINITY, f64::min);
        let both = compare(&whole, &window);
        let [k, v, delta] = both.differences;
        println!(
            "| `{}` | {} | {} | {:+.2} ± {:.2}, {:+.2} ± {:.2}, {:+.1} ± {:.1} pp | {:.3} ({:.3}) | {:.2}, {:.2} m |",
            family.name,
            row(&whole),
            row(&window),
            k.0,
            k.1,
            v.0,
            v.1,
            100.0 * delta.0,
            100.0 * delta.1,
            both.ks.0,
            both.ks.1,
            least(&whole),
            least(&window),
        );
    }
}
