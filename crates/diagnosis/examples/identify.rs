//! How often the 90 % intervals of `identify` hold the truth: `identify COUNT SEED [drives=N]
//! [seconds=S] [misses=1]`. Each draw has a truck file that is off and drives of its own. With
//! `truck=NAME folders=DIR,...` the truck is a built-in one and the drives are those of the folders,
//! one after the other (`baseline` of `sim-server diagnose --example --truck NAME --seed N`).
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_macros,
    reason = "an example for developers prints and stops"
)]

#[allow(dead_code, reason = "each user of the generator needs a part of it")]
#[path = "../tests/support/mod.rs"]
mod support;

use std::collections::BTreeMap;
use std::path::Path;

use diagnosis::identify::identify;
use diagnosis::read_drives;
use shell::Threads;
use support::nominal::{Off, off, off_built_in};
use support::{Campaign, generate};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let word = |key: &str| words.iter().find_map(|w| w.strip_prefix(key)?.strip_prefix('='));
    let option = |key: &str, default: u64| word(key).map_or(default, |v| v.parse().unwrap());
    let built_in = word("truck").zip(word("folders"));
    let [count, seed] = [0, 1].map(|i| words[i].parse::<u64>().unwrap());
    let lists = option("misses", 0) > 0;
    let campaign = Campaign {
        drives: option("drives", 6) as usize,
        duration_s: option("seconds", 900) as f64,
        tolerance: 1.0,
    };
    // told, inside, sum of squared errors over truth, of widths over truth
    let mut table: BTreeMap<String, (u64, u64, f64, f64)> = BTreeMap::new();
    for draw in seed..seed + count {
        let (Off { truck, truth, .. }, drives) = match built_in {
            Some((name, folders)) => {
                let folders: Vec<&str> = folders.split(',').collect();
                let folder = folders[(draw - seed) as usize % folders.len()];
                (off_built_in(name, draw), read_drives(Path::new(folder)).unwrap())
            }
            None => {
                let off = off(draw);
                let drives = generate(&off.common, &campaign, 7000 + draw);
                (off, drives)
            }
        };
        let found = identify(&truck, &drives, &Threads::available()).unwrap();
        for f in &found.figures {
            let (true_value, [low, high]) = (truth[&f.path], f.interval_90);
            let path =
                if f.path.contains("gear_ratios") { "driveline.gear_ratios" } else { &f.path };
            let row = table.entry(path.to_owned()).or_default();
            let size = if true_value == 0.0 { 1.0 } else { true_value };
            if lists && !(low..=high).contains(&true_value) {
                println!("  {}: {true_value} not in {low:.5} to {high:.5}", f.path);
            }
            row.0 += 1;
            row.1 += u64::from((low..=high).contains(&true_value));
            row.2 += ((f.value - true_value) / size).powi(2);
            row.3 += 0.5 * (high - low) / size;
        }
        let inside: u64 = table.values().map(|r| r.1).sum();
        let told: u64 = table.values().map(|r| r.0).sum();
        println!("draw {draw}: {} told; so far {inside} of {told} inside", found.figures.len());
    }
    println!("| figure | told | inside | error (rms, relative) | half width |");
    println!("|---|---|---|---|---|");
    for (path, (told, inside, squares, widths)) in &table {
        let n = *told as f64;
        println!(
            "| `{path}` | {told} | {inside} | {:.4} | {:.4} |",
            (squares / n).sqrt(),
            widths / n
        );
    }
}
