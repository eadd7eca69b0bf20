//! What is left outside the catalogue: a smooth, free function of one measured signal in one
//! module, as a Gaussian-process spline over hat functions, judged by the same evidence.

use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};

use crate::problem::course::Point;
use crate::problem::stats::evidence;
use crate::problem::{Problem, Rest};
use crate::replay::signal::{SIGNALS, Signal, means};
use crate::replay::{JUMP_FRAC, Module, Prepared, by_neighbours};
use crate::search::decisions::{RESTLESS, RESTLESS_ALONE, RHO, SCATTER_PRIOR};

/// Knots of the spline.
pub(crate) const KNOTS: usize = 9;
/// Correlation length over the signal's range.
const LENGTH: f64 = 0.3;

/// A free-form extension that was found.
#[derive(Debug, Clone)]
pub(crate) struct Shape {
    pub(crate) module: Module,
    pub(crate) signal: &'static str,
    /// Time constant of the signal's memory, s; 0: none.
    pub(crate) memory_s: f64,
    /// An addition to the module's quantity, a factor on it, or on a part of the balance.
    pub(crate) acts: Acts,
    /// Evidence over the present model, nats.
    pub(crate) log_z: f64,
    /// The same as far as the drives agree about it.
    pub(crate) firm: f64,
    /// Signal at the knots and the module's error there.
    pub(crate) knots: Vec<(f64, f64)>,
    /// Part of the module's explainable excess that it takes.
    pub(crate) explained_frac: f64,
}

/// What a free function does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Acts {
    /// It is added.
    Added,
    /// It is a factor on the module's own quantity.
    Scaled,
    /// It is a factor on a part of the balance, in words.
    Part(&'static str),
}

/// A disturbance that follows no signal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Restless {
    /// The module that shows it most.
    pub(crate) module: Module,
    /// Variance there over that of drives in order.
    pub(crate) excess: f64,
    /// Evidence, nats.
    pub(crate) evidence: f64,
}

/// Modules that are searched, with the prior size of an unknown effect in the module's unit (per
/// row). The force module's rows are accelerations over one second.
const SEARCHED: &[(Module, f64)] = &[
    (Module::Force, 0.03),
    (Module::Torque, 2.0),
    (Module::Brake, 10.0),
    (Module::Fuel, 3.0),
    (Module::Yaw, 0.003),
    (Module::TrailerYaw, 0.003),
    (Module::AccelY, 0.1),
    (Module::Gps, 0.1),
    (Module::Shift, 0.2),
    (Module::Imu, 0.05),
    (Module::Co2, 3.0),
];

/// Rows of a module below which no function is sought.
const LEAST_ROWS: f64 = 50.0;

/// Modules whose quantity may be off by a factor that follows one of [`SLOW`], and the prior size
/// of that factor: an addition that follows a slow signal shows a factor poorly, for it has to be
/// large where the quantity is large.
const SCALED: &[Module] = &[Module::Torque, Module::Fuel, Module::Brake, Module::Gps, Module::Co2];
const SLOW: &[&str] = &["time_s", "ambient_temp_degc", "coolant_temp_degc", "gps_altitude_m"];

/// Signals that the module itself writes, which its own noise would imitate.
fn own(module: Module, signal: &str) -> bool {
    module.quantity() == signal && module != Module::Force
}

/// Means of a channel over rows of `step` samples.
fn means_of(x: &[f64], step: usize) -> Vec<f64> {
    x.chunks(step).map(|row| row.iter().sum::<f64>() / row.len() as f64).collect()
}

/// What a factor on a module's quantity is multiplied with: the modelled quantity per row, in the
/// unit of the `residual`. The measured one would carry the residual's own noise, and so would the
/// row's own model where it reads a noisy message.
fn own_size(d: &Prepared, module: Module, residual: &[f64]) -> Vec<f64> {
    let measured = means_of(d.measured(module), module.row_step());
    let modelled = |(k, (x, r)): (usize, (&f64, &f64))| x / d.row_unit(module, k) - r;
    let own: Vec<f64> = measured.iter().zip(residual).enumerate().map(modelled).collect();
    if !module.reads_noise() {
        return own;
    }
    let jump = JUMP_FRAC * own.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    by_neighbours(&own, jump)
}

/// How much more the drives disagree about a free function than their noise says, at least 1: the
/// ratio of their score contributions to the expected ones, drawn towards one by
/// [`SCATTER_PRIOR`] drives' worth. Bursts of model error (a hard stop) are not white
/// noise, and evidence counts for less by this factor.
pub(crate) fn dispersion(
    systems: &[(DMatrix<f64>, DVector<f64>)],
    a: &DMatrix<f64>,
    w: &DVector<f64>,
) -> Option<f64> {
    let inverse = (a + DMatrix::identity(a.nrows(), a.nrows())).try_inverse()?;
    let drives = systems.len() as f64;
    let (mut seen, mut expected) = (0.0, 0.0);
    for (a, b) in systems {
        let score = b - w / drives;
        seen += score.dot(&(&inverse * &score));
        expected += (a * &inverse).trace();
    }
    let ratio = drives * seen / f64::max(expected, 1e-9);
    Some(((SCATTER_PRIOR + ratio) / (SCATTER_PRIOR + drives)).max(1.0))
}

