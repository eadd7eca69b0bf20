//! What drives that are in order teach: common calibration, scatter of the tolerances, noise.

use nalgebra::{DMatrix, DVector};

use super::nuisance::Changed;
use super::{Direction, Problem, Reference, nuisance_directions, replay};
use crate::DiagnosisError;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{P, PARAMS, SPECS, Spec, Theta};
use crate::problem::stats::whiten::Whitener;
use crate::replay::{MODULES, Module, Prepared, Residuals};
use crate::search::decisions::{FREE_FORM_NATS, MEAN_PRIOR, SCATTER_PRIOR};

const SCATTER_ROUNDS: usize = 25;
/// Times that tolerances are moved to where their drives have them.
const RECENTRED: usize = 2;

impl Reference {
    pub(super) fn start(
        drives: &[Prepared],
        residuals: &[Residuals],
        theta: Theta,
        clean: bool,
    ) -> Self {
        let mut tolerance = [0.0; PARAMS];
        for (t, s) in tolerance.iter_mut().zip(&SPECS) {
            // Without drives in order, what is calibrated on them is not known either.
            *t = if clean { s.scatter() } else { s.scatter().hypot(s.calibration) };
        }
        let whiteners = fit_whiteners(drives, residuals, true);
        Self {
            theta,
            tolerance,
            mean_spread: [if clean { 0.0 } else { MEAN_PRIOR }; PARAMS],
            whiteners,
            ratio: [1.0; MODULES],
            settled: [1.0; MODULES],
            scatter: Vec::new(),
            attack_nats: 0.0,
            free_form: [if clean { 0.0 } else { FREE_FORM_NATS }; MODULES],
        }
    }
}

pub(super) fn fit_whiteners(
    drives: &[Prepared],
    residuals: &[Residuals],
    white: bool,
) -> Vec<Whitener> {
    Module::ALL
        .iter()
        .map(|m| {
            let i = *m as usize;
            let records = drives
                .iter()
                .zip(residuals)
                .filter(|(d, _)| d.available[i])
                .map(|(d, r)| (r[i].as_slice(), d.valid[i].as_slice()));
            let fitted = Whitener::fit(records, if white { 0 } else { order(*m) });
            let mut w = fitted.unwrap_or_else(|| Whitener::white(1.0));
            w.sigma = w.sigma.max(resolution(*m));
            w
        })
        .collect()
}

/// Resolution of the channels: noise is never assumed smaller.
pub(crate) fn resolution(m: Module) -> f64 {
    match m {
        Module::Force | Module::Imu | Module::Gps => 1e-3,
        Module::Torque => 0.2,
        Module::Fuel | Module::Co2 => 0.05,
        // messages of 4 kPa a bit, mean of two samples
        Module::Brake => 0.8,
        Module::Shift => 0.02,
        Module::Yaw | Module::TrailerYaw | Module::Heading => 5e-5,
        Module::AccelY | Module::Altitude => 1e-2,
    }
}

fn order(m: Module) -> usize {
    match m {
        Module::Shift => 0,
        Module::Force | Module::Imu => 8,
        // rows that are longer than what they remember
        Module::Co2 => 2,
        _ => 6,
    }
}

/// Mean of a tolerance over `count` drives that add up to `sum`, and its deviation in the scatter between
/// them. Its normal prior is worth `prior` drives and stands where the mean began, `before` below where
/// the values are counted from.
fn mean_of(sum: f64, count: f64, prior: f64, before: f64) -> (f64, f64) {
    let weight = count + prior;
    ((sum - before * prior) / weight, weight.sqrt().recip())
}

