//! What drives teach of the truck and its logger: where a reference starts, and their common calibration.

use super::means::means_apart;
use super::noise::{Noise, fit_whiteners};
use super::nuisance::Changed;
use super::{Direction, Problem, Reference, nuisance_directions, replay};
use crate::DiagnosisError;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{P, PARAMS, SPECS, Theta};
use crate::replay::{MODULES, Prepared, Residuals};
use crate::search::decisions::{FREE_FORM_NATS, MEAN_PRIOR};

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

impl Problem<'_> {
    /// Raw residuals of a drive after its tolerances are taken out.
    pub(super) fn without_nuisance(&self, i: usize, z: &[f64]) -> Residuals {
        replay(&self.drives[i], self.plant, &self.off_by(z))
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
    /// the logger writes its channels, how curves are banked, where the accelerometer sits; not the
    /// fuel's level, which causes of the fuel are weighed against. Their lags are not linear over a
    /// sample, so that tolerances must be about where they are: a lag of a sample that was left to a
    /// tolerance was an effect outside the catalogue at every released pedal.
    pub(super) fn recentre(&mut self) -> Result<(), DiagnosisError> {
        for _ in 0..RECENTRED {
            let directions = nuisance_directions(&self.reference.tolerance);
            let means: Vec<Vec<f64>> = self.each(|i| self.nuisance_mean(i));
            for (j, d) in directions.iter().enumerate() {
                let s = d.p.spec();
                let cause = CATALOGUE.iter().any(|h| h.params().any(|p| p == d.p));
                if s.calibration > 0.0 && s.p != P::FuelScale && !cause {
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