impl Problem<'_> {
    /// A disturbance that follows no measured signal: more variance than drives in order have, in
    /// tractor and trailer yaw alike (gusts), or far more in one module.
    pub(crate) fn restless(&self, at: &Point) -> Option<Restless> {
        let now = self.settled(at);
        let excess = |m: Module| now[m as usize] / self.reference.settled[m as usize].max(1.0);
        let rows = |m: Module| -> f64 {
            let count = |d: &Prepared| d.valid[m as usize].iter().filter(|x| **x).count() as f64;
            self.drives.iter().map(count).sum()
        };
        let gusts = excess(Module::Yaw) > RESTLESS && excess(Module::TrailerYaw) > RESTLESS;
        Module::ALL
            .into_iter()
            .filter(|m| {
                let own = excess(*m);
                SEARCHED.iter().any(|s| s.0 == *m)
                    && (own > RESTLESS_ALONE
                        || gusts && *m == Module::Yaw
                        || gusts && *m == Module::TrailerYaw)
            })
            .map(|module| {
                let excess = excess(module);
                let evidence = 0.5 * rows(module) * (excess - 1.0 - excess.ln());
                Restless { module, excess, evidence }
            })
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
    }

    /// The best free-form functions beside the causes of a point and their courses, one per module
    /// and signal, best first.
    pub(crate) fn shapes(&self, at: &Point) -> Vec<Shape> {
        let residuals: Vec<Rest> = self.each(|i| self.rest(i, at));
        let mut rows_of: HashMap<(usize, bool, usize), Vec<Vec<f64>>> = HashMap::new();
        let mut out = self.parts(at, &residuals);
        for (module, size) in SEARCHED {
            let m = *module as usize;
            let rows: f64 = residuals.iter().map(|r| r.whitened[m].len() as f64).sum();
            if !self.drives.iter().any(|d| d.available[m]) || rows < LEAST_ROWS {
                continue;
            }
            let excess = self.excess(*module, &residuals);
            let weights = SCALED.contains(module).then(|| {
                self.each(|i| own_size(&self.drives[i], *module, &self.raw(i, *module, &at.theta)))
            });
            for (place, signal) in SIGNALS.iter().enumerate() {
                if own(*module, signal.name) {
                    continue;
                }
                let values = rows_of
                    .entry((module.row_step(), module.reads_noise(), place))
                    .or_insert_with(|| self.each(|i| means(&self.drives[i], signal, *module)));
                let form = (*module, signal, None);
                out.extend(self.shape(at, form, (*size, excess), values, &residuals));
                if let (Some(weights), true) = (&weights, SLOW.contains(&signal.name)) {
                    let form = (*module, signal, Some(weights.as_slice()));
                    out.extend(self.shape(at, form, (RHO, excess), values, &residuals));
                }
            }
        }
        out.sort_by(|a, b| b.log_z.total_cmp(&a.log_z));
        out
    }

    /// A free function of `size` of a signal with these `values` in a module that has this excess over
    /// its noise, times the weights of the rows if there are any.
    fn shape(
        &self,
        at: &Point,
        (module, signal, weights): (Module, &Signal, Option<&[Vec<f64>]>),
        (size, excess): (f64, f64),
        values: &[Vec<f64>],
        residuals: &[Rest],
    ) -> Option<Shape> {
        let m = module as usize;
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for (d, values) in self.drives.iter().zip(values) {
            for (x, _) in values.iter().zip(&d.valid[m]).filter(|(_, ok)| **ok) {
                lo = lo.min(*x);
                hi = hi.max(*x);
            }
        }
        let width = (hi - lo) / (KNOTS - 1) as f64;
        if width <= 1e-9 || !width.is_finite() {
            return None;
        }
        let parts = self.each(|i| {
            let weight = |k: usize| weights.map_or(1.0, |w| w[i].get(k).copied().unwrap_or(0.0));
            let place = |(k, (x, ok)): (usize, (&f64, &bool))| {
                let x = ((x - lo) / width).clamp(0.0, (KNOTS - 1) as f64);
                let j = (x as usize).min(KNOTS - 2);
                let (way, weight) = (x - j as f64, weight(k));
                ok.then_some((j, [weight * (1.0 - way), weight * way]))
            };
            let rows = values[i].iter().zip(&self.drives[i].valid[m]);
            let places: Vec<Option<(usize, [f64; 2])>> = rows.enumerate().map(place).collect();
            self.hats(i, m, &places, &residuals[i])
        });
        let kernel = DMatrix::from_fn(KNOTS, KNOTS, |i, j| {
            let x = (i as f64 - j as f64) / (KNOTS - 1) as f64 / LENGTH;
            (-0.5 * x * x).exp() + if i == j { 1e-3 } else { 0.0 }
        });
        let factor = kernel.cholesky()?.l() * size;
        let gram = self.together(parts.into_iter());
        let keep: Vec<usize> = (0..=KNOTS).collect();
        let course = at.course.behind(KNOTS);
        let gram = course.taken_out(&gram, &keep, &at.theta, &self.reference.theta)?;
        let (a, b, _) = gram.sum(|_| true);
        let inside = |a: &DMatrix<f64>| factor.transpose() * a * &factor;
        let (a, b) = (inside(&a), factor.transpose() * b);
        let (log_z, w) = evidence::linear(&a, &b, &[1.0; KNOTS])?;
        let systems: Vec<(DMatrix<f64>, DVector<f64>)> = gram
            .per_drive
            .iter()
            .zip(gram.scores(&(&factor * &w)))
            .map(|(g, b)| {
                (inside(&g.view((1, 1), (KNOTS, KNOTS)).into_owned()), factor.transpose() * b)
            })
            .collect();
        let firm = log_z - 0.5 * b.dot(&w) * (1.0 - 1.0 / dispersion(&systems, &a, &w)?);
        let f = &factor * &w;
        let taken = 2.0 * b.dot(&w) - (&a * &w).dot(&w);
        Some(Shape {
            module,
            signal: signal.name,
            memory_s: signal.memory_s,
            acts: if weights.is_some() { Acts::Scaled } else { Acts::Added },
            log_z,
            firm,
            knots: (0..KNOTS).map(|k| (lo + k as f64 * width, f[k])).collect(),
            explained_frac: explained(excess, taken),
        })
    }

    /// A module's excess over its noise.
    pub(crate) fn excess(&self, module: Module, residuals: &[Rest]) -> f64 {
        let m = module as usize;
        let rows: f64 =
            self.drives.iter().map(|d| d.valid[m].iter().filter(|x| **x).count() as f64).sum();
        let chi: f64 = residuals.iter().flat_map(|r| &r.whitened[m]).map(|x| x * x).sum();
        chi - rows
    }
}

