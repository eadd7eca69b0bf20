//! State hash of every built-in scenario, of the predictive planner and of MOBIL, for showing that a
//! change of the code changes no run:
//! `cargo run --release -p sim --example state_hashes -- [LONGEST_S]` (default 120 s each).
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use planner::decider::MobilConfig;
use planner::{DeciderKind, SpeedPlannerKind};
use sim::{Scenario, World};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let longest_s = std::env::args().nth(1).map_or(Ok(120.0), |s| s.parse())?;
    println!("| scenario | simulated, s | state hash |\n|---|---|---|");
    let row = |label: &str, mut scenario: Scenario| -> Result<(), sim::SimError> {
        scenario.run.duration_s = scenario.run.duration_s.min(longest_s);
        let summary = World::new(&scenario, 1)?.run(&mut ())?;
        println!("| {label} | {:.1} | `{}` |", summary.duration_s, summary.state_hash);
        Ok(())
    };
    for name in Scenario::names() {
        row(name, Scenario::builtin(name)?)?;
    }
    let mut predictive = Scenario::builtin("highway")?;
    predictive.stack.speed_planner = SpeedPlannerKind::Predictive;
    row("highway, predictive", predictive)?;
    let mut mobil = Scenario::builtin("medium-15")?;
    mobil.stack.decider = DeciderKind::Mobil(MobilConfig::default());
    row("medium-15, MOBIL", mobil)?;
    Ok(())
}
