//! What a named cause does on these drives, in the units of an engineer: the replay with all causes
//! against the replay without this one.

use serde::Serialize;

use crate::problem::replay;
use crate::replay::{MODULES, Module, Prepared};
use crate::run::report_models::Models;
use crate::{Diagnosis, Drive, Plant};

/// What a cause does to one quantity on these drives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// The cause.
    pub id: &'static str,
    /// What it changes, in words.
    pub what: &'static str,
    /// Unit of the figures.
    pub unit: &'static str,
    /// Mean of the change, with the cause less without it.
    pub mean: f64,
    /// Root mean square of the change.
    pub rms: f64,
    /// Fuel that the engine burns for it, litres per 100 km, where it is a matter of forces or fuel.
    pub fuel_l_per_100_km: Option<f64>,
    /// The same as a sentence.
    pub sentence: String,
}

/// Torque of the engine, part of the reference torque, above which it pays for a force.
const PULLS_PERCENT: f64 = 3.0;
/// Part of the root mean square that the mean must have for the change to have a direction.
const STEADY: f64 = 0.3;

/// The quantity of a module in an engineer's words, its unit, and that unit in the module's.
fn words(m: Module) -> (&'static str, &'static str, f64) {
    let degree = 180.0 / core::f64::consts::PI;
    match m {
        Module::Force => ("the force that drives the truck", "N", 1.0),
        Module::Torque => ("engine torque", "% of the reference torque", 1.0),
        Module::Brake => ("brake pressure", "bar", 0.01),
        Module::Shift => ("the duration of a shift", "s", 1.0),
        Module::Fuel => ("the fuel rate", "g/s", 1.0),
        Module::Yaw => ("the tractor's yaw rate", "°/s", degree),
        Module::TrailerYaw => ("the trailer's yaw rate", "°/s", degree),
        Module::AccelY => ("lateral acceleration", "m/s²", 1.0),
        Module::Gps => ("speed over ground against the wheels", "km/h", 3.6),
        Module::Altitude => ("altitude along the map", "m", 1.0),
        Module::Heading => ("heading", "°", degree),
        Module::Imu => ("longitudinal acceleration", "m/s²", 1.0),
        Module::Co2 => ("the CO2 rate over the fuel rate's", "g/s", 1.0),
    }
}

/// Sums over the rows of a module.
#[derive(Default, Clone, Copy)]
struct Sums {
    rows: f64,
    sum: f64,
    squares: f64,
    /// Squares in units of the noise.
    loud: f64,
    fuel_g: f64,
}

/// One effect a cause, on the quantity in which it is loudest over its noise.
pub(super) fn effects(drives: &[&Prepared], plant: &Plant, found: &Diagnosis) -> Vec<Effect> {
    let distance_m: f64 = drives.iter().map(|d| d.speed.iter().sum::<f64>() * Drive::STEP_S).sum();
    let mean_t = drives.iter().map(|d| 1e-3 * d.mass_kg).sum::<f64>() / drives.len().max(1) as f64;
    // kg/m³ are g/l
    let fuel_g_l = plant.truck.engine.fuel.density_kg_m3;
    let of = |cause: &crate::Cause| {
        let sums = sums(drives, plant, &found.models, cause.id);
        let (m, s) = Module::ALL
            .into_iter()
            .zip(sums)
            .filter(|(_, s)| s.rows > 0.0 && s.squares > 0.0)
            .max_by(|a, b| a.1.loud.total_cmp(&b.1.loud))?;
        let fuel = matches!(m, Module::Force | Module::Fuel)
            .then(|| s.fuel_g / fuel_g_l / (1e-5 * distance_m).max(1e-9));
        Some(effect(cause.id, m, &s, fuel, mean_t))
    };
    found.causes.iter().filter_map(of).collect()
}

