//! What a set of causes frees: parameters with priors and bounds, and the directions along which they
//! are sensed.

use nalgebra::{DMatrix, DVector};

use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{P, Theta};
use crate::problem::course::Course;
use crate::problem::stats::evidence;
use crate::problem::{Direction, Gram};

/// Secant steps by which a threshold or a time constant may move at once: few samples lie about a
/// threshold, and far from it a fit gets stuck.
const SHAPE_STEPS: f64 = 4.0;

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

/// The normal equations at a point, priors included.
pub(crate) struct Normal {
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DVector<f64>,
}

/// The parameters that a set frees, with their priors about the reference.
pub(crate) struct Free {
    pub(crate) params: Vec<P>,
    pub(crate) priors: Vec<Prior>,
    /// Those of them that are sizes of causes: these have a course.
    sizes: Vec<P>,
    /// Those of them that are shapes: they move by a few secant steps at once.
    shapes: Vec<P>,
    /// Places of those of the member that came last, if others were there before.
    pub(crate) newest: Vec<usize>,
    pub(crate) zero: Theta,
}

impl Free {
    pub(crate) fn of(set: &[usize], zero: Theta) -> Self {
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
    pub(crate) fn figures(figures: &[(P, Prior)], zero: Theta) -> Self {
        let (params, priors) = figures.iter().copied().unzip();
        let (sizes, shapes, newest) = Default::default();
        Self { params, priors, sizes, shapes, newest, zero }
    }

    /// Squared residual and prior.
    pub(crate) fn cost(&self, norm: f64, theta: &Theta) -> f64 {
        let priors = self.params.iter().zip(&self.priors);
        norm + priors.map(|(p, q)| ((theta[*p as usize] - q.mean) / q.sigma).powi(2)).sum::<f64>()
    }

    /// The directions of the parameters from a point, and of the courses of the sizes.
    pub(crate) fn along(&self, theta: &Theta) -> Along {
        let mut directions = directions(&self.params, theta);
        let course = Course::of(&self.sizes, &mut directions);
        Along { from: *theta, directions, course }
    }

    pub(crate) fn normal(&self, gram: &Gram, theta: &Theta) -> Normal {
        let (mut a, mut b, _) = gram.total();
        for (j, (p, q)) in self.params.iter().zip(&self.priors).enumerate() {
            a[(j, j)] += 1.0 / (q.sigma * q.sigma);
            b[j] -= q.pull(theta[*p as usize]);
        }
        Normal { a, b }
    }

    /// Covariance and evidence (Laplace) where the cost has fallen by `drop`.
    pub(crate) fn laplace(&self, gram: &Gram, drop: f64) -> Option<(DMatrix<f64>, f64)> {
        let sigma: Vec<f64> = self.priors.iter().map(|p| p.sigma).collect();
        let (covariance, log_det) = evidence::posterior(&gram.total().0, &sigma)?;
        Some((covariance, 0.5 * drop - 0.5 * log_det))
    }

    /// A step whose shapes move no further than their secants serve.
    pub(crate) fn limited(&self, mut step: DVector<f64>) -> DVector<f64> {
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
    pub(crate) fn solved(&self, Normal { a, b }: &Normal, theta: &Theta) -> Option<DVector<f64>> {
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
    pub(crate) fn moved(&self, theta: &Theta, step: &DVector<f64>, factor: f64) -> Theta {
        let mut to = *theta;
        for (p, d) in self.params.iter().zip(step.iter()) {
            let (s, i) = (p.spec(), *p as usize);
            to[i] = (to[i] + factor * d).clamp(self.zero[i] + s.lo, self.zero[i] + s.hi);
        }
        to
    }
}

/// Where and along what sensitivities were taken: they serve as long as steps do what they promise.
pub(crate) struct Along {
    pub(crate) from: Theta,
    pub(crate) directions: Vec<Direction>,
    pub(crate) course: Course,
}