/// Part of a module's excess that a function takes, which is the whole of it at the most.
pub(crate) fn explained(excess: f64, taken: f64) -> f64 {
    (taken / excess.max(taken).max(1.0)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;
    use tractrix_core::RPM_PER_RAD_S;

    use super::*;
    use crate::search::decisions::UNKNOWN_EVIDENCE;
    use crate::studies::logger::{Draw, as_logged};
    use crate::{Channel as C, Drive, Plant, Serial};

    /// A truck in order without a baseline was `unknown` by 187 nats, "a rise of the fuel near full
    /// pedal": the torque message has noise and the pedal has none, so that less fuel per torque and some
    /// fuel per pedal leave less than the truth.
    #[test]
    fn a_pedal_that_tells_the_torque_better_than_its_message_is_no_effect() {
        let truck = TruckParameters::load("reference").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let n = 12 * 60 * 20;
        let drives = (0..3).map(|seed| {
            let mut drive = Drive::new(&format!("drive_{seed}"), 0.0, n);
            drive.reported_mass_kg = Some(35_000.0);
            let mut draw = Draw::of_seed(seed);
            let pedal_frac = |i: usize| {
                let turns = i as f64 * Drive::STEP_S / (17.0 + seed as f64);
                0.5 + 0.35 * turns.sin() + 0.1 * (2.3 * turns).sin()
            };
            let percent = |i: usize| 96.0 * pedal_frac(i);
            let speed_m_s = |i: usize| 21.0 + 2.0 * (i as f64 * Drive::STEP_S / 41.0).sin();
            let omega = |i: usize| truck.driveline.engine_speed_rad_s(speed_m_s(i), 12);
            let mut set = |c: C, f: &dyn Fn(usize) -> f64| {
                drive.set(c, (0..n).map(|i| as_logged(c, f(i), &mut draw)).collect());
            };
            set(C::SpeedMS, &speed_m_s);
            set(C::EngineSpeedRpm, &|i| omega(i) * RPM_PER_RAD_S);
            set(C::Gear, &|_| 12.0);
            set(C::ShiftInProcess, &|_| 0.0);
            set(C::AcceleratorPedalFrac, &pedal_frac);
            set(C::EngineTorquePercent, &percent);
            set(C::FuelRateGS, &|i| {
                let nm = 0.01 * percent(i) * truck.engine.reference_torque_nm;
                plant.engine.fuel_rate_g_s(omega(i), nm)
            });
            Prepared::new(&drive, &plant)
        });
        let problem = Problem::learn(&plant, drives.collect(), false, &Serial).unwrap();
        let shapes = problem.shapes(&Point::bare(problem.reference.theta));
        let fuel: Vec<_> = shapes.iter().filter(|s| s.module == Module::Fuel).collect();
        let told: Vec<_> = fuel.iter().map(|s| (s.signal, s.acts, s.log_z)).collect();
        assert!(told.iter().all(|s| s.2 < UNKNOWN_EVIDENCE), "{told:?}");
        assert!(told.iter().any(|s| s.0 == "accelerator_pedal_frac"));
    }
}
