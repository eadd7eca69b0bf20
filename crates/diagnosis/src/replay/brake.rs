//! Brake pressure from the deceleration demand: dead time, first-order lag, rate limits. The brake
//! controller scales its demand with a load that it weighs itself on every trip: near the reported
//! mass, or near the true one where that differs.

use super::Module as M;
use super::prepared::{Prepared, at_index};
use crate::causes::param::{P, Theta};
use crate::{Drive, Plant};
use dynamics::SUBSTEP_S;
use dynamics::effects::brake::BrakeParameters;
use tractrix_core::Curve;

/// Pressure response, kPa, mean over two samples.
pub(super) fn residual(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let valid = &d.valid[M::Brake as usize];
    let mut chambers = Chambers::new(d, plant, t);
    valid
        .iter()
        .enumerate()
        .map(|(k, ok)| {
            let mean: f64 =
                (2 * k..2 * k + 2).map(|i| 0.5 * (d.pressure[i] - chambers.step(i))).sum();
            if *ok { mean } else { 0.0 }
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
    let modelled = |load_estimate: f64| {
        let mut theta = [0.0; crate::causes::param::PARAMS];
        theta[P::BrakeLoad as usize] = load_estimate;
        let mut chambers = Chambers::new(d, plant, &theta);
        (0..d.n).map(|i| chambers.step(i)).collect::<Vec<_>>()
    };
    // With a load that is off, the modelled pressure lies on one side of every message.
    let by_sheet = modelled(0.0);
    let product: f64 = d.pressure.iter().zip(&by_sheet).map(|(p, m)| p * m).sum();
    let square: f64 = by_sheet.iter().map(|m| m * m).sum();
    let spec = P::BrakeLoad.spec();
    let load = if square > 0.0 { (product / square - 1.0).clamp(spec.lo, spec.hi) } else { 0.0 };
    d.pressure
        .iter()
        .zip(modelled(load))
        .map(|(p, m)| m.clamp(p - 0.5 * step, p + 0.5 * step).max(0.0))
        .collect()
}

/// Coarsest resolution of a pressure message that is believed, kPa (J1939 SPN 46: 8 kPa).
const MAX_RESOLUTION_KPA: f64 = 8.0;

/// The pressure in the chambers, driven by the logged demand.
struct Chambers<'a> {
    d: &'a Prepared,
    brake: &'a BrakeParameters,
    table: Option<Curve>,
    load_kg: f64,
    delay: f64,
    pressure_kpa: f64,
}

/// Steps of the chambers per sample, as in the truck model.
const SUBSTEPS: usize = (Drive::STEP_S / SUBSTEP_S + 0.5) as usize;
/// Pa per kPa.
pub(super) const PA_PER_KPA: f64 = 1e3;

impl<'a> Chambers<'a> {
    fn new(d: &'a Prepared, plant: &'a Plant, t: &Theta) -> Self {
        let brake = &plant.truck.brake;
        let load_kg = d.mass_kg * (1.0 + t[P::BrakeLoad as usize]);
        Self {
            d,
            brake,
            table: brake.pressure_table(load_kg).ok().flatten(),
            load_kg,
            delay: (brake.dead_time_s + t[P::BrakeDelay as usize]) / Drive::STEP_S,
            pressure_kpa: 0.0,
        }
    }

    fn step(&mut self, i: usize) -> f64 {
        let decel_m_s2 = at_index(&self.d.xbr, i as f64 - self.delay);
        let demand_pa = self.brake.demand_pa(decel_m_s2, self.load_kg, self.table.as_ref());
        let mut pressure_pa = self.pressure_kpa * PA_PER_KPA;
        if pressure_pa != demand_pa {
            for _ in 0..SUBSTEPS {
                pressure_pa = self.brake.pressure_step_pa(pressure_pa, demand_pa, SUBSTEP_S);
            }
        }
        self.pressure_kpa = pressure_pa / PA_PER_KPA;
        self.pressure_kpa
    }
}
