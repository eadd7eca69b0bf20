//! Brake pressure from the deceleration demand: dead time, first-order lag, rate limits. The brake
//! controller scales its demand with the reported mass.

use super::Module as M;
use super::prepared::{Prepared, at_index};
use crate::param::{P, Theta};
use crate::{Drive, Plant};

/// Pressure response, kPa, mean over two samples.
pub(super) fn residual(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let valid = &d.valid[M::Brake as usize];
    let delay = (plant.brake_delay_s + t[P::BrakeDelay as usize]) / Drive::STEP_S;
    let gain = d.mass_kg / plant.brake_gain_n_kpa;
    let keep = (-Drive::STEP_S / plant.brake_lag_s).exp();
    let (up, down) =
        (plant.brake_rate_kpa_s[0] * Drive::STEP_S, plant.brake_rate_kpa_s[1] * Drive::STEP_S);
    let mut pressure = 0.0_f64;
    valid
        .iter()
        .enumerate()
        .map(|(k, ok)| {
            if !ok {
                pressure = 0.0;
                return 0.0;
            }
            let mut sum = 0.0;
            for i in 2 * k..2 * k + 2 {
                let demand = gain * at_index(&d.xbr, i as f64 - delay).max(0.0);
                let next = demand + (pressure - demand) * keep;
                pressure += (next - pressure).clamp(-down, up);
                sum += 0.5 * (d.pressure[i] - pressure);
            }
            sum
        })
        .collect()
}
