//! Forward selection of causes with refit, swap and drop.
//!
//! At every step all hypotheses outside the set are screened with the set's parameters free
//! (secant sensitivities at the fitted point, one Gram matrix), the best are refitted by
//! Gauss-Newton, and the best refit is taken if it beats the threshold: six nats for the first
//! cause, ten for a further one, or three thousandths of what was already explained in the same
//! modules, whichever is more. The relative rule stops helpers that patch the model-form error of a
//! large effect.

use nalgebra::{DMatrix, DVector};

use crate::hypothesis::CATALOGUE;
use crate::param::{P, PARAMS, Theta};
use crate::problem::{Direction, Gram, Problem};
use crate::replay::MODULES;
use crate::screen::{Candidate, Screen, outside};
use crate::stats::evidence;

/// Least evidence for a first cause, nats. Drives in order reach it with one of the catalogue's
/// causes once in some hundred times.
const MIN_FIRST: f64 = 6.0;
/// Least evidence for another cause, and for a first one that has a rival, nats.
pub(crate) const MIN_EVIDENCE: f64 = 10.0;
/// Part of the evidence already found in the same modules that another cause must add.
const RELATIVE_EVIDENCE: f64 = 0.003;
/// Part of the improvement that a step promises by which it may miss before the sensitivities are
/// taken anew.
const KEPT_PROMISE: f64 = 0.1;
/// Part of what it promises below which a step is compared with one of the newest member alone.
const BROKEN_PROMISE: f64 = 0.5;
/// Secant steps by which a threshold or a time constant may move at once: few samples lie about a
/// threshold, and far from it a fit gets stuck.
const SHAPE_STEPS: f64 = 4.0;
/// Hypotheses refitted per step.
const REFIT: usize = 4;
/// Evidence of a free function over that of causes above which these are searched no further.
const HOPELESS: f64 = 2.0;
/// Pairs refitted.
const PAIRS: usize = 3;

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

pub(crate) fn directions(free: &[P], theta: &Theta) -> Vec<Direction> {
    free.iter()
        .map(|p| {
            let s = p.spec();
            let up = theta[*p as usize] + s.step <= s.hi;
            Direction { p: *p, shape: Vec::new(), step: if up { s.step } else { -s.step } }
        })
        .collect()
}

pub(crate) fn prior(free: &[P]) -> Vec<f64> {
    free.iter().map(|p| p.spec().prior).collect()
}

/// Where a step leads, the fall of the cost, and what the linear model promised.
type Step = (Theta, f64, f64);

