//! Brake pressure from the deceleration demand: dead time, first-order lag, rate limits. The brake
//! controller scales its demand with the reported mass.

use super::Module as M;
use super::prepared::{Prepared, at_index};
use crate::param::{P, Theta};
use crate::{Drive, Plant};

/// Pressure response, kPa, mean over two samples.
pub(super) fn residual(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let valid = &d.valid[M::Brake as usize];
    let mut chambers = Chambers::new(d, plant, t);
    valid
        .iter()
        .enumerate()
        .map(|(k, ok)| {
            if !ok {
                chambers.pressure_kpa = 0.0;
                return 0.0;
            }
            (2 * k..2 * k + 2).map(|i| 0.5 * (d.pressure[i] - chambers.step(i))).sum()
        })
        .collect()
}

/// The measured pressure, moved towards the modelled one as far as its resolution leaves open. A
/// message in steps of 5 kPa is wrong by up to 2.5 kPa for as long as the pressure rests, which is
/// a kilonewton.
pub(super) fn resolved(d: &Prepared, plant: &Plant) -> Vec<f64> {
    let step = d
        .pressure
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .filter(|x| *x > 1e-6)
        .fold(MAX_RESOLUTION_KPA, f64::min);
    if !d.available[M::Brake as usize] {
        return d.pressure.clone();
    }
    let mut chambers = Chambers::new(d, plant, &[0.0; crate::param::PARAMS]);
    d.pressure
        .iter()
        .enumerate()
        .map(|(i, p)| chambers.step(i).clamp(p - 0.5 * step, p + 0.5 * step).max(0.0))
        .collect()
}

/// Coarsest resolution of a pressure message that is believed, kPa (J1939 SPN 46: 8 kPa).
const MAX_RESOLUTION_KPA: f64 = 8.0;

/// The pressure in the chambers, driven by the logged demand.
struct Chambers<'a> {
    d: &'a Prepared,
    delay: f64,
    gain: f64,
    keep: f64,
    up: f64,
    down: f64,
    pressure_kpa: f64,
}

impl<'a> Chambers<'a> {
    fn new(d: &'a Prepared, plant: &Plant, t: &Theta) -> Self {
        Self {
            d,
            delay: (plant.brake_delay_s + t[P::BrakeDelay as usize]) / Drive::STEP_S,
            gain: d.mass_kg / plant.brake_gain_n_kpa,
            keep: (-Drive::STEP_S / plant.brake_lag_s).exp(),
            up: plant.brake_rate_kpa_s[0] * Drive::STEP_S,
            down: plant.brake_rate_kpa_s[1] * Drive::STEP_S,
            pressure_kpa: 0.0,
        }
    }

    fn step(&mut self, i: usize) -> f64 {
        let demand = self.gain * at_index(&self.d.xbr, i as f64 - self.delay).max(0.0);
        let next = demand + (self.pressure_kpa - demand) * self.keep;
        self.pressure_kpa += (next - self.pressure_kpa).clamp(-self.down, self.up);
        self.pressure_kpa
    }
}
