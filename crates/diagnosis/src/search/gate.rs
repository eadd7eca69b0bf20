//! Which of the fitted causes are kept: large enough for a word, and there more probably than not, by
//! what they are worth once the drives' disagreement counts ([`crate::search::worth`]).

use nalgebra::{DMatrix, DVector};

use crate::causes::hypothesis::CATALOGUE;
use crate::problem::Direction;
use crate::problem::course::Course;
use crate::problem::stats::evidence::posterior;
use crate::search::decisions::{
    DISPERSION_PRIOR, OWN_SIZES, OWN_SIZES_PART, PRIOR_CAUSE, STRONG_NATS, WORTH,
};
use crate::search::evidence::Evidence;
use crate::search::free::{directions, prior};
use crate::search::refit::Fit;
use crate::search::weights::log_odds;

/// The gain over `fewer` causes is of one drive, and the others speak against it: a day of strong wind, not
/// what the drives have in common. A tolerance takes what is linear along; where an effect is not, one
/// drive far out looks like a cause.
fn from_one_drive(fit: &Fit, fewer: &Fit) -> bool {
    let drives = fit.gram.per_drive.iter().zip(&fewer.gram.per_drive);
    let gains: Vec<f64> = drives.map(|(with, less)| 0.5 * (less[(0, 0)] - with[(0, 0)])).collect();
    let most = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    gains.len() > 2 && gains.iter().sum::<f64>() - most < -STRONG_NATS
}

