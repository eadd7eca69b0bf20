//! Forward selection of causes with refit, swap and drop.
//!
//! At every step all hypotheses outside the set are screened with the set's parameters free
//! (secant sensitivities at the fitted point, one Gram matrix), the best are refitted by
//! Gauss-Newton, and the best refit is taken if it beats the threshold: ten nats, or one percent
//! of what was already explained in the same modules, whichever is more. The relative rule stops
//! helpers that patch the model-form error of a large effect.

use nalgebra::{DMatrix, DVector};

use crate::hypothesis::{CATALOGUE, Hypothesis, Start};
use crate::param::{P, PARAMS, Theta};
use crate::problem::{Direction, Gram, Problem};
use crate::replay::MODULES;
use crate::stats::evidence;

/// Least evidence for another cause, nats.
pub(crate) const MIN_EVIDENCE: f64 = 10.0;
/// Part of the evidence already found in the same modules that another cause must add.
pub(crate) const RELATIVE_EVIDENCE: f64 = 0.01;
/// Sigmas by which a size must differ from nothing, once the drives' disagreement counts.
const MIN_SIGMAS: f64 = 2.6;
/// How many drives' worth the expectation counts that drives scatter as their information says.
const DISPERSION_PRIOR: f64 = 4.0;
/// Hypotheses refitted per step.
const REFIT: usize = 4;

/// A set of causes, fitted.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    /// Indices into the catalogue.
    pub(crate) set: Vec<usize>,
    pub(crate) theta: Theta,
    /// Half the drop of the marginal residual norm minus the prior's cost.
    pub(crate) log_z: f64,
    /// Free parameters in the order of the set.
    pub(crate) free: Vec<P>,
    pub(crate) covariance: DMatrix<f64>,
    pub(crate) gram: Gram,
    /// Residual norm at the fit.
    pub(crate) norm: f64,
    /// Half the fall of the squared residual per module, nats.
    pub(crate) explained: [f64; MODULES],
}

/// A hypothesis that was tried for the next place.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) hypothesis: usize,
    pub(crate) start: Start,
    /// Gain over the present set, nats, linear.
    pub(crate) gain: f64,
}

fn directions(free: &[P], theta: &Theta) -> Vec<Direction> {
    free.iter()
        .map(|p| {
            let s = p.spec();
            let up = theta[*p as usize] + s.step <= s.hi;
            Direction { p: *p, shape: Vec::new(), step: if up { s.step } else { -s.step } }
        })
        .collect()
}

fn prior(free: &[P]) -> Vec<f64> {
    free.iter().map(|p| p.spec().prior).collect()
}

