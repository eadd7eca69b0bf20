//! What drives that are in order teach: common calibration, scatter of the tolerances, noise.

use nalgebra::{DMatrix, DVector};

use super::nuisance::Changed;
use super::{Direction, Problem, Reference, nuisance_directions, replay, rows};
use crate::DiagnosisError;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{P, PARAMS, SPECS, Spec, Theta};
use crate::problem::stats::slow::Slow;
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
        let whiteners = fit_whiteners(drives, residuals, Noise::White);
        Self {
            theta,
            means: means_apart(&tolerance, |_| if clean { 0.0 } else { MEAN_PRIOR }),
            tolerance,
            whiteners,
            ratio: [1.0; MODULES],
            settled: [1.0; MODULES],
            scatter: Vec::new(),
            attack_nats: 0.0,
            free_form: [if clean { 0.0 } else { FREE_FORM_NATS }; MODULES],
        }
    }
}

/// Factor of the covariance of means whose errors have nothing to do with each other: `spread` of each,
/// in the scatter between drives.
pub(super) fn means_apart(tolerance: &[f64; PARAMS], spread: impl Fn(P) -> f64) -> DMatrix<f64> {
    let of = nuisance_directions(tolerance).into_iter().map(|d| spread(d.p)).collect();
    DMatrix::from_diagonal(&DVector::from_vec(of))
}

/// What noise is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Noise {
    White,
    /// Of drives that need not be in order: what is slow there may be what is wrong.
    Coloured,
    /// Of drives in order.
    Slow,
}