impl Problem<'_> {
    /// Mean and scatter of every tolerance between the drives by expectation-maximisation, with
    /// [`SCATTER_PRIOR`] drives' worth of the scatter that is expected and a prior for the mean. The
    /// mean is what this truck and its weather are like when all is well (a crosswind of any sign
    /// adds drag): causes count from there. `moved` is how far means have been moved before; the prior
    /// stands where they began. Returns the deviations of the means, in the scatter between drives.
    pub(super) fn scatter(&mut self, moved: &mut Theta) -> Theta {
        let specs: Vec<&Spec> =
            nuisance_directions(&self.reference.tolerance).iter().map(|d| d.p.spec()).collect();
        let systems: Vec<(DMatrix<f64>, DVector<f64>)> = (0..self.drives.len())
            .map(|i| {
                let n = &self.nuisance[i];
                (n.scaled(), self.against(i, &n.base))
            })
            .collect();
        let count = self.drives.len() as f64;
        let mut spreads = [count.sqrt().recip(); PARAMS];
        // Means and variances in units of what the columns are scaled with.
        let mut variance = vec![1.0; specs.len()];
        let mut mean = DVector::<f64>::zeros(specs.len());
        let unit = |s: &Spec| self.reference.tolerance[s.p as usize];
        for _ in 0..SCATTER_ROUNDS {
            let mut first = DVector::<f64>::zeros(specs.len());
            let mut second = vec![0.0; specs.len()];
            for (a, b) in &systems {
                let (mut a, mut b) = (a.clone(), b.clone());
                for (j, v) in variance.iter().enumerate() {
                    a[(j, j)] += 1.0 / v;
                    b[j] += mean[j] / v;
                }
                let Some(factor) = a.cholesky() else { return spreads };
                let (z, spread) = (factor.solve(&b), factor.inverse());
                for (j, s) in second.iter_mut().enumerate() {
                    *s += (z[j] - mean[j]).powi(2) + spread[(j, j)];
                }
                first += z;
            }
            for (j, (v, s)) in variance.iter().zip(&specs).enumerate() {
                let prior = (MEAN_PRIOR * s.scatter() / unit(s)).powi(-2);
                let before = moved[s.p as usize] / unit(s);
                (mean[j], spreads[s.p as usize]) = mean_of(first[j], count, v * prior, before);
            }
            for ((v, second), s) in variance.iter_mut().zip(second).zip(&specs) {
                if s.p == P::BrakeLoad {
                    // weighed anew on every trip, loads that no drive in order had among them
                    continue;
                }
                let expected = (s.scatter() / unit(s)).powi(2);
                let bound = match s.p {
                    P::TurboLag | P::PedalDelay | P::TorqueReport => 2.0,
                    _ => 10.0,
                };
                *v = ((SCATTER_PRIOR * expected + second) / (SCATTER_PRIOR + count))
                    .min(bound * bound * expected);
            }
        }
        for (j, (v, s)) in variance.iter().zip(&specs).enumerate() {
            let i = s.p as usize;
            let x = &mut self.reference.theta[i];
            let before = *x;
            *x = (*x + mean[j] * self.reference.tolerance[i]).clamp(s.lo, s.hi);
            moved[i] += *x - before;
            self.reference.tolerance[i] *= v.sqrt();
        }
        spreads
    }

    /// Raw residuals of a drive after its tolerances are taken out.
    pub(super) fn without_nuisance(&self, i: usize, z: &[f64]) -> Residuals {
        let d = &self.drives[i];
        let mut t = self.reference.theta;
        for (s, z) in nuisance_directions(&self.reference.tolerance).iter().zip(z) {
            let x = &mut t[s.p as usize];
            *x = (*x + z * self.reference.tolerance[s.p as usize])
                .clamp(s.p.spec().lo, s.p.spec().hi);
        }
        replay(d, self.plant, &t)
    }

    /// One parameter after the other, in halving steps: delays of sampled signals have a kink at
    /// every sample, where Gauss-Newton stops short.
    fn creep(
        &self,
        theta: &mut Theta,
        best: &mut f64,
        free: &[&crate::causes::param::Spec],
        cost: &dyn Fn(f64, &Theta) -> f64,
    ) {
        for s in free.iter().filter(|s| s.unit == "s") {
            let mut step = 0.02;
            while step > 0.004 {
                let mut moved = false;
                for sign in [1.0, -1.0] {
                    let mut t = *theta;
                    let x = &mut t[s.p as usize];
                    *x = (*x + sign * step).clamp(s.lo, s.hi);
                    let c = cost(self.gram(&t, &[]).sum(|_| true).2, &t);
                    if c < *best {
                        (*theta, *best, moved) = (t, c, true);
                        break;
                    }
                }
                if !moved {
                    step *= 0.5;
                }
            }
        }
    }

    /// What drives that need not be in order teach all the same, because no cause can be it: when
    /// the logger writes its channels. Their lags are not linear over a sample, so that tolerances
    /// must be about where they are: a lag of a sample that was left to a tolerance was an effect
    /// outside the catalogue at every released pedal.
    pub(super) fn recentre(&mut self) -> Result<(), DiagnosisError> {
        for _ in 0..RECENTRED {
            let directions = nuisance_directions(&self.reference.tolerance);
            let means: Vec<Vec<f64>> = self.each(|i| self.nuisance_mean(i));
            for (j, d) in directions.iter().enumerate() {
                let s = d.p.spec();
                let cause = CATALOGUE.iter().any(|h| h.params().any(|p| p == d.p));
                if s.calibration > 0.0 && s.unit == "s" && !cause {
                    let mean = means.iter().map(|z| z[j]).sum::<f64>() / means.len() as f64;
                    let x = &mut self.reference.theta[d.p as usize];
                    *x = (*x + mean * self.reference.tolerance[d.p as usize]).clamp(s.lo, s.hi);
                }
            }
            self.rebuild(Changed::Everything)?;
        }
        Ok(())
    }

    /// Gauss-Newton steps of the common calibration.
    pub(super) fn calibrate(&mut self, first: bool) -> Result<(), DiagnosisError> {
        let free: Vec<&crate::causes::param::Spec> =
            SPECS.iter().filter(|s| s.calibration > 0.0).collect();
        let directions: Vec<Direction> =
            free.iter().map(|s| Direction::new(s.p, Vec::new(), 0.3 * s.step)).collect();
        let cost = |norm: f64, t: &Theta| {
            norm + free.iter().map(|s| (t[s.p as usize] / s.calibration).powi(2)).sum::<f64>()
        };
        let mut theta = self.reference.theta;
        let mut gram = self.gram(&theta, &directions);
        let mut best = cost(gram.sum(|_| true).2, &theta);
        for _ in 0..if first { 4 } else { 2 } {
            let (mut a, mut b, _) = gram.sum(|_| true);
            for (j, s) in free.iter().enumerate() {
                let precision = 1.0 / (s.calibration * s.calibration);
                a[(j, j)] += precision;
                b[j] -= precision * theta[s.p as usize];
            }
            let step = a
                .cholesky()
                .ok_or_else(|| DiagnosisError::Numerics("calibration".into()))?
                .solve(&b);
            let mut factor = 1.0;
            let mut improved = false;
            while !improved && factor > 0.05 {
                let mut t = theta;
                for (s, d) in free.iter().zip(step.iter()) {
                    let x = &mut t[s.p as usize];
                    *x = (*x + factor * d).clamp(s.lo, s.hi);
                }
                let c = cost(self.gram(&t, &[]).sum(|_| true).2, &t);
                if c < best {
                    (theta, best, improved) = (t, c, true);
                    gram = self.gram(&theta, &directions);
                }
                factor *= 0.4;
            }
            if !improved {
                break;
            }
        }
        if first {
            self.creep(&mut theta, &mut best, &free, &cost);
        }
        self.reference.theta = theta;
        self.rebuild(if first { Changed::Everything } else { Changed::Scatter })
    }
}

#[cfg(test)]
mod tests {
    use super::mean_of;

    /// Each pass drew the mean towards where the one before had left it, so that the prior was
    /// forgotten: a baseline that was 2.7 % low in friction was learned as 3.4 %, and trucks in order
    /// had 5 to 7 % more of it.
    #[test]
    fn a_mean_that_was_moved_once_is_not_moved_again() {
        let (values, prior) = ([-1.4, -0.1, -3.3, -2.9], 2.4);
        let sum: f64 = values.iter().sum();
        let (first, spread) = mean_of(sum, 4.0, prior, 0.0);
        assert!((first - sum / 6.4).abs() < 1e-12 && (spread - 1.0 / 6.4_f64.sqrt()).abs() < 1e-12);
        let rest: f64 = values.iter().map(|x| x - first).sum();
        let (second, _) = mean_of(rest, 4.0, prior, first);
        assert!(second.abs() < 1e-12, "{second}");
    }
}