impl Problem<'_> {
    /// Fits the parameters of a set by Gauss-Newton with step halving, from `start`.
    pub(crate) fn fit(&self, set: &[usize], start: &Theta, zero_norm: f64) -> Option<Fit> {
        let zero = self.reference.theta;
        let free: Vec<P> = set.iter().flat_map(|h| CATALOGUE[*h].params()).collect();
        let sigma = prior(&free);
        let cost = |norm: f64, t: &Theta| {
            norm + free
                .iter()
                .zip(&sigma)
                .map(|(p, s)| ((t[*p as usize] - zero[*p as usize]) / s).powi(2))
                .sum::<f64>()
        };
        let mut theta = *start;
        let (mut gram, mut chi) = self.gram(&theta, &directions(&free, &theta));
        let mut best = cost(gram.sum(|_| true).2, &theta);
        for _ in 0..8 {
            if free.is_empty() {
                break;
            }
            let (mut a, mut b, _) = gram.sum(|_| true);
            for (j, (p, s)) in free.iter().zip(&sigma).enumerate() {
                a[(j, j)] += 1.0 / (s * s);
                b[j] -= (theta[*p as usize] - zero[*p as usize]) / (s * s);
            }
            let step = a.cholesky()?.solve(&b);
            let mut factor = 1.0;
            let mut improved = 0.0;
            for _ in 0..4 {
                let mut t = theta;
                for (p, d) in free.iter().zip(step.iter()) {
                    let s = p.spec();
                    let i = *p as usize;
                    t[i] = (t[i] + factor * d).clamp(zero[i] + s.lo, zero[i] + s.hi);
                }
                let c = cost(self.gram(&t, &[]).0.sum(|_| true).2, &t);
                if c < best {
                    improved = best - c;
                    (theta, best) = (t, c);
                    (gram, chi) = self.gram(&theta, &directions(&free, &theta));
                    break;
                }
                factor *= 0.35;
            }
            if improved < 0.3 + 1e-5 * (zero_norm - best).abs() {
                break;
            }
        }
        let (a, _, norm) = gram.sum(|_| true);
        let k = free.len();
        let scaled = DMatrix::from_fn(k, k, |i, j| {
            sigma[i] * a[(i, j)] * sigma[j] + if i == j { 1.0 } else { 0.0 }
        });
        let chol = scaled.cholesky()?;
        let log_det: f64 = 2.0 * (0..k).map(|i| chol.l()[(i, i)].ln()).sum::<f64>();
        let inverse = chol.inverse();
        let covariance = DMatrix::from_fn(k, k, |i, j| sigma[i] * inverse[(i, j)] * sigma[j]);
        let log_z = 0.5 * (zero_norm - best) - 0.5 * log_det;
        let zero = self.chi_at_reference();
        let explained = core::array::from_fn(|m| 0.5 * (zero[m] - chi[m]));
        Some(Fit { set: set.to_vec(), theta, log_z, free, covariance, gram, norm, explained })
    }

    /// Variances of the free parameters, widened by what the drives disagree about.
    ///
    /// The drives' score contributions `s_i` scatter as the information says if the model's form
    /// and tolerances are right; the ratio of both is the over-dispersion (the sandwich estimate
    /// with drives as clusters: Liang and Zeger, Biometrika 73, 1986). Six drives know that ratio
    /// poorly, so it is drawn towards one by [`DISPERSION_PRIOR`] drives' worth, and the interval
    /// gets the t-factor of what is left.
    pub(crate) fn variances(&self, fit: &Fit) -> Vec<f64> {
        let zero = &self.reference.theta;
        let sigma = prior(&fit.free);
        let (k, drives) = (fit.free.len(), fit.gram.per_drive.len() as f64);
        let pull = DVector::from_fn(k, |j, _| {
            let p = fit.free[j] as usize;
            (fit.theta[p] - zero[p]) / (sigma[j] * sigma[j] * drives)
        });
        let (mut seen, mut expected) = (vec![0.0; k], vec![0.0; k]);
        for g in &fit.gram.per_drive {
            let a = g.view((1, 1), (k, k));
            let score = g.view((1, 0), (k, 1)).column(0) - &pull;
            let moved = &fit.covariance * score;
            let spread = &fit.covariance * a * &fit.covariance;
            for j in 0..k {
                seen[j] += moved[j] * moved[j];
                expected[j] += spread[(j, j)];
            }
        }
        let freedom = drives - 1.0 + DISPERSION_PRIOR;
        let t_factor = 1.0 + 1.2 / freedom;
        (0..k)
            .map(|j| {
                let ratio = seen[j] / expected[j].max(f64::MIN_POSITIVE) * drives;
                let dispersion = (DISPERSION_PRIOR + ratio) / freedom;
                fit.covariance[(j, j)] * dispersion.max(0.8) * t_factor * t_factor
            })
            .collect()
    }

    /// Gains of all hypotheses in `open` at the fit, best first.
    pub(crate) fn screen(&self, fit: &Fit, open: &[usize]) -> Vec<Candidate> {
        let mut dirs = directions(&fit.free, &fit.theta);
        let k = dirs.len();
        let mut columns: Vec<(usize, Start, Vec<usize>)> = Vec::new();
        for h in open {
            let hyp = &CATALOGUE[*h];
            for start in hyp.starts {
                let shape: Vec<(P, f64)> = hyp.shapes.iter().copied().zip(*start).collect();
                let mut at = Vec::new();
                for p in hyp.sizes {
                    at.push(dirs.len());
                    let step = p.spec().step;
                    dirs.push(Direction { p: *p, shape: shape.clone(), step });
                    if hyp.nonlinear() {
                        dirs.push(Direction { p: *p, shape: shape.clone(), step: -step });
                    }
                }
                if hyp.nonlinear() {
                    let base = at[0];
                    for signs in [[0, 2], [0, 3], [1, 2], [1, 3]] {
                        columns.push((*h, *start, signs.iter().map(|s| base + s).collect()));
                    }
                } else {
                    columns.push((*h, *start, at));
                }
            }
        }
        let (gram, _) = self.gram(&fit.theta, &dirs);
        let (a, b, _) = gram.sum(|_| true);
        let zero = &self.reference.theta;
        let base = self.linear(fit, &a, &b, &(0..k).collect::<Vec<_>>(), &dirs, zero);
        let mut out: Vec<Candidate> = columns
            .iter()
            .filter_map(|(h, start, cols)| {
                let keep: Vec<usize> = (0..k).chain(cols.iter().copied()).collect();
                let (z, x) = self.linear(fit, &a, &b, &keep, &dirs, zero)?;
                let hyp: &Hypothesis = &CATALOGUE[*h];
                let size = x[k];
                let wrong_sign = hyp.sign != 0.0 && size * hyp.sign < 0.0;
                let gain = z - base.as_ref().map_or(0.0, |b| b.0);
                (!wrong_sign).then_some(Candidate { hypothesis: *h, start: *start, gain })
            })
            .collect();
        out.sort_by(|x, y| y.gain.total_cmp(&x.gain));
        out
    }

    /// Linear evidence around the fit with the prior centred at no effect.
    fn linear(
        &self,
        fit: &Fit,
        a: &DMatrix<f64>,
        b: &DVector<f64>,
        keep: &[usize],
        dirs: &[Direction],
        zero: &Theta,
    ) -> Option<(f64, DVector<f64>)> {
        let ps: Vec<P> = keep.iter().map(|i| dirs[*i].p).collect();
        let (a, b) = (evidence::sub(a, keep), evidence::pick(b, keep));
        // Residual at zero in the linear model: r0 = r + G (theta - zero) for the free ones.
        let k = fit.free.len();
        let shift = DVector::from_fn(ps.len(), |i, _| {
            if i < k { fit.theta[ps[i] as usize] - zero[ps[i] as usize] } else { 0.0 }
        });
        let b0 = &b + &a * &shift;
        let (z, x) = evidence::linear(&a, &b0, &prior(&ps))?;
        Some((z, x))
    }

    /// The best set of causes from the catalogue without `excluded` and what cannot be observed.
    pub(crate) fn search(
        &self,
        open: &[usize],
        max_causes: usize,
        progress: &mut dyn FnMut(usize),
    ) -> Option<(Fit, Fit)> {
        let zero = self.reference.theta;
        let (g, _) = self.gram(&zero, &[]);
        let zero_norm = g.sum(|_| true).2;
        let empty = self.fit(&[], &zero, zero_norm)?;
        let mut best = empty.clone();
        while best.set.len() < max_causes {
            progress(best.set.len());
            let Some(next) = self.step(&best, open, zero_norm) else { break };
            if next.log_z - best.log_z < self.threshold(&best, &next) {
                break;
            }
            best = next;
            best = self.drop_and_swap(best, open, zero_norm);
        }
        Some((empty, best))
    }

    /// What `next` must add to `best`.
    fn threshold(&self, best: &Fit, next: &Fit) -> f64 {
        let Some(added) = next.set.iter().find(|h| !best.set.contains(h)) else {
            return f64::INFINITY;
        };
        let there: f64 = CATALOGUE[*added]
            .groups()
            .iter()
            .flat_map(|g| g.modules())
            .map(|m| best.explained[*m as usize].max(0.0))
            .sum();
        let relative = if best.set.is_empty() { 0.0 } else { RELATIVE_EVIDENCE * there };
        MIN_EVIDENCE.max(relative)
    }

    fn step(&self, best: &Fit, open: &[usize], zero_norm: f64) -> Option<Fit> {
        let rest: Vec<usize> = open
            .iter()
            .copied()
            .filter(|h| best.set.iter().all(|s| CATALOGUE[*s].id != CATALOGUE[*h].id))
            .collect();
        let candidates = self.screen(best, &rest);
        let top = candidates.first()?.gain;
        let mut tried: Vec<usize> = Vec::new();
        let mut winner: Option<Fit> = None;
        for c in &candidates {
            let hyp = &CATALOGUE[c.hypothesis];
            let again = tried.contains(&c.hypothesis);
            if again || (tried.len() >= REFIT && !hyp.nonlinear()) {
                continue;
            }
            let least = if hyp.nonlinear() { 0.15 } else { 0.3 };
            if c.gain < least * top && !(best.set.is_empty() && hyp.nonlinear()) {
                continue;
            }
            if c.gain < 2.0 {
                continue;
            }
            tried.push(c.hypothesis);
            if let Some(f) = self.with_added(best, c, zero_norm)
                && winner.as_ref().is_none_or(|w| f.log_z > w.log_z)
            {
                winner = Some(f);
            }
        }
        winner
    }

    pub(crate) fn with_added(&self, best: &Fit, c: &Candidate, zero_norm: f64) -> Option<Fit> {
        let hyp = &CATALOGUE[c.hypothesis];
        let mut set = best.set.clone();
        set.push(c.hypothesis);
        let mut theta = best.theta;
        for (p, start) in hyp.shapes.iter().zip(c.start) {
            theta[*p as usize] = start;
        }
        for p in hyp.sizes {
            theta[*p as usize] = self.reference.theta[*p as usize]
                + 0.5 * p.spec().step * if hyp.sign < 0.0 { -1.0 } else { 1.0 };
        }
        self.fit(&set, &theta, zero_norm)
    }

    /// Drops members that no longer pay, then tries another hypothesis in every place.
    fn drop_and_swap(&self, mut best: Fit, open: &[usize], zero_norm: f64) -> Fit {
        for round in 0..2 {
            let mut changed = false;
            let mut i = 0;
            while best.set.len() > 1 && i < best.set.len() {
                let (fewer, theta) = self.without(&best, i);
                let Some(f) = self.fit(&fewer, &theta, zero_norm) else {
                    i += 1;
                    continue;
                };
                if best.log_z - f.log_z < self.threshold(&f, &best) {
                    best = f;
                    changed = true;
                    continue;
                }
                if round == 0 {
                    let rest: Vec<usize> = open
                        .iter()
                        .copied()
                        .filter(|h| best.set.iter().all(|s| CATALOGUE[*s].id != CATALOGUE[*h].id))
                        .collect();
                    let alternatives = self.screen(&f, &rest);
                    for c in alternatives.iter().take(2) {
                        if f.log_z + c.gain < best.log_z - 20.0 - 0.1 * (best.log_z - f.log_z) {
                            continue;
                        }
                        if let Some(s) = self.with_added(&f, c, zero_norm)
                            && s.log_z > best.log_z + 1.0
                        {
                            best = s;
                            changed = true;
                            break;
                        }
                    }
                }
                i += 1;
            }
            if !changed {
                break;
            }
        }
        best
    }

    /// The set without its `i`-th member, and a start for its refit.
    pub(crate) fn without(&self, fit: &Fit, i: usize) -> (Vec<usize>, Theta) {
        let mut set = fit.set.clone();
        let gone = set.remove(i);
        let mut theta = fit.theta;
        for p in CATALOGUE[gone].params() {
            theta[p as usize] = self.reference.theta[p as usize];
        }
        debug_assert_eq!(theta.len(), PARAMS);
        (set, theta)
    }
}