pub(super) fn fit_whiteners(
    drives: &[Prepared],
    residuals: &[Residuals],
    noise: Noise,
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
            let order = if noise == Noise::White { 0 } else { order(*m) };
            let fitted = Whitener::fit(records.clone(), order);
            let mut w = fitted.unwrap_or_else(|| Whitener::white(1.0));
            w.sigma = w.sigma.max(resolution(*m));
            if let (Noise::Slow, Some(block)) = (noise, block(*m)) {
                let of = |(d, r): (&Prepared, &Residuals)| {
                    let rows = rows(d, i);
                    (w.apply(&r[i], rows.ok), w.weights(rows))
                };
                let with = drives.iter().zip(residuals).filter(|(d, _)| d.available[i]);
                let white: Vec<_> = with.map(of).collect();
                w.slow = Slow::fit(&white, block);
            }
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

/// Rows over which slow noise is taken as one, three to four seconds; `None` where rows are events.
fn block(m: Module) -> Option<usize> {
    match m {
        Module::Shift | Module::Co2 => None,
        Module::Torque | Module::Fuel | Module::Yaw | Module::TrailerYaw | Module::AccelY => {
            Some(64)
        }
        Module::Gps => Some(16),
        _ => Some(8),
    }
}

/// What drives in order say about the means of their tolerances.
struct Means {
    /// Most probable means.
    mean: DVector<f64>,
    /// Information about them, their prior included.
    information: DMatrix<f64>,
    /// Posterior covariance of the tolerances of every drive were the means known.
    spreads: Vec<DMatrix<f64>>,
}

impl Means {
    /// From the information and the gradient of every drive about its tolerances, their `variance`
    /// between drives, and the precision `prior` of their means, which stands at `-before`: means are
    /// counted from where they were moved to, their prior stays where they began. Errors of the means
    /// go together where what the drives show does, as rolling resistance and drag do: a drive leaves
    /// `V^-1 - V^-1 (A + V^-1)^-1 V^-1` of information once its own tolerances are integrated out.
    fn of(
        systems: &[(DMatrix<f64>, DVector<f64>)],
        variance: &[f64],
        prior: &[f64],
        before: &[f64],
    ) -> Option<Self> {
        let q = variance.len();
        let mut information = DMatrix::from_fn(q, q, |a, b| if a == b { prior[a] } else { 0.0 });
        let mut gradient = DVector::from_fn(q, |a, _| -prior[a] * before[a]);
        let mut spreads = Vec::with_capacity(systems.len());
        for (a, b) in systems {
            let mut a = a.clone();
            for (j, v) in variance.iter().enumerate() {
                a[(j, j)] += 1.0 / v;
            }
            let spread = a.cholesky()?.inverse();
            let own = &spread * b;
            for (j, v) in variance.iter().enumerate() {
                gradient[j] += own[j] / v;
                information[(j, j)] += 1.0 / v;
                for (k, w) in variance.iter().enumerate() {
                    information[(j, k)] -= spread[(j, k)] / (v * w);
                }
            }
            spreads.push(spread);
        }
        let mean = information.clone().cholesky()?.solve(&gradient);
        Some(Self { mean, information, spreads })
    }

    /// Factor of their covariance, in the scatter between drives.
    fn factor(&self, variance: &[f64]) -> Option<DMatrix<f64>> {
        let q = variance.len();
        let scaled =
            |a: usize, b: usize| self.information[(a, b)] * (variance[a] * variance[b]).sqrt();
        let covariance = DMatrix::from_fn(q, q, scaled).cholesky()?.inverse();
        Some(covariance.cholesky()?.unpack())
    }
}

impl Problem<'_> {
    /// Mean and scatter of every tolerance between the drives by expectation-maximisation, with
    /// [`SCATTER_PRIOR`] drives' worth of the scatter that is expected and a prior for the mean. The
    /// mean is what this truck and its weather are like when all is well (a crosswind of any sign
    /// adds drag): causes count from there. `moved` is how far means have been moved before; the prior
    /// stands where they began. Returns the factor of the covariance of the means, in the scatter
    /// between drives.
    pub(super) fn scatter(&mut self, moved: &mut Theta) -> Result<DMatrix<f64>, DiagnosisError> {
        let specs: Vec<&Spec> =
            nuisance_directions(&self.reference.tolerance).iter().map(|d| d.p.spec()).collect();
        let systems: Vec<(DMatrix<f64>, DVector<f64>)> = (0..self.drives.len())
            .map(|i| {
                let n = &self.nuisance[i];
                (n.scaled(), self.against(i, &n.base))
            })
            .collect();
        let count = self.drives.len() as f64;
        // Means and variances in units of what the columns are scaled with.
        let unit = |s: &Spec| self.reference.tolerance[s.p as usize];
        let expected: Vec<f64> = specs.iter().map(|s| (s.scatter() / unit(s)).powi(2)).collect();
        let prior: Vec<f64> =
            expected.iter().map(|e| (MEAN_PRIOR * MEAN_PRIOR * e).recip()).collect();
        let before: Vec<f64> = specs.iter().map(|s| moved[s.p as usize] / unit(s)).collect();
        let means = |variance: &[f64]| {
            Means::of(&systems, variance, &prior, &before)
                .ok_or_else(|| DiagnosisError::Numerics("means of the tolerances".into()))
        };
        let mut variance = vec![1.0; specs.len()];
        for _ in 0..SCATTER_ROUNDS {
            let means = means(&variance)?;
            let mut second = vec![0.0; specs.len()];
            for (spread, (_, b)) in means.spreads.iter().zip(&systems) {
                let weighed = means.mean.iter().zip(&variance).map(|(m, v)| m / v);
                let z = spread * (b + DVector::from_iterator(specs.len(), weighed));
                for (j, s) in second.iter_mut().enumerate() {
                    *s += (z[j] - means.mean[j]).powi(2) + spread[(j, j)];
                }
            }
            for (j, (v, s)) in variance.iter_mut().zip(&specs).enumerate() {
                if s.p == P::BrakeLoad {
                    // weighed anew on every trip, loads that no drive in order had among them
                    continue;
                }
                let bound = match s.p {
                    P::TurboLag | P::PedalDelay | P::TorqueReport => 2.0,
                    _ => 10.0,
                };
                *v = ((SCATTER_PRIOR * expected[j] + second[j]) / (SCATTER_PRIOR + count))
                    .min(bound * bound * expected[j]);
            }
        }
        let means = means(&variance)?;
        let factor = means.factor(&variance).ok_or_else(|| {
            DiagnosisError::Numerics("covariance of the tolerances' means".into())
        })?;
        for (j, (v, s)) in variance.iter().zip(&specs).enumerate() {
            let i = s.p as usize;
            let x = &mut self.reference.theta[i];
            let before = *x;
            *x = (*x + means.mean[j] * self.reference.tolerance[i]).clamp(s.lo, s.hi);
            moved[i] += *x - before;
            self.reference.tolerance[i] *= v.sqrt();
        }
        Ok(factor)
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
    use nalgebra::{DMatrix, DVector};

    use super::Means;

    /// Each pass drew the mean towards where the one before had left it, so that the prior was
    /// forgotten: a baseline that was 2.7 % low in friction was learned as 3.4 %, and trucks in order
    /// had 5 to 7 % more of it.
    #[test]
    fn a_mean_that_was_moved_once_is_not_moved_again() {
        let values = [-1.4, -0.1, -3.3, -2.9];
        let known = 1e9;
        let systems = |from: f64| -> Vec<_> {
            let gradient = |x: &f64| DVector::from_element(1, known * (x - from));
            values.iter().map(|x| (DMatrix::from_element(1, 1, known), gradient(x))).collect()
        };
        let first = Means::of(&systems(0.0), &[1.0], &[2.4], &[0.0]).unwrap();
        assert!((first.mean[0] - values.iter().sum::<f64>() / 6.4).abs() < 1e-6);
        let factor = first.factor(&[1.0]).unwrap();
        assert!((factor[(0, 0)] - 6.4_f64.sqrt().recip()).abs() < 1e-6);
        let from = first.mean[0];
        let second = Means::of(&systems(from), &[1.0], &[2.4], &[from]).unwrap();
        assert!(second.mean[0].abs() < 1e-6, "{}", second.mean[0]);
    }

    /// Known each as well as its drives say for itself, rolling resistance and drag of a baseline were
    /// both as good as unknown, and a truck with 15 % more of one lost a quarter of its evidence: what
    /// the drives show is their sum, and that they know.
    #[test]
    fn means_that_show_as_a_sum_are_known_as_a_sum() {
        let systems = vec![(DMatrix::from_element(2, 2, 1e6), DVector::from_element(2, 1e6)); 8];
        let means = Means::of(&systems, &[1.0; 2], &[2.0; 2], &[0.0; 2]).unwrap();
        let factor = means.factor(&[1.0; 2]).unwrap();
        let covariance = &factor * factor.transpose();
        let along = |x: f64, y: f64| {
            let d = DVector::from_vec(vec![x, y]);
            (d.transpose() * &covariance * &d)[(0, 0)]
        };
        // Scatter 2 of a sum over 8 drives beside the prior of 1; of the difference the prior alone
        assert!((along(1.0, 1.0) - 1.0 / (8.0 / 2.0 + 1.0)).abs() < 1e-3, "{covariance}");
        assert!((along(1.0, -1.0) - 1.0).abs() < 1e-3, "{covariance}");
        assert!((means.mean[0] - 0.4).abs() < 1e-3, "{}", means.mean[0]);
    }
}
