//! What a run prints at its end.

use std::path::Path;

use sim::{BusFigures, GhostReport, RunReport};

use crate::failure::Failure;
use crate::output;

/// The result on stdout.
///
/// # Errors
/// [`Failure::Work`] when stdout cannot be written.
pub(super) fn report(
    as_json: bool,
    run: &RunReport,
    json: &str,
    folder: &Path,
) -> Result<(), Failure> {
    if as_json {
        return output::result(json);
    }
    let s = &run.summary;
    let litres_per_100_km = s.fuel_g / DIESEL_G_PER_L / (s.distance_m * 1e-5).max(1e-9);
    output::result(&format!(
        "{:.2} km in {:.1} s, {:.1} km/h, {:.2} kg fuel ({litres_per_100_km:.1} l/100 km), \
         {} collisions, {} lane changes, lateral error at most {:.3} m, guard {} ticks{}{}\n{}",
        s.distance_m * 1e-3,
        s.duration_s,
        s.mean_speed_m_s * 3.6,
        s.fuel_g * 1e-3,
        s.collisions,
        s.lane_changes,
        s.max_lateral_error_m,
        s.guard_activations,
        run.ghost.as_ref().map_or_else(String::new, against_ghost),
        run.bus.as_ref().map_or_else(String::new, over_bus),
        folder.display(),
    ))
}

/// What was saved against the ghost, and what traffic cost.
fn against_ghost(ghost: &GhostReport) -> String {
    let percent = |frac: Option<f64>| {
        frac.map_or("not known".to_owned(), |frac| format!("{:.1} %", 100.0 * frac))
    };
    let mut text = format!(
        "\nsaved against cruise control on an empty road, at equal time: {}",
        percent(ghost.saving_frac)
    );
    if ghost.held_up_s > 0.0 {
        text.push_str(&format!(
            " ({} where traffic did not hold the truck up; it did for {:.0} s, {:.2} km)",
            percent(ghost.free_saving_frac),
            ghost.held_up_s,
            ghost.held_up_m * 1e-3
        ));
    }
    text
}

/// How the bus between stack and truck did.
fn over_bus(bus: &BusFigures) -> String {
    format!(
        "\nover a bus at 250 kbit/s: load {:.1} % in the busiest second, {} ticks not driven, \
         {} demands refused",
        100.0 * bus.peak_load_frac,
        bus.ticks_not_driven,
        bus.refused
    )
}

/// Density of diesel fuel, g/l (EN 590, middle of 820 to 845).
const DIESEL_G_PER_L: f64 = 832.0;