impl Problem<'_> {
    /// Information about the first size of every hypothesis at the reference, best start.
    pub(crate) fn information(&self) -> Vec<f64> {
        let mut dirs = Vec::new();
        let mut owner = Vec::new();
        for (i, h) in CATALOGUE.iter().enumerate() {
            for start in h.starts {
                let shape = h.shapes.iter().copied().zip(*start).collect();
                let p = h.sizes[0];
                dirs.push(Direction { p, shape, step: p.spec().step });
                owner.push(i);
            }
        }
        let (gram, _) = self.gram(&self.reference.theta, &dirs);
        let (a, _, _) = gram.sum(|_| true);
        let mut out = vec![0.0_f64; CATALOGUE.len()];
        for (j, i) in owner.iter().enumerate() {
            out[*i] = out[*i].max(a[(j, j)]);
        }
        out
    }

    /// Takes out causes that are too small for a word, within the drives' disagreement, or that do not pay on drives they were not
    /// fitted to (two folds of whole drives, linear refit around the joint fit).
    pub(crate) fn gate(&self, fit: Fit, empty: &Fit, _open: &[usize]) -> Fit {
        let mut fit = fit;
        let mut i = 0;
        while i < fit.set.len() {
            let hyp = &CATALOGUE[fit.set[i]];
            let size = hyp.size(&fit.theta, &self.reference.theta).abs();
            let small = size < 0.25 * hyp.min_size || !self.stands_out(&fit, i);
            if small || self.folds(&fit, i) < 3.0 {
                let (set, theta) = self.without(&fit, i);
                match self.fit(&set, &theta, empty.norm) {
                    Some(f) => fit = f,
                    None => return empty.clone(),
                }
                i = 0;
            } else {
                i += 1;
            }
        }
        fit
    }

    /// A size of the `i`-th member is beyond what the drives disagree about.
    fn stands_out(&self, fit: &Fit, member: usize) -> bool {
        let variances = self.variances(fit);
        let sizes = CATALOGUE[fit.set[member]].sizes;
        fit.free.iter().zip(&variances).any(|(p, v)| {
            let x = fit.theta[*p as usize] - self.reference.theta[*p as usize];
            sizes.contains(p) && x.abs() > MIN_SIGMAS * v.sqrt()
        })
    }

    /// Gain of the `i`-th member on unseen halves of the drives, nats.
    fn folds(&self, fit: &Fit, member: usize) -> f64 {
        if self.drives.len() < 2 {
            return f64::INFINITY;
        }
        let zero = &self.reference.theta;
        let sigma = prior(&fit.free);
        let own: Vec<bool> =
            fit.free.iter().map(|p| CATALOGUE[fit.set[member]].params().any(|q| q == *p)).collect();
        let x0 = DVector::from_iterator(
            fit.free.len(),
            fit.free.iter().map(|p| fit.theta[*p as usize] - zero[*p as usize]),
        );
        let others: Vec<usize> = (0..own.len()).filter(|j| !own[*j]).collect();
        let all: Vec<usize> = (0..own.len()).collect();
        let mut gain = 0.0;
        for fold in 0..2 {
            let (a, b, _) = fit.gram.sum(|d| d % 2 != fold);
            let (at, bt, _) = fit.gram.sum(|d| d % 2 == fold);
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
