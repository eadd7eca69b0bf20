//! What every hypothesis, and every pair of hypotheses, would add to a fit, or put in place of one of
//! its members: secant sensitivities at the fitted point, one Gram matrix, linear evidence.

use nalgebra::{DMatrix, DVector};

use crate::evidence::Evidence;
use crate::hypothesis::{CATALOGUE, Start};
use crate::param::P;
use crate::problem::Direction;
use crate::refit::{Fit, directions, prior};
use crate::stats::evidence;

/// Steps by which a size is moved whose effect is not linear: what a strong wind does is no multiple of
/// what a breath does.
const FAR: f64 = 4.0;

/// A hypothesis that was tried for the next place.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) hypothesis: usize,
    pub(crate) start: Start,
    /// Its sizes in the linear model.
    pub(crate) sizes: Vec<f64>,
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
        let tried = self.columns.iter().filter_map(|c| self.added(&own, base, &[c]));
        let mut out: Vec<Candidate> = tried.flatten().collect();
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
                let added = self.added(&own, base, &[x, y]);
                out.extend(added.and_then(|pair| <[Candidate; 2]>::try_from(pair).ok()));
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

    /// What the trials add in the linear model, all with the gain of all; `None` where a sign is
    /// wrong.
    fn added(&self, own: &[usize], base: f64, trials: &[&Trial]) -> Option<Vec<Candidate>> {
        let columns = trials.iter().flat_map(|t| t.at.iter().copied());
        let keep: Vec<usize> = own.iter().copied().chain(columns).collect();
        let (z, x) = self.linear(&keep)?;
        let mut sizes = x.iter().skip(own.len()).copied();
        let of = |t: &&Trial| {
            let sizes: Vec<f64> = sizes.by_ref().take(t.at.len()).collect();
            let wrong = sizes.first().is_some_and(|x| x * CATALOGUE[t.hypothesis].sign < 0.0);
            let (hypothesis, start, gain) = (t.hypothesis, t.start, z - base);
            (!wrong).then_some(Candidate { hypothesis, start, sizes, gain })
        };
        trials.iter().map(of).collect()
    }

    /// Linear evidence of columns, the prior centred at no effect.
    fn linear(&self, keep: &[usize]) -> Option<(f64, DVector<f64>)> {
        let ps: Vec<P> = keep.iter().map(|i| self.dirs[*i].p).collect();
        evidence::linear(&evidence::sub(&self.a, keep), &evidence::pick(&self.b, keep), &prior(&ps))
    }
}

impl dyn Evidence + '_ {
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
                    let step = p.spec().step * if hyp.nonlinear() { FAR } else { 1.0 };
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
        let zero = self.zero();
        let shift = DVector::from_fn(dirs.len(), |i, _| {
            fit.free.get(i).map_or(0.0, |p| fit.theta[*p as usize] - zero[*p as usize])
        });
        let b = &b + &a * &shift;
        Screen { fit: fit.clone(), a, b, dirs, columns }
    }
}
