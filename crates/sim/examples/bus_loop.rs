//! Every built-in scenario directly and over a bus in memory, side by side:
//! `cargo run --release -p sim --example bus_loop -- [LONGEST_S] [SCENARIO]` (default 120 s each).
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use j1939::BitRate;
use sim::{Scenario, SimError, Status, Summary, World};

/// What a bus makes of a run.
struct Comparison {
    direct: Summary,
    bus: Summary,
    speed_rmse_m_s: f64,
    figures: sim::BusFigures,
}

/// Drives both worlds tick by tick to their ends.
fn compare(scenario: &Scenario) -> Result<Comparison, SimError> {
    let mut direct = World::new(scenario, 1)?;
    let mut bus = World::new(scenario, 1)?;
    bus.put_on_loopback(BitRate::Kbit250)?;
    let (mut sum, mut ticks) = (0.0, 0.0_f64);
    while direct.status() == Status::Running && bus.status() == Status::Running {
        let (a, b) = (direct.truck().state().speed_m_s, bus.truck().state().speed_m_s);
        (sum, ticks) = (sum + (a - b) * (a - b), ticks + 1.0);
        direct.tick(&mut ())?;
        bus.tick(&mut ())?;
    }
    let figures = bus.bus().unwrap_or_default();
    let (direct, bus) = (direct.run(&mut ())?, bus.run(&mut ())?);
    Ok(Comparison { direct, bus, speed_rmse_m_s: (sum / ticks.max(1.0)).sqrt(), figures })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let longest_s = args.next().map_or(Ok(120.0), |s| s.parse())?;
    let only = args.next();
    println!(
        "| scenario | s | collisions | lane changes | speed RMSE, m/s | lateral error max, m \
         (direct, more) | fuel, % | load max, % | not driven, ticks | refused | unsent |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for name in Scenario::names().filter(|name| only.as_deref().is_none_or(|o| o == *name)) {
        let mut scenario = Scenario::builtin(name)?;
        scenario.run.duration_s = scenario.run.duration_s.min(longest_s);
        let c = compare(&scenario)?;
        let (a, b, f) = (&c.direct, &c.bus, c.figures);
        println!(
            "| {name} | {:.0} | {} | {} / {} | {:.4} | {:.3} {:+.4} | {:+.3} | {:.1} | {} | {} | {} |",
            b.duration_s,
            b.collisions,
            a.lane_changes,
            b.lane_changes,
            c.speed_rmse_m_s,
            a.max_lateral_error_m,
            b.max_lateral_error_m - a.max_lateral_error_m,
            100.0 * (b.fuel_g / a.fuel_g.max(1e-9) - 1.0),
            100.0 * f.peak_load_frac,
            f.ticks_not_driven,
            f.refused,
            f.unsent,
        );
    }
    Ok(())
}
