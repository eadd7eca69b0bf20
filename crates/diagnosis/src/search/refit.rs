//! The parameters of a set of causes by Gauss-Newton, and the evidence of the set.

use nalgebra::{DMatrix, DVector};

use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{P, PARAMS, Theta};
use crate::problem::stats::evidence;
use crate::problem::{Gram, moves};
use crate::search::evidence::Evidence;
use crate::search::free::{Along, Free, Normal, Prior};

/// Part of the improvement that a step promises by which it may miss before the sensitivities are
/// taken anew.
const KEPT_PROMISE: f64 = 0.1;
/// Part of what it promises below which a step is compared with one of the newest member alone.
const BROKEN_PROMISE: f64 = 0.5;
/// Gauss-Newton steps of a fit at the most.
const MOST_STEPS: usize = 8;
/// Shares of a step that are tried, one after the other.
const HALVINGS: [f64; 4] = [1.0, 0.35, 0.12, 0.043];

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
    /// What was known of them before.
    pub(crate) priors: Vec<Prior>,
    pub(crate) covariance: DMatrix<f64>,
    /// Over residual and parameters, the courses of the causes taken out.
    pub(crate) gram: Gram,
    /// The same and the hats of the courses, nothing taken out.
    pub(crate) whole: Gram,
    /// Residual norm at the fit.
    pub(crate) norm: f64,
}

impl Fit {
    /// Sizes of the causes.
    pub(crate) fn sizes(&self) -> Vec<P> {
        self.set.iter().flat_map(|h| CATALOGUE[*h].sizes).copied().collect()
    }
}

/// A step that was tried.
#[derive(Clone, Copy)]
struct Step {
    /// Where it leads.
    to: Theta,
    /// Fall of the cost.
    improved: f64,
    /// Fall that the linear model promised.
    promised: f64,
}

/// What a fit has to beat, and where fits of the same set have ended.
pub(crate) struct Beyond {
    /// Evidence, nats.
    pub(crate) least: f64,
    ended: Vec<Theta>,
}

impl Beyond {
    /// Only an evidence above `least` is of use.
    pub(crate) fn evidence(least: f64) -> Self {
        Self { least, ended: Vec::new() }
    }

    /// Whether a fit has ended within a standard deviation of a point: another one that comes there
    /// would end there too. `a` is the information about the parameters.
    fn is_known(&self, free: &Free, a: &DMatrix<f64>, to: &Theta) -> bool {
        self.ended.iter().any(|there| {
            let elsewhere =
                |i: usize| to[i] != there[i] && free.params.iter().all(|p| *p as usize != i);
            if (0..PARAMS).any(elsewhere) {
                return false;
            }
            let away = free.params.iter().map(|p| to[*p as usize] - there[*p as usize]);
            let away = DVector::from_iterator(free.params.len(), away);
            (a * &away).dot(&away) < 1.0
        })
    }
}

/// Where a fit stands.
struct Standing {
    theta: Theta,
    /// In the metric of the courses at `theta`.
    cost: f64,
    gram: Gram,
    whole: Gram,
    along: Along,
}

