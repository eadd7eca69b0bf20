//! Every built-in scenario directly and over a bus in memory, side by side; and directly with a start
//! a millimetre ahead, for what a drive in traffic makes of the least difference:
//! `cargo run --release -p sim --example bus_loop -- [LONGEST_S] [SCENARIO]` (default 120 s each).
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use j1939::BitRate;
use sim::{Scenario, SimError, Status, Summary, World};

/// Two drives of a scenario, tick by tick.
struct Pair {
    worlds: [World; 2],
    sum_m2_s2: f64,
    ticks: f64,
    /// RMSE of the speeds up to the first decision that differs (manoeuvre or gear), and when.
    until_s: Option<(f64, f64)>,
}

impl Pair {
    fn drive(worlds: [World; 2]) -> Result<Self, SimError> {
        let mut pair = Self { worlds, sum_m2_s2: 0.0, ticks: 0.0, until_s: None };
        while pair.worlds.iter().all(|w| w.status() == Status::Running) {
            let [a, b] = pair.worlds.each_ref().map(|w| {
                let gear = w.truck().state().powertrain.gear;
                (w.truck().state().speed_m_s, (w.stack().plan().maneuver, gear))
            });
            pair.sum_m2_s2 += (a.0 - b.0) * (a.0 - b.0);
            pair.ticks += 1.0;
            if a.1 != b.1 && pair.until_s.is_none() {
                pair.until_s = Some((pair.rmse_m_s(), pair.worlds[0].now().seconds()));
            }
            for world in &mut pair.worlds {
                world.tick(&mut ())?;
            }
        }
        Ok(pair)
    }

    fn rmse_m_s(&self) -> f64 {
        (self.sum_m2_s2 / self.ticks.max(1.0)).sqrt()
    }

    /// The figures of both drives at their ends.
    fn summaries(&mut self) -> Result<[Summary; 2], SimError> {
        let [a, b] = &mut self.worlds;
        Ok([a.run(&mut ())?, b.run(&mut ())?])
    }
}

/// How the second drive's fuel differs, percent.
fn fuel_percent([a, b]: &[Summary; 2]) -> f64 {
    100.0 * (b.fuel_g / b.distance_m / (a.fuel_g / a.distance_m) - 1.0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let longest_s = args.next().map_or(Ok(120.0), |s| s.parse())?;
    let only = args.next();
    println!(
        "| scenario | s | collisions | lane changes | first other decision, s | speed RMSE before \
         it, m/s | speed RMSE, m/s | lateral error max direct, more, m | fuel per km, % | load max, % \
         | not driven, ticks | refused, unsent | 1 mm ahead: RMSE, m/s | 1 mm ahead: fuel, % |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for name in Scenario::names().filter(|name| only.as_deref().is_none_or(|o| o == *name)) {
        let mut scenario = Scenario::builtin(name)?;
        scenario.run.duration_s = scenario.run.duration_s.min(longest_s);
        let mut bus = World::new(&scenario, 1)?;
        bus.put_on_loopback(BitRate::Kbit250)?;
        let mut pair = Pair::drive([World::new(&scenario, 1)?, bus])?;
        let mut ahead = scenario.clone();
        ahead.ego.s_m += 1e-3;
        let mut nudged = Pair::drive([World::new(&scenario, 1)?, World::new(&ahead, 1)?])?;
        let (rmse_m_s, until) = (pair.rmse_m_s(), pair.until_s);
        let (before_m_s, until_s) = until.unwrap_or((rmse_m_s, f64::INFINITY));
        let figures = pair.worlds[1].bus().unwrap_or_default();
        let both = pair.summaries()?;
        let [a, b] = &both;
        println!(
            "| {name} | {:.0} | {} | {} / {} | {until_s:.1} | {before_m_s:.4} | {rmse_m_s:.4} | \
             {:.3} {:+.4} | {:+.3} | {:.1} | {} | {}, {} | {:.4} | {:+.3} |",
            b.duration_s,
            b.collisions,
            a.lane_changes,
            b.lane_changes,
            a.max_lateral_error_m,
            b.max_lateral_error_m - a.max_lateral_error_m,
            fuel_percent(&both),
            100.0 * figures.peak_load_frac,
            figures.ticks_not_driven,
            figures.refused,
            figures.unsent,
            nudged.rmse_m_s(),
            fuel_percent(&nudged.summaries()?),
        );
    }
    Ok(())
}
