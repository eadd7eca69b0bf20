//! Truck files that are off, each figure by what is usually not known of it, and what the truck really
//! has: the generator's, or a built-in one.

use std::collections::BTreeMap;

use dynamics::TruckParameters;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::effects::{Effect, Shape};
use super::random::normal;

/// Path, standard deviation over the figure, in the figure's unit where it is zero or a time.
const OFF: [(&str, f64, bool); 17] = [
    ("resistance.rolling_coeff", 0.2, true),
    ("resistance.drag_area_m2", 0.15, true),
    ("driveline.loss_scale_coeff", 0.3, true),
    ("engine.friction_scale_coeff", 0.2, true),
    ("engine.engine_brake_scale_coeff", 0.2, true),
    ("engine.reference_torque_nm", 0.03, true),
    ("engine.slow_lag_s", 0.12, false),
    ("engine.pedal_delay_s", 0.02, false),
    ("shift.duration_scale_coeff", 0.2, true),
    ("brake.gain_scale_coeff", 0.2, true),
    ("brake.dead_time_s", 0.06, false),
    ("lateral.steering.ratio", 0.08, true),
    ("lateral.steering.lag_s", 0.02, false),
    ("lateral.tyres.stiffness_scale[0]", 0.2, true),
    ("lateral.tyres.stiffness_scale[1]", 0.2, true),
    ("lateral.tyres.stiffness_scale[2]", 0.2, true),
    ("lateral.payload.cg_behind_hitch_m", 0.4, false),
];
const FULL_LOAD_FRAC: f64 = 0.03;
const FUEL_FRAC: f64 = 0.08;
const RADIUS_FRAC: f64 = 0.015;
const RATIO_FRAC: f64 = 0.01;

/// What all drives of a truck share and no file says: load sheets, mean weather, map, wheel speed.
const COMMON: [(&str, f64); 4] =
    [("mass", 0.01), ("headwind", 0.2), ("grade_bias", 1e-4), ("speed_scale", 7e-4)];

/// A truck file that is off, and what leads back.
pub(crate) struct Off {
    pub(crate) truck: TruckParameters,
    /// The truth by path; of a table the factor that leads to it.
    pub(crate) truth: BTreeMap<String, f64>,
    /// What is in all drives.
    pub(crate) common: Vec<Effect>,
}

/// The generator's truck.
pub(crate) fn off(seed: u64) -> Off {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0ff);
    let mut out = off_sheet("reference", &mut rng);
    for (id, sigma) in COMMON {
        let size = sigma * drawn(&mut rng);
        out.common.push(Effect::Cause { id, size, shape: Shape([0.0; 4]) });
        if let "mass" | "speed_scale" = id {
            let path = format!("instruments.{id}_coeff").replace("mass_", "mass_scale_");
            out.truth.insert(path, 1.0 + size);
        }
    }
    out
}

/// A built-in truck whose drives the truck model made: nothing else is off.
pub(crate) fn off_built_in(truck: &str, seed: u64) -> Off {
    off_sheet(truck, &mut ChaCha8Rng::seed_from_u64(seed ^ 0x0ff))
}

/// More than two and a half deviations are no sheet's error.
fn drawn(rng: &mut ChaCha8Rng) -> f64 {
    normal(rng).clamp(-2.5, 2.5)
}

fn off_sheet(name: &str, rng: &mut ChaCha8Rng) -> Off {
    let mut n = || drawn(rng);
    let mut truck = TruckParameters::load(name).unwrap();
    let mut truth = BTreeMap::new();
    for (path, sigma, relative) in OFF {
        let true_value = truck.parameter(path).unwrap();
        let by = sigma * n();
        let value = if relative { true_value * (1.0 + by) } else { true_value + by };
        truck = truck.with_parameter(path, value.max(0.05 * true_value)).unwrap();
        truth.insert(path.to_owned(), true_value);
    }
    let full_load = 1.0 + FULL_LOAD_FRAC * n();
    truck.engine.full_load_torque_nm.iter_mut().for_each(|x| *x *= full_load);
    truth.insert("engine.full_load_torque_nm".to_owned(), 1.0 / full_load);
    let fuel = 1.0 + FUEL_FRAC * n();
    truck.engine.scale_fuel(fuel);
    if let Some(map) = &mut truck.engine.fuel_map {
        map.extrapolate = true;
    }
    for path in ["engine.fuel.per_kw_g_s", "engine.fuel_map.fuel_g_s"] {
        truth.insert(path.to_owned(), 1.0 / fuel);
    }
    truth.insert("driveline.wheel_radius_m".to_owned(), truck.driveline.wheel_radius_m);
    truck.driveline.wheel_radius_m *= 1.0 + RADIUS_FRAC * n();
    let ratios = truck.driveline.gear_ratios.iter_mut().enumerate();
    for (i, ratio) in ratios.filter(|(_, r)| **r != 1.0) {
        truth.insert(format!("driveline.gear_ratios[{i}]"), *ratio);
        *ratio *= 1.0 + RATIO_FRAC * n();
    }
    for path in ["instruments.mass_scale_coeff", "instruments.speed_scale_coeff"] {
        truth.insert(path.to_owned(), truck.parameter(path).unwrap());
    }
    truth.insert("lateral.steering.offset_rad".to_owned(), 0.0);
    Off { truck, truth, common: Vec::new() }
}