impl dyn Evidence + '_ {
    /// Fits the parameters of a set by Gauss-Newton with step halving, from `start`.
    pub(crate) fn fit(&self, set: &[usize], start: &Theta, zero_norm: f64) -> Option<Fit> {
        self.fit_beyond(set, start, zero_norm, &mut Beyond::evidence(f64::NEG_INFINITY))
    }

    /// The same where only an evidence beyond another is of use: `None` once the steps that are left,
    /// each as good as the last one, would not lead there, or one leads to where a fit has ended. What
    /// is found has to be beaten by the next.
    pub(crate) fn fit_beyond(
        &self,
        set: &[usize],
        start: &Theta,
        zero_norm: f64,
        beyond: &mut Beyond,
    ) -> Option<Fit> {
        let fit = self.fit_free(set, Free::of(set, *self.zero()), start, zero_norm, beyond)?;
        let is_better = fit.log_z > beyond.least;
        beyond.least = beyond.least.max(fit.log_z);
        is_better.then_some(fit)
    }

    /// Fits figures with priors of their own from where nothing is off.
    pub(crate) fn fit_figures(&self, figures: &[(P, Prior)]) -> Option<Fit> {
        let zero = *self.zero();
        let norm = self.gram(&zero, &[]).sum(|_| true).2;
        let mut beyond = Beyond::evidence(f64::NEG_INFINITY);
        self.fit_free(&[], Free::figures(figures, zero), &zero, norm, &mut beyond)
    }

    fn fit_free(
        &self,
        set: &[usize],
        free: Free,
        start: &Theta,
        zero_norm: f64,
        beyond: &mut Beyond,
    ) -> Option<Fit> {
        let mut at = self.stand(&free, start, free.along(start))?;
        let mut improved = 0.0;
        let steps = if free.params.is_empty() { 0 } else { MOST_STEPS };
        for left in (0..steps).rev() {
            let normal = free.normal(&at.gram, &at.theta);
            let Some(step) = self.best_step(&free, &at, &normal)? else { break };
            if beyond.is_known(&free, &normal.a, &step.to) {
                return None;
            }
            let kept = (step.improved - step.promised).abs() <= KEPT_PROMISE * step.promised;
            // Tolerances that are taken where a fit is need to be taken where it ends.
            let there = free.params.iter().any(|p| moves(*p));
            let along = if kept && !there { at.along } else { free.along(&step.to) };
            at = self.stand(&free, &step.to, along)?;
            improved += step.improved;
            let most = |(_, log_z): (_, f64)| log_z + 0.5 * left as f64 * step.improved;
            if free
                .laplace(&at.gram, zero_norm - at.cost)
                .map(most)
                .is_some_and(|z| z < beyond.least)
            {
                beyond.ended.push(at.theta);
                return None;
            }
            if step.improved < 0.3 + 1e-5 * improved {
                break;
            }
        }
        beyond.ended.push(at.theta);
        Self::fitted(set, free, at, zero_norm)
    }

    /// Gram matrix over residual and parameters, the courses of sizes of `at` taken out, and the
    /// whole one.
    fn seen(&self, free: &Free, theta: &Theta, along: &Along, at: &Theta) -> Option<[Gram; 2]> {
        let whole = self.gram_along(theta, &along.from, &along.directions);
        let keep: Vec<usize> = (0..=free.params.len()).collect();
        Some([along.course.taken_out(&whole, &keep, at, &free.zero)?, whole])
    }

    fn stand(&self, free: &Free, theta: &Theta, along: Along) -> Option<Standing> {
        let [gram, whole] = self.seen(free, theta, &along, theta)?;
        let cost = free.cost(gram.total().2, theta);
        Some(Standing { theta: *theta, cost, gram, whole, along })
    }

    /// The common step with halving, or the newest member's alone where that leads further; none
    /// where nothing improves. The outer `None`: the normal equations cannot be solved.
    fn best_step(&self, free: &Free, at: &Standing, normal: &Normal) -> Option<Option<Step>> {
        let (a, b) = (&normal.a, &normal.b);
        let tried = |step: &DVector<f64>, factor: f64| {
            let to = free.moved(&at.theta, step, factor);
            // Both ends of a step are compared in the metric of its beginning.
            let gram = self.seen(free, &to, &at.along, &at.theta);
            let cost = gram.map_or(f64::INFINITY, |g| free.cost(g[0].total().2, &to));
            let curve = (a * step).dot(step);
            let promised = 2.0 * factor * b.dot(step) - factor * factor * curve;
            Step { to, improved: at.cost - cost, promised }
        };
        let step = free.limited(free.solved(normal, &at.theta)?);
        let mut found =
            HALVINGS.iter().map(|factor| tried(&step, *factor)).find(|s| s.improved > 0.0);
        let poor = found.is_none_or(|s| s.improved < BROKEN_PROMISE * b.dot(&step));
        if poor && !free.newest.is_empty() {
            // The others stand at a kink of theirs, where no common step helps.
            let (own_a, own_b) = (evidence::sub(a, &free.newest), evidence::pick(b, &free.newest));
            let own = own_a.cholesky()?.solve(&own_b);
            let mut alone = DVector::zeros(free.params.len());
            free.newest.iter().zip(own.iter()).for_each(|(j, d)| alone[*j] = *d);
            let alone = tried(&free.limited(alone), 1.0);
            if alone.improved > found.map_or(0.0, |s| s.improved) {
                found = Some(alone);
            }
        }
        Some(found)
    }

    /// What a fit that has ended says.
    fn fitted(set: &[usize], free: Free, at: Standing, zero_norm: f64) -> Option<Fit> {
        let (covariance, log_z) = free.laplace(&at.gram, zero_norm - at.cost)?;
        let norm = at.gram.total().2;
        Some(Fit {
            set: set.to_vec(),
            theta: at.theta,
            log_z,
            free: free.params,
            priors: free.priors,
            covariance,
            gram: at.gram,
            whole: at.whole,
            norm,
        })
    }
}
