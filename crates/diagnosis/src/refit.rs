//! The parameters of a set of causes by Gauss-Newton, and the evidence of the set.

use nalgebra::{DMatrix, DVector};

use crate::hypothesis::CATALOGUE;
use crate::param::{P, Theta};
use crate::problem::{Direction, Gram, Problem};
use crate::replay::MODULES;
use crate::stats::evidence;

/// Part of the improvement that a step promises by which it may miss before the sensitivities are
/// taken anew.
const KEPT_PROMISE: f64 = 0.1;
/// Part of what it promises below which a step is compared with one of the newest member alone.
const BROKEN_PROMISE: f64 = 0.5;
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
}
