//! What every hypothesis, and every pair of hypotheses, would add to a fit: secant sensitivities at
//! the fitted point, one Gram matrix, linear evidence.

use nalgebra::{DMatrix, DVector};

use crate::hypothesis::{CATALOGUE, Start};
use crate::param::P;
use crate::problem::{Direction, Problem};
use crate::search::{Fit, directions, prior};
use crate::stats::evidence;

/// A hypothesis that was tried for the next place.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) hypothesis: usize,
    pub(crate) start: Start,
    /// Gain over the present set, nats, linear.
    pub(crate) gain: f64,
}

/// One way to try a hypothesis: its columns in a [`Screen`].
struct Trial {
    hypothesis: usize,
    start: Start,
    at: Vec<usize>,
}

/// Information and gradient of many directions at a fit; the fit's own parameters come first.
struct Screen {
    a: DMatrix<f64>,
    b: DVector<f64>,
    dirs: Vec<Direction>,
    columns: Vec<Trial>,
    /// Linear evidence of the fit's own parameters.
    base: f64,
}

/// Hypotheses of `open` whose id is not in the set.
pub(crate) fn outside(fit: &Fit, open: &[usize]) -> Vec<usize> {
    open.iter()
        .copied()
        .filter(|h| fit.set.iter().all(|s| CATALOGUE[*s].id != CATALOGUE[*h].id))
        .collect()
}

impl Problem<'_> {
    /// Gains of all hypotheses in `open` at the fit, best first.
    pub(crate) fn screen(&self, fit: &Fit, open: &[usize]) -> Vec<Candidate> {
        let screen = self.sensitivities(fit, open);
        let mut out: Vec<Candidate> = screen
            .columns
            .iter()
            .filter_map(|c| {
                let gain = self.linear_gain(fit, &screen, &[c])?;
                Some(Candidate { hypothesis: c.hypothesis, start: c.start, gain })
            })
            .collect();
        out.sort_by(|x, y| y.gain.total_cmp(&x.gain));
        out
    }

    /// Gains of all pairs of hypotheses in `open` at the fit, best first, one per pair of ids.
    pub(crate) fn screen_pairs(&self, fit: &Fit, open: &[usize]) -> Vec<[Candidate; 2]> {
        let screen = self.sensitivities(fit, open);
        let mut out: Vec<[Candidate; 2]> = Vec::new();
        for (i, x) in screen.columns.iter().enumerate() {
            for y in &screen.columns[..i] {
                if CATALOGUE[x.hypothesis].id == CATALOGUE[y.hypothesis].id {
                    continue;
                }
                if let Some(gain) = self.linear_gain(fit, &screen, &[x, y]) {
                    out.push([x, y].map(|c| Candidate {
                        hypothesis: c.hypothesis,
                        start: c.start,
                        gain,
                    }));
                }
            }
        }
        out.sort_by(|x, y| y[0].gain.total_cmp(&x[0].gain));
        let mut seen: Vec<[usize; 2]> = Vec::new();
        out.retain(|p| {
            let ids = [p[0].hypothesis, p[1].hypothesis];
            let new = !seen.contains(&ids);
            seen.push(ids);
            new
        });
        out
    }

    /// Gram matrix of the free parameters and of the directions of all hypotheses in `open`.
    fn sensitivities(&self, fit: &Fit, open: &[usize]) -> Screen {
        let mut dirs = directions(&fit.free, &fit.theta);
        let mut columns: Vec<Trial> = Vec::new();
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
                let mut trial =
                    |at: Vec<usize>| columns.push(Trial { hypothesis: *h, start: *start, at });
                if hyp.nonlinear() {
                    let base = at[0];
                    for signs in [[0, 2], [0, 3], [1, 2], [1, 3]] {
                        trial(signs.iter().map(|s| base + s).collect());
                    }
                } else {
                    trial(at);
                }
            }
        }
        let (gram, _) = self.gram(&fit.theta, &dirs);
        let (a, b, _) = gram.sum(|_| true);
        let k = fit.free.len();
        let own: Vec<usize> = (0..k).collect();
        let base = self.linear(fit, &a, &b, &own, &dirs).map_or(0.0, |x| x.0);
        Screen { a, b, dirs, columns, base }
    }

    /// What the trials add to the fit in the linear model; `None` where a sign is wrong.
    fn linear_gain(&self, fit: &Fit, screen: &Screen, trials: &[&Trial]) -> Option<f64> {
        let k = fit.free.len();
        let keep: Vec<usize> =
            (0..k).chain(trials.iter().flat_map(|t| t.at.iter().copied())).collect();
        let (z, x) = self.linear(fit, &screen.a, &screen.b, &keep, &screen.dirs)?;
        let mut at = k;
        for t in trials {
            let sign = CATALOGUE[t.hypothesis].sign;
            if sign != 0.0 && x[at] * sign < 0.0 {
                return None;
            }
            at += t.at.len();
        }
        Some(z - screen.base)
    }

    /// Linear evidence around the fit with the prior centred at no effect.
    fn linear(
        &self,
        fit: &Fit,
        a: &DMatrix<f64>,
        b: &DVector<f64>,
        keep: &[usize],
        dirs: &[Direction],
    ) -> Option<(f64, DVector<f64>)> {
        let zero = &self.reference.theta;
        let ps: Vec<P> = keep.iter().map(|i| dirs[*i].p).collect();
        let (a, b) = (evidence::sub(a, keep), evidence::pick(b, keep));
        // Residual at zero in the linear model: r0 = r + G (theta - zero) for the free ones.
        let k = fit.free.len();
        let shift = DVector::from_fn(ps.len(), |i, _| {
            if i < k { fit.theta[ps[i] as usize] - zero[ps[i] as usize] } else { 0.0 }
        });
        let b0 = &b + &a * &shift;
        evidence::linear(&a, &b0, &prior(&ps))
    }
}