impl dyn Evidence + '_ {
    /// Variances of the free parameters, widened by what the drives disagree about.
    ///
    /// The drives' score contributions `s_i` scatter as the information says if the model's form
    /// and tolerances are right; the ratio of both is the over-dispersion (the sandwich estimate
    /// with drives as clusters: Liang and Zeger, Biometrika 73, 1986). Six drives know that ratio
    /// poorly, so it is drawn towards one by [`DISPERSION_PRIOR`] drives' worth, and the interval
    /// gets the t-factor of what is left.
    pub(crate) fn variances(&self, fit: &Fit) -> Vec<f64> {
        let freedom = fit.gram.per_drive.len() as f64 - 1.0 + DISPERSION_PRIOR;
        let t_factor = 1.0 + 1.2 / freedom;
        let stated = self.stated(fit);
        let covariance = stated.as_ref().unwrap_or(&fit.covariance);
        let dispersions = self.dispersions(fit).into_iter().enumerate();
        dispersions.map(|(j, phi)| covariance[(j, j)] * phi * t_factor * t_factor).collect()
    }

    /// Covariance with the courses as widely open as sizes are stated ([`Course::stated`]).
    fn stated(&self, fit: &Fit) -> Option<DMatrix<f64>> {
        let keep: Vec<usize> = (0..=fit.free.len()).collect();
        let mut along = directions(&fit.free, &fit.theta);
        let course = Course::of(&fit.sizes(), &mut along).stated();
        let gram = course.taken_out(&fit.whole, &keep, &fit.theta, self.zero())?;
        let sigma: Vec<f64> = fit.priors.iter().map(|p| p.sigma).collect();
        posterior(&gram.total().0, &sigma).map(|(covariance, _)| covariance)
    }

    /// Over-dispersion of the drives about every free parameter.
    pub(crate) fn dispersions(&self, fit: &Fit) -> Vec<f64> {
        let (k, drives) = (fit.free.len(), fit.gram.per_drive.len() as f64);
        let (mut seen, mut expected) = (vec![0.0; k], vec![0.0; k]);
        for (g, score) in fit.gram.per_drive.iter().zip(self.pulls(fit)) {
            let a = g.view((1, 1), (k, k));
            let moved = &fit.covariance * score;
            let spread = &fit.covariance * a * &fit.covariance;
            for j in 0..k {
                seen[j] += moved[j] * moved[j];
                expected[j] += spread[(j, j)];
            }
        }
        let freedom = drives - 1.0 + DISPERSION_PRIOR;
        (0..k)
            .map(|j| {
                // What the drives say nothing about keeps its prior.
                let told = expected[j] > 1e-9 * fit.covariance[(j, j)];
                let ratio = if told { seen[j] / expected[j] * drives } else { drives };
                ((DISPERSION_PRIOR + ratio) / freedom).max(0.8)
            })
            .collect()
    }

    /// Gradient of every drive at the fit, less its part of the prior's.
    fn pulls(&self, fit: &Fit) -> Vec<DVector<f64>> {
        let (k, drives) = (fit.free.len(), fit.gram.per_drive.len() as f64);
        let pull = DVector::from_fn(k, |j, _| {
            fit.priors[j].pull(fit.theta[fit.free[j] as usize]) / drives
        });
        let scores = fit.gram.scores(&DVector::zeros(k));
        scores.into_iter().map(|score| score - &pull).collect()
    }

    /// The drives do not agree about a size: sizes of their own would add much to the evidence of a
    /// common one (Cochran's Q; Biometrics 10, 1954). What stands in for another cause
    /// fits drives of one load, speed or heading and not the others.
    pub(crate) fn disagree(&self, fit: &Fit) -> bool {
        let (pulls, sigma) = (self.pulls(fit), prior(&fit.free));
        let freedom = pulls.len() as f64 - 1.0;
        fit.free.iter().enumerate().any(|(j, p)| {
            let x = fit.theta[*p as usize] - self.zero()[*p as usize];
            let evidence = 0.5 * x * x / fit.covariance[(j, j)].max(f64::MIN_POSITIVE);
            let drives = fit.gram.per_drive.iter().zip(&pulls);
            let share = 1.0 / (sigma[j] * sigma[j] * pulls.len() as f64);
            let q: f64 = drives.map(|(g, s)| s[j] * s[j] / (g[(j + 1, j + 1)] + share)).sum();
            let size = fit.set.iter().any(|h| CATALOGUE[*h].sizes.contains(p));
            size && 0.5 * (q - freedom) > OWN_SIZES.max(OWN_SIZES_PART * evidence)
        })
    }

    /// Information about the first size of every hypothesis at the reference, best start.
    pub(crate) fn information(&self) -> Vec<f64> {
        let mut dirs = Vec::new();
        let mut owner = Vec::new();
        for (i, h) in CATALOGUE.iter().enumerate() {
            for start in h.starts {
                let shape = h.shapes.iter().copied().zip(*start).collect();
                let p = h.sizes[0];
                dirs.push(Direction::new(p, shape, p.spec().step));
                owner.push(i);
            }
        }
        let gram = self.gram(self.zero(), &dirs);
        let (a, _, _) = gram.sum(|_| true);
        let mut out = vec![0.0_f64; CATALOGUE.len()];
        for (j, i) in owner.iter().enumerate() {
            out[*i] = out[*i].max(a[(j, j)]);
        }
        out
    }

    /// Takes out causes that are too small for a word, those without which the set is more probable (the
    /// median probability model: Barbieri and Berger, Ann. Statist. 32, 2004), and the wind of one day.
    pub(crate) fn gate(&self, fit: Fit, empty: &Fit) -> Fit {
        let mut fit = fit;
        loop {
            let fewer = self.each_left_out(&fit, empty);
            let nats = self.lost_as_driven(&fit, &fewer);
            let doubtful = (0..fit.set.len()).filter(|i| {
                let hyp = &CATALOGUE[fit.set[*i]];
                let size = hyp.size(&fit.theta, self.zero()).abs();
                let small = size < WORTH * hyp.min_size;
                let unlikely = self.worth(&fit, *i, &nats) + log_odds(PRIOR_CAUSE) < 0.0;
                let one = |f: &Fit| hyp.nonlinear() && from_one_drive(&fit, f);
                small || unlikely || fewer[*i].as_ref().is_none_or(one)
            });
            // The weakest first: beside a cause that is not there the true one may look doubtful, too.
            let weakest = doubtful.min_by(|i, j| nats[*i].total_cmp(&nats[*j]));
            let Some(weakest) = weakest else { break };
            let Some(without) = &fewer[weakest] else { return empty.clone() };
            fit = without.clone();
        }
        fit
    }
}
