//! What every hypothesis, and every pair of hypotheses, would add to a fit, or put in place of one of
//! its members: secant sensitivities at the fitted point, one Gram matrix, linear evidence.

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
pub(crate) struct Trial {
    hypothesis: usize,
    start: Start,
    at: Vec<usize>,
}

/// Information and gradient of many directions at a fit; the fit's own parameters come first.
pub(crate) struct Screen {
    fit: Fit,
    a: DMatrix<f64>,
    /// Gradient at no effect in the linear model.
    b: DVector<f64>,
    dirs: Vec<Direction>,
    columns: Vec<Trial>,
}

/// Hypotheses of `open` whose id is not in the set.
pub(crate) fn outside(fit: &Fit, open: &[usize]) -> Vec<usize> {
    open.iter()
        .copied()
        .filter(|h| fit.set.iter().all(|s| CATALOGUE[*s].id != CATALOGUE[*h].id))
        .collect()
}

impl Screen {
    /// Gains of all hypotheses over the fit, or over the fit without its `without`-th member, best
    /// first.
    pub(crate) fn singles(&self, without: Option<usize>) -> Vec<Candidate> {
        let (own, base) = self.own(without);
        let gain = |c: &Trial| {
            let gain = self.gain(&own, base, &[c])?;
            Some(Candidate { hypothesis: c.hypothesis, start: c.start, gain })
        };
        let mut out: Vec<Candidate> = self.columns.iter().filter_map(gain).collect();
        out.sort_by(|x, y| y.gain.total_cmp(&x.gain));
        out
    }

    /// The same of all pairs of hypotheses, one per pair of ids.
    pub(crate) fn pairs(&self, without: Option<usize>) -> Vec<[Candidate; 2]> {
        let (own, base) = self.own(without);
        let mut out: Vec<[Candidate; 2]> = Vec::new();
        for (i, x) in self.columns.iter().enumerate() {
            for y in &self.columns[..i] {
                if CATALOGUE[x.hypothesis].id == CATALOGUE[y.hypothesis].id {
                    continue;
                }
                if let Some(gain) = self.gain(&own, base, &[x, y]) {
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

    /// Linear evidence that the fit loses without a member.
    pub(crate) fn lost(&self, member: Option<usize>) -> f64 {
        self.own(None).1 - self.own(member).1
    }

    /// Columns of the fit's members but one, and their linear evidence.
    fn own(&self, without: Option<usize>) -> (Vec<usize>, f64) {
        let gone = without.and_then(|i| self.fit.set.get(i));
        let stays = |p: P| gone.is_none_or(|h| CATALOGUE[*h].params().all(|q| q != p));
        let own: Vec<usize> =
            (0..self.fit.free.len()).filter(|j| stays(self.fit.free[*j])).collect();
        let base = self.linear(&own).map_or(0.0, |x| x.0);
        (own, base)
    }

    /// What the trials add in the linear model; `None` where a sign is wrong.
    fn gain(&self, own: &[usize], base: f64, trials: &[&Trial]) -> Option<f64> {
        let added = trials.iter().flat_map(|t| t.at.iter().copied());
        let keep: Vec<usize> = own.iter().copied().chain(added).collect();
        let (z, x) = self.linear(&keep)?;
        let mut at = own.len();
        for t in trials {
            let sign = CATALOGUE[t.hypothesis].sign;
            if sign != 0.0 && x[at] * sign < 0.0 {
                return None;
            }
            at += t.at.len();
        }
        Some(z - base)
    }

    /// Linear evidence of columns, the prior centred at no effect.
    fn linear(&self, keep: &[usize]) -> Option<(f64, DVector<f64>)> {
        let ps: Vec<P> = keep.iter().map(|i| self.dirs[*i].p).collect();
        evidence::linear(&evidence::sub(&self.a, keep), &evidence::pick(&self.b, keep), &prior(&ps))
    }
}

impl Problem<'_> {
    /// Gram matrix of the free parameters and of the directions of all hypotheses in `open`.
    pub(crate) fn screen(&self, fit: &Fit, open: &[usize]) -> Screen {
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
        // Residual at zero in the linear model: r0 = r + G (theta - zero) for the free ones.
        let zero = &self.reference.theta;
        let shift = DVector::from_fn(dirs.len(), |i, _| {
            fit.free.get(i).map_or(0.0, |p| fit.theta[*p as usize] - zero[*p as usize])
        });
        let b = &b + &a * &shift;
        Screen { fit: fit.clone(), a, b, dirs, columns }
    }
}