impl Problem<'_> {
    /// Fits the parameters of a set by Gauss-Newton with step halving, from `start`.
    pub(crate) fn fit(&self, set: &[usize], start: &Theta, zero_norm: f64) -> Option<Fit> {
        let zero = self.reference.theta;
        let free: Vec<P> =
            set.iter().flat_map(|h| CATALOGUE[*h].params()).filter(|p| !p.is_switch()).collect();
        let shapes: Vec<P> = set.iter().flat_map(|h| CATALOGUE[*h].shapes).copied().collect();
        let sigma = prior(&free);
        let cost = |norm: f64, t: &Theta| {
            norm + free
                .iter()
                .zip(&sigma)
                .map(|(p, s)| ((t[*p as usize] - zero[*p as usize]) / s).powi(2))
                .sum::<f64>()
        };
        let mut theta = *start;
        // Where the sensitivities were taken: they serve as long as steps do what they promise.
        let (mut from, mut along) = (theta, directions(&free, &theta));
        let (mut gram, mut chi) = self.gram(&theta, &along);
        let last = set.last().map(|h| &CATALOGUE[*h]);
        let newest: Vec<usize> = match last {
            Some(h) if set.len() > 1 => {
                (0..free.len()).filter(|j| h.params().any(|p| p == free[*j])).collect()
            }
            _ => Vec::new(),
        };
        let began = cost(gram.sum(|_| true).2, &theta);
        let mut best = began;
        for _ in 0..8 {
            if free.is_empty() {
                break;
            }
            let (mut a, mut b, _) = gram.sum(|_| true);
            for (j, (p, s)) in free.iter().zip(&sigma).enumerate() {
                a[(j, j)] += 1.0 / (s * s);
                b[j] -= (theta[*p as usize] - zero[*p as usize]) / (s * s);
            }
            let limited = |mut step: DVector<f64>| {
                for (p, d) in free.iter().zip(step.iter_mut()).filter(|(p, _)| shapes.contains(p)) {
                    let most = SHAPE_STEPS * p.spec().step;
                    *d = d.clamp(-most, most);
                }
                step
            };
            let after = |step: &DVector<f64>, factor: f64| -> Step {
                let mut t = theta;
                for (p, d) in free.iter().zip(step.iter()) {
                    let (s, i) = (p.spec(), *p as usize);
                    t[i] = (t[i] + factor * d).clamp(zero[i] + s.lo, zero[i] + s.hi);
                }
                let c = cost(self.gram(&t, &[]).0.sum(|_| true).2, &t);
                let curve = (&a * step).dot(step);
                (t, best - c, 2.0 * factor * b.dot(step) - factor * factor * curve)
            };
            let step = limited(a.clone().cholesky()?.solve(&b));
            let tried = [1.0, 0.35, 0.12, 0.043].iter().map(|f| after(&step, *f));
            let mut found: Option<Step> = tried.into_iter().find(|s| s.1 > 0.0);
            let promised = b.dot(&step);
            if found.is_none_or(|s| s.1 < BROKEN_PROMISE * promised) && !newest.is_empty() {
                // The others stand at a kink of theirs, where no common step helps.
                let (a, b) = (evidence::sub(&a, &newest), evidence::pick(&b, &newest));
                let own = a.cholesky()?.solve(&b);
                let mut alone = DVector::zeros(free.len());
                newest.iter().zip(own.iter()).for_each(|(j, d)| alone[*j] = *d);
                let alone = after(&limited(alone), 1.0);
                if alone.1 > found.map_or(0.0, |s| s.1) {
                    found = Some(alone);
                }
            }
            let Some((t, improved, promised)) = found else { break };
            (theta, best) = (t, best - improved);
            if (improved - promised).abs() > KEPT_PROMISE * promised {
                (from, along) = (theta, directions(&free, &theta));
            }
            (gram, chi) = self.gram_along(&theta, &from, &along);
            if improved < 0.3 + 1e-5 * (began - best) {
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

    /// The best set of causes among `open`. `bare` is the evidence of the best free function: where
    /// it stays far above that of two causes, others only patch what the catalogue does not have.
    pub(crate) fn search(
        &self,
        open: &[usize],
        max_causes: usize,
        bare: f64,
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
            if best.set.len() > 1 && bare > HOPELESS * best.log_z {
                return Some((empty, best));
            }
            best = self.drop_and_swap(best, open, zero_norm);
        }
        if bare < HOPELESS * best.log_z
            && let Some(better) = self.pair_step(&best, &empty, open, zero_norm)
        {
            best = self.drop_and_swap(better, open, zero_norm);
        }
        Some((empty, best))
    }

    /// Two causes at once where one at a time stops: every member in turn (or nothing) is replaced
    /// by the best pairs of the whole catalogue.
    fn pair_step(&self, best: &Fit, empty: &Fit, open: &[usize], zero_norm: f64) -> Option<Fit> {
        let screen = self.screen(best, &outside(best, open));
        let places: Vec<Option<usize>> =
            if best.set.is_empty() { vec![None] } else { (0..best.set.len()).map(Some).collect() };
        let mut pairs: Vec<(f64, Option<usize>, [Candidate; 2])> = Vec::new();
        for place in places {
            let lost = screen.lost(place);
            let found = screen.pairs(place).into_iter().filter(|p| p[0].gain > 0.85 * lost);
            pairs.extend(found.take(PAIRS).map(|p| (p[0].gain - lost, place, p)));
        }
        pairs.sort_by(|x, y| y.0.total_cmp(&x.0));
        let mut winner: Option<Fit> = None;
        for (_, place, pair) in pairs.iter().take(PAIRS) {
            let there = match place.map(|i| self.without(best, i)) {
                Some((fewer, theta)) if !fewer.is_empty() => self.fit(&fewer, &theta, zero_norm)?,
                _ => empty.clone(),
            };
            let Some(one) = self.with_added(&there, &pair[0], zero_norm) else { continue };
            let Some(both) = self.with_added(&one, &pair[1], zero_norm) else { continue };
            let needed = if both.set.len() > best.set.len() {
                self.threshold(&one, &both).max(self.threshold(best, &both))
            } else {
                1.0
            };
            if both.log_z > best.log_z + needed
                && winner.as_ref().is_none_or(|w| both.log_z > w.log_z)
            {
                winner = Some(both);
            }
        }
        winner
    }

    /// What `next` must add to `best`. What is added in modules of which much is explained may patch
    /// the form of a larger cause; the part that falls on other modules does not.
    fn threshold(&self, best: &Fit, next: &Fit) -> f64 {
        let Some(added) = next.set.iter().find(|h| !best.set.contains(h)) else {
            return f64::INFINITY;
        };
        if best.set.is_empty() {
            return MIN_FIRST;
        }
        let groups = CATALOGUE[*added].groups();
        let (mut there, mut adds, mut adds_apart) = (0.0, 0.0, 0.0);
        for m in groups.iter().flat_map(|g| g.modules()).map(|m| *m as usize) {
            let added = (next.explained[m] - best.explained[m]).max(0.0);
            there += best.explained[m].max(0.0);
            adds += added;
            if RELATIVE_EVIDENCE * best.explained[m] < MIN_EVIDENCE {
                adds_apart += added;
            }
        }
        // What the tolerances would have taken anyway was not explained by the set.
        let relative = RELATIVE_EVIDENCE * f64::min(there, best.log_z);
        let apart = MIN_EVIDENCE * adds / f64::max(adds_apart, f64::MIN_POSITIVE);
        MIN_EVIDENCE.max(relative.min(apart))
    }

    fn step(&self, best: &Fit, open: &[usize], zero_norm: f64) -> Option<Fit> {
        let candidates = self.screen(best, &outside(best, open)).singles(None);
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

    /// The set with a candidate added, fitted from its start; from all of its starts if its shape is
    /// a switch, which a fit holds, or one that gets stuck.
    pub(crate) fn with_added(&self, best: &Fit, c: &Candidate, zero_norm: f64) -> Option<Fit> {
        let hyp = &CATALOGUE[c.hypothesis];
        let starts = if hyp.shapes.iter().any(|p| p.is_switch() || p.is_stuck()) {
            hyp.starts
        } else {
            core::slice::from_ref(&c.start)
        };
        let mut set = best.set.clone();
        set.push(c.hypothesis);
        let fits = starts.iter().filter_map(|start| {
            let mut theta = best.theta;
            for (p, start) in hyp.shapes.iter().zip(start) {
                theta[*p as usize] = *start;
            }
            for (p, linear) in hyp.sizes.iter().zip(&c.sizes) {
                let s = p.spec();
                let little = 0.5 * s.step * if hyp.sign < 0.0 { -1.0 } else { 1.0 };
                // The sign of what is not linear decides where a fit ends.
                let from = if hyp.nonlinear() { linear.clamp(s.lo, s.hi) } else { little };
                theta[*p as usize] = self.reference.theta[*p as usize] + from;
            }
            self.fit(&set, &theta, zero_norm)
        });
        fits.max_by(|x, y| x.log_z.total_cmp(&y.log_z))
    }

    /// Drops members that no longer pay, then tries another hypothesis in every place.
    fn drop_and_swap(&self, mut best: Fit, open: &[usize], zero_norm: f64) -> Fit {
        for round in 0..2 {
            let mut changed = false;
            let mut screen: Option<Screen> = None;
            let mut i = 0;
            while best.set.len() > 1 && i < best.set.len() {
                let (fewer, theta) = self.without(&best, i);
                let Some(f) = self.fit(&fewer, &theta, zero_norm) else {
                    i += 1;
                    continue;
                };
                if best.log_z - f.log_z < self.threshold(&f, &best) {
                    (best, screen) = (f, None);
                    changed = true;
                    continue;
                }
                if round == 0 {
                    let screen_of = || self.screen(&best, &outside(&best, open));
                    let alternatives = screen.get_or_insert_with(screen_of).singles(Some(i));
                    for c in alternatives.iter().take(2) {
                        if f.log_z + c.gain < best.log_z - 20.0 - 0.1 * (best.log_z - f.log_z) {
                            continue;
                        }
                        if let Some(s) = self.with_added(&f, c, zero_norm)
                            && s.log_z > best.log_z + 1.0
                        {
                            (best, screen) = (s, None);
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
