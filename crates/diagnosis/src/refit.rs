//! The parameters of a set of causes by Gauss-Newton, and the evidence of the set.

use nalgebra::{DMatrix, DVector};

use crate::course::Course;
use crate::evidence::Evidence;
use crate::hypothesis::CATALOGUE;
use crate::param::{P, PARAMS, Theta};
use crate::problem::{Direction, Gram, moves};
use crate::stats::evidence;

/// Part of the improvement that a step promises by which it may miss before the sensitivities are
/// taken anew.
const KEPT_PROMISE: f64 = 0.1;
/// Part of what it promises below which a step is compared with one of the newest member alone.
const BROKEN_PROMISE: f64 = 0.5;
/// Gauss-Newton steps of a fit at the most.
const MOST_STEPS: usize = 8;
/// Shares of a step that are tried, one after the other.
const HALVINGS: [f64; 4] = [1.0, 0.35, 0.12, 0.043];
/// Secant steps by which a threshold or a time constant may move at once: few samples lie about a
/// threshold, and far from it a fit gets stuck.
const SHAPE_STEPS: f64 = 4.0;
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
    pub(crate) course: Course,
    /// Residual norm at the fit.
    pub(crate) norm: f64,
}

impl Fit {
    /// Sizes of the causes.
    pub(crate) fn sizes(&self) -> Vec<P> {
        self.set.iter().flat_map(|h| CATALOGUE[*h].sizes).copied().collect()
    }
}

pub(crate) fn directions(free: &[P], theta: &Theta) -> Vec<Direction> {
    free.iter()
        .map(|p| {
            let s = p.spec();
            let up = theta[*p as usize] + s.step <= s.hi;
            Direction::new(*p, Vec::new(), if up { s.step } else { -s.step })
        })
        .collect()
}

pub(crate) fn prior(free: &[P]) -> Vec<f64> {
    free.iter().map(|p| p.spec().prior).collect()
}

/// What is known of a parameter before the drives: a normal distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prior {
    pub(crate) mean: f64,
    pub(crate) sigma: f64,
}

