//! Which of the fitted causes are kept: large enough for a word, beyond what the drives disagree
//! about, of more than one drive, and worth something on drives that they were not fitted to.

use nalgebra::{DMatrix, DVector};

use crate::causes::hypothesis::CATALOGUE;
use crate::problem::Direction;
use crate::problem::stats::evidence;
use crate::search::decisions::{
    DISPERSION_PRIOR, LONELY, MIN_SIGMAS, OWN_SIZES, OWN_SIZES_PART, PRIOR_CAUSE, SHARED,
    STRONG_NATS, WORTH,
};
use crate::search::evidence::Evidence;
use crate::search::free::prior;
use crate::search::refit::Fit;
use crate::search::weights::log_odds;

/// Information of every drive about a member's sizes, in their priors: what it says of the cause as the
/// catalogue has it, which a course of its own would cap.
fn about(fit: &Fit, member: usize) -> Vec<f64> {
    let hyp = &CATALOGUE[fit.set[member]];
    let own: Vec<(usize, f64)> = (0..fit.free.len())
        .filter(|j| hyp.sizes.contains(&fit.free[*j]))
        .map(|j| (j + 1, fit.free[j].spec().prior.powi(2)))
        .collect();
    let of = |g: &DMatrix<f64>| own.iter().map(|(j, v)| g[(*j, *j)] * v).sum();
    fit.whole.per_drive.iter().map(of).collect()
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
        let dispersions = self.dispersions(fit).into_iter().enumerate();
        dispersions.map(|(j, phi)| fit.covariance[(j, j)] * phi * t_factor * t_factor).collect()
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

    /// Takes out causes that are too small for a word, within the drives' disagreement, or that do
    /// not pay on drives they were not fitted to (two folds of whole drives, linear refit around
    /// the joint fit).
    pub(crate) fn gate(&self, fit: Fit, empty: &Fit) -> Fit {
        let mut fit = fit;
        loop {
            let fewer = self.each_left_out(&fit, empty);
            let nats = Self::lost(&fit, &fewer);
            let doubtful = (0..fit.set.len()).filter(|i| {
                let hyp = &CATALOGUE[fit.set[*i]];
                let size = hyp.size(&fit.theta, self.zero()).abs();
                let small = size < WORTH * hyp.min_size || !self.stands_out(&fit, *i, nats[*i]);
                let one = |f: &Fit| hyp.nonlinear() && Self::from_one_drive(&fit, *i, f);
                let of_one_drive = fewer[*i].as_ref().is_none_or(one);
                // The set without it is more probable (the median probability model: Barbieri and
                // Berger, Ann. Statist. 32, 2004).
                let unlikely = self.worth(&fit, *i, &nats) + log_odds(PRIOR_CAUSE) < 0.0;
                small || of_one_drive || unlikely || self.folds(&fit, *i) < STRONG_NATS
            });
            // The weakest first: beside a cause that is not there the true one may look doubtful, too.
            let weakest = doubtful.min_by(|i, j| nats[*i].total_cmp(&nats[*j]));
            let Some(weakest) = weakest else { break };
            let Some(without) = &fewer[weakest] else { return empty.clone() };
            fit = without.clone();
        }
        fit
    }

    /// The gain of the `i`-th member is of one drive, although others say as much about it: a day of
    /// strong wind, not what the drives have in common. A tolerance takes what is linear along; where
    /// an effect is not, one drive far out looks like a cause.
    fn from_one_drive(fit: &Fit, member: usize, fewer: &Fit) -> bool {
        let drives = fit.gram.per_drive.iter().zip(&fewer.gram.per_drive);
        let gains: Vec<f64> = drives.map(|(with, less)| less[(0, 0)] - with[(0, 0)]).collect();
        let known = about(fit, member);
        let best = gains.iter().enumerate().max_by(|x, y| x.1.total_cmp(y.1));
        best.is_some_and(|(top, most)| {
            let (gain, all) = (gains.iter().sum::<f64>(), known.iter().sum::<f64>());
            let expected = gain * (1.0 - known[top] / all.max(f64::MIN_POSITIVE));
            gains.len() > 2 && gain - most < SHARED * expected
        })
    }

    /// What the `i`-th member adds is beyond what the drives disagree about: `nats` of evidence, over the
    /// over-dispersion of the drives about its sizes, are more than [`MIN_SIGMAS`]. Its size over its
    /// interval does not say it: that of a fade or of a crosswind is known no better than its form, however
    /// much the two explain together (Hauck and Donner, J. Am. Stat. Assoc. 72, 1977).
    fn stands_out(&self, fit: &Fit, member: usize, nats: f64) -> bool {
        let own = CATALOGUE[fit.set[member]].sizes;
        let of_sizes = fit.free.iter().zip(self.dispersions(fit));
        let over = of_sizes.filter(|(p, _)| own.contains(p)).map(|(_, phi)| phi);
        2.0 * nats > MIN_SIGMAS * MIN_SIGMAS * over.fold(0.0, f64::max)
    }

    /// Gain of the `i`-th member on unseen halves of the drives, nats. Its own course is not taken
    /// out: what a half can take of it is no question of whether it is there.
    fn folds(&self, fit: &Fit, member: usize) -> f64 {
        if self.drives() < 2 {
            return f64::INFINITY;
        }
        let keep: Vec<usize> = (0..=fit.free.len()).collect();
        let others = fit.course.without(CATALOGUE[fit.set[member]].sizes);
        let Some(gram) = others.taken_out(&fit.whole, &keep, &fit.theta, self.zero()) else {
            return f64::NEG_INFINITY;
        };
        let zero = self.zero();
        let sigma = prior(&fit.free);
        // Shapes stay where they are: with them a size of nothing is no effect, as it is not along
        // the tangent of a threshold.
        let sizes = fit.sizes();
        let own = CATALOGUE[fit.set[member]].sizes;
        let all: Vec<usize> =
            (0..fit.free.len()).filter(|j| sizes.contains(&fit.free[*j])).collect();
        let others: Vec<usize> =
            all.iter().copied().filter(|j| !own.contains(&fit.free[*j])).collect();
        let x0 = DVector::from_fn(fit.free.len(), |j, _| {
            let p = fit.free[j];
            if all.contains(&j) { fit.theta[p as usize] - zero[p as usize] } else { 0.0 }
        });
        // Drives that say most about the member are dealt to the halves in turn; where one drive
        // alone says it (hot brakes once), no other can confirm it.
        let mut order: Vec<(usize, f64)> = about(fit, member).into_iter().enumerate().collect();
        order.sort_by(|x, y| y.1.total_cmp(&x.1));
        let total: f64 = order.iter().map(|o| o.1).sum();
        if order.first().is_none_or(|o| o.1 > LONELY * total) {
            return f64::INFINITY;
        }
        // 0, 1, 1, 0, 0, 1, ...: the halves get the like.
        let half = |d: usize| {
            order.iter().position(|o| o.0 == d).is_some_and(|rank| rank.div_ceil(2) % 2 == 1)
        };
        let mut gain = 0.0;
        for fold in [false, true] {
            let (a, b, _) = gram.sum(|d| half(d) != fold);
            let (at, bt, _) = gram.sum(|d| half(d) == fold);
            let (b, bt) = (&b + &a * &x0, &bt + &at * &x0);
            let score = |keep: &[usize]| -> Option<f64> {
                let s: Vec<f64> = keep.iter().map(|j| sigma[*j]).collect();
                let (_, x) =
                    evidence::linear(&evidence::sub(&a, keep), &evidence::pick(&b, keep), &s)?;
                let (at, bt) = (evidence::sub(&at, keep), evidence::pick(&bt, keep));
                Some(bt.dot(&x) - 0.5 * (&at * &x).dot(&x))
            };
            gain += score(&all).unwrap_or(0.0)
                - if others.is_empty() { 0.0 } else { score(&others).unwrap_or(0.0) };
        }
        gain
    }
}