fn sums(drives: &[&Prepared], plant: &Plant, models: &Models, id: &str) -> [Sums; MODULES] {
    let without = models.without(&[id]);
    let mut all = [Sums::default(); MODULES];
    for d in drives {
        let (with, less) = (replay(d, plant, &models.after), replay(d, plant, &without));
        for m in Module::ALL {
            let i = m as usize;
            let rows = with[i].iter().zip(&less[i]).zip(&d.valid[i]).enumerate();
            for (k, ((with, less), _)) in rows.filter(|(_, (_, ok))| **ok) {
                let scale = match m {
                    Module::Force => d.mass_kg,
                    _ => d.row_unit(m, k),
                };
                // Residuals are measured less modelled.
                let change = less - with;
                let s = &mut all[i];
                s.rows += 1.0;
                s.sum += scale * change;
                s.squares += (scale * change).powi(2);
                s.loud += (change / models.sigma[i].max(1e-12)).powi(2);
                s.fuel_g += match m {
                    Module::Force => fuel_for(d, plant, k * m.row_step(), scale * change),
                    Module::Fuel => scale * change * m.row_step() as f64 * Drive::STEP_S,
                    _ => 0.0,
                };
            }
        }
    }
    all
}

/// Fuel that the engine burns over a row to make up for a force, g; none while it does not pull.
fn fuel_for(d: &Prepared, plant: &Plant, at: usize, force_n: f64) -> f64 {
    let end = (at + Module::Force.row_step()).min(d.n);
    let engine = &plant.truck.engine;
    (at..end)
        .filter(|i| d.torque[*i] > PULLS_PERCENT && d.rpm[*i] > engine.idle_speed_rpm)
        .map(|i| {
            let speed_rad_s = d.rpm[i] * core::f64::consts::PI / 30.0;
            let torque_nm = 0.01 * d.torque[i] * engine.reference_torque_nm;
            let more_nm = (torque_nm - force_n * d.speed[i] / speed_rad_s).max(0.0);
            let rate = |nm| plant.engine.fuel_rate_g_s(speed_rad_s, nm);
            (rate(more_nm) - rate(torque_nm)) * Drive::STEP_S
        })
        .sum()
}

fn effect(id: &'static str, m: Module, s: &Sums, fuel: Option<f64>, mean_t: f64) -> Effect {
    let (what, unit, factor) = words(m);
    let mean = factor * s.sum / s.rows;
    let rms = factor * (s.squares / s.rows).sqrt();
    let steady = mean.abs() > STEADY * rms;
    let mut sentence = match (m, steady) {
        (Module::Force, true) => format!(
            "It {} the truck with {} N on average (mean mass {mean_t:.1} t)",
            if mean < 0.0 { "holds back" } else { "pushes" },
            figures(mean.abs())
        ),
        (_, true) => format!(
            "It {} {what} by {} {unit} on average",
            if mean < 0.0 { "lowers" } else { "raises" },
            figures(mean.abs())
        ),
        (_, false) => format!("It changes {what} by {} {unit} (rms)", figures(rms)),
    };
    if let Some(l) = fuel.filter(|l| l.abs() >= 0.05) {
        let more = if l > 0.0 { "more" } else { "less" };
        sentence += &format!(", {:.1} l of fuel {more} per 100 km", l.abs());
    }
    sentence.push('.');
    Effect { id, what, unit, mean, rms, fuel_l_per_100_km: fuel, sentence }
}

/// Two significant figures.
fn figures(x: f64) -> String {
    let decimals = (1.0 - x.max(1e-9).log10().floor()).clamp(-6.0, 6.0);
    let unit = 10_f64.powf(-decimals);
    format!("{:.*}", decimals.max(0.0) as usize, (x / unit).round() * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_two() {
        assert_eq!([1234.0, 0.0456, 7.0].map(figures), ["1200", "0.046", "7.0"]);
    }

    #[test]
    fn a_force_is_told_in_newtons_and_litres() {
        let s = Sums { rows: 10.0, sum: -6_400.0, squares: 4.1e6, ..Sums::default() };
        let e = effect("rolling_resistance", Module::Force, &s, Some(1.62), 38.2);
        let words = "It holds back the truck with 640 N on average (mean mass 38.2 t), \
            1.6 l of fuel more per 100 km.";
        assert_eq!(e.sentence, words);
        let s = Sums { rows: 4.0, sum: 0.0, squares: 4.0, ..Sums::default() };
        let e = effect("steering_ratio", Module::Yaw, &s, None, 38.2);
        assert_eq!(e.sentence, "It changes the tractor's yaw rate by 57 °/s (rms).");
    }
}