impl Prior {
    /// How a parameter pulls on the cost, in deviations over its spread.
    pub(crate) fn pull(self, value: f64) -> f64 {
        (value - self.mean) / (self.sigma * self.sigma)
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

/// The normal equations at a point, priors included.
struct Normal {
    a: DMatrix<f64>,
    b: DVector<f64>,
}

/// The parameters that a set frees, with their priors about the reference.
struct Free {
    params: Vec<P>,
    priors: Vec<Prior>,
    /// Those of them that are sizes of causes: these have a course.
    sizes: Vec<P>,
    /// Those of them that are shapes: they move by a few secant steps at once.
    shapes: Vec<P>,
    /// Places of those of the member that came last, if others were there before.
    newest: Vec<usize>,
    zero: Theta,
}

impl Free {
    fn of(set: &[usize], zero: Theta) -> Self {
        let params: Vec<P> =
            set.iter().flat_map(|h| CATALOGUE[*h].params()).filter(|p| !p.is_switch()).collect();
        let newest = match set {
            [_, .., last] => {
                let own = |j: &usize| CATALOGUE[*last].params().any(|p| p == params[*j]);
                (0..params.len()).filter(own).collect()
            }
            _ => Vec::new(),
        };
        let shapes = set.iter().flat_map(|h| CATALOGUE[*h].shapes).copied().collect();
        let sizes = set.iter().flat_map(|h| CATALOGUE[*h].sizes).copied().collect();
        let priors = params
            .iter()
            .map(|p| Prior { mean: zero[*p as usize], sigma: p.spec().prior })
            .collect();
        Self { priors, params, sizes, shapes, newest, zero }
    }

    /// Figures rather than causes, each with a prior of its own.
    fn figures(figures: &[(P, Prior)], zero: Theta) -> Self {
        let (params, priors) = figures.iter().copied().unzip();
        let (sizes, shapes, newest) = Default::default();
        Self { params, priors, sizes, shapes, newest, zero }
    }

    /// Squared residual and prior.
    fn cost(&self, norm: f64, theta: &Theta) -> f64 {
        let priors = self.params.iter().zip(&self.priors);
        norm + priors.map(|(p, q)| ((theta[*p as usize] - q.mean) / q.sigma).powi(2)).sum::<f64>()
    }

    /// The directions of the parameters from a point, and of the courses of the sizes.
    fn along(&self, theta: &Theta) -> Along {
        let mut directions = directions(&self.params, theta);
        let course = Course::of(&self.sizes, &mut directions);
        Along { from: *theta, directions, course }
    }

    fn normal(&self, gram: &Gram, theta: &Theta) -> Normal {
        let (mut a, mut b, _) = gram.total();
        for (j, (p, q)) in self.params.iter().zip(&self.priors).enumerate() {
            a[(j, j)] += 1.0 / (q.sigma * q.sigma);
            b[j] -= q.pull(theta[*p as usize]);
        }
        Normal { a, b }
    }

    /// Covariance and evidence where a fit stands (Laplace).
    fn laplace(&self, at: &Standing, zero_norm: f64) -> Option<(DMatrix<f64>, f64)> {
        let sigma: Vec<f64> = self.priors.iter().map(|p| p.sigma).collect();
        let (covariance, log_det) = evidence::posterior(&at.gram.total().0, &sigma)?;
        Some((covariance, 0.5 * (zero_norm - at.cost) - 0.5 * log_det))
    }

    /// A step whose shapes move no further than their secants serve.
    fn limited(&self, mut step: DVector<f64>) -> DVector<f64> {
        for (p, d) in self.params.iter().zip(step.iter_mut()) {
            if self.shapes.contains(p) {
                let most = SHAPE_STEPS * p.spec().step;
                *d = d.clamp(-most, most);
            }
        }
        step
    }

    /// The step that solves the normal equations, without the parameters that would leave their
    /// bounds at once: a step with them leads nowhere.
    fn solved(&self, Normal { a, b }: &Normal, theta: &Theta) -> Option<DVector<f64>> {
        let mut inside: Vec<usize> = (0..self.params.len()).collect();
        loop {
            let (own_a, own_b) = (evidence::sub(a, &inside), evidence::pick(b, &inside));
            let own = own_a.cholesky()?.solve(&own_b);
            let leaves = |(j, d): (&usize, &f64)| {
                let p = self.params[*j];
                let (s, x) = (p.spec(), theta[p as usize] - self.zero[p as usize]);
                x <= s.lo && *d < 0.0 || x >= s.hi && *d > 0.0
            };
            let stay = inside.iter().zip(own.iter()).filter(|x| !leaves(*x));
            let left: Vec<usize> = stay.map(|(j, _)| *j).collect();
            if left.len() == inside.len() || left.is_empty() {
                let mut step = DVector::zeros(self.params.len());
                inside.iter().zip(own.iter()).for_each(|(j, d)| step[*j] = *d);
                return Some(step);
            }
            inside = left;
        }
    }

    /// `factor` of a step from `theta`, within the bounds.
    fn moved(&self, theta: &Theta, step: &DVector<f64>, factor: f64) -> Theta {
        let mut to = *theta;
        for (p, d) in self.params.iter().zip(step.iter()) {
            let (s, i) = (p.spec(), *p as usize);
            to[i] = (to[i] + factor * d).clamp(self.zero[i] + s.lo, self.zero[i] + s.hi);
        }
        to
    }
}

/// Where and along what sensitivities were taken: they serve as long as steps do what they promise.
struct Along {
    from: Theta,
    directions: Vec<Direction>,
    course: Course,
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
            if free.laplace(&at, zero_norm).map(most).is_some_and(|z| z < beyond.least) {
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
        let (covariance, log_z) = free.laplace(&at, zero_norm)?;
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
            course: at.along.course,
            norm,
        })
    }
}
