//! What every hypothesis, and every pair of hypotheses, would add to a fit, or put in place of one of
//! its members: secant sensitivities at the fitted point, one Gram matrix, linear evidence.

use nalgebra::{DMatrix, DVector};

use crate::causes::hypothesis::{CATALOGUE, Start};
use crate::causes::param::{P, Theta};
use crate::problem::course::Course;
use crate::problem::stats::evidence;
use crate::problem::{Direction, Gram};
use crate::search::evidence::Evidence;
use crate::search::free::{directions, prior};
use crate::search::refit::Fit;

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
    gram: Gram,
    /// Where all sizes count from.
    zero: Theta,
    /// The courses of the fit's members: that of a trial vanishes with it.
    course: Course,
    /// Columns of the residual and of `dirs`.
    keep: Vec<usize>,
    /// Directions of the fit's parameters, then of the trials.
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

/// The fit, or the fit without one of its members: its columns, its linear evidence with that of the
/// courses of its members, and the system that it stands in.
struct Own {
    columns: Vec<usize>,
    level: f64,
    log_z: f64,
    a: DMatrix<f64>,
    /// Gradient at no effect in the linear model.
    b: DVector<f64>,
}

impl Screen {
    /// Gains of all hypotheses over the fit, or over the fit without its `without`-th member, best
    /// first.
    pub(crate) fn singles(&self, without: Option<usize>) -> Vec<Candidate> {
        let Some(own) = self.own(without) else { return Vec::new() };
        let tried = self.columns.iter().filter_map(|c| self.added(&own, &[c]));
        let mut out: Vec<Candidate> = tried.flatten().collect();
        out.sort_by(|x, y| y.gain.total_cmp(&x.gain));
        out
    }

    /// The same of all pairs of hypotheses, one per pair of ids.
    pub(crate) fn pairs(&self, without: Option<usize>) -> Vec<[Candidate; 2]> {
        let mut out: Vec<[Candidate; 2]> = Vec::new();
        let Some(own) = self.own(without) else { return out };
        for (i, x) in self.columns.iter().enumerate() {
            for y in &self.columns[..i] {
                if CATALOGUE[x.hypothesis].id == CATALOGUE[y.hypothesis].id {
                    continue;
                }
                let added = self.added(&own, &[x, y]);
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
        let of = |member| self.own(member).map_or(0.0, |own| own.level + own.log_z);
        of(None) - of(member)
    }

    fn own(&self, without: Option<usize>) -> Option<Own> {
        let gone = without.and_then(|i| self.fit.set.get(i));
        let gone: Vec<P> = gone.map_or_else(Vec::new, |h| CATALOGUE[*h].params().collect());
        let columns: Vec<usize> =
            (0..self.fit.free.len()).filter(|j| !gone.contains(&self.fit.free[*j])).collect();
        let course = self.course.without(&gone);
        let gram = course.taken_out(&self.gram, &self.keep, &self.fit.theta, &self.zero)?;
        let (a, b, norm) = gram.total();
        // Residual at zero in the linear model: r0 = r + G (theta - zero) for the free ones.
        let shift = DVector::from_fn(self.dirs.len(), |i, _| {
            let of = |p: &P| self.fit.theta[*p as usize] - self.zero[*p as usize];
            self.fit.free.get(i).map_or(0.0, of)
        });
        let norm = norm + 2.0 * b.dot(&shift) + (&a * &shift).dot(&shift);
        let b = &b + &a * &shift;
        let mut own = Own { columns, level: -0.5 * norm, log_z: 0.0, a, b };
        own.log_z = self.linear(&own, &own.columns).map_or(0.0, |x| x.0);
        Some(own)
    }

    /// What the trials add in the linear model, all with the gain of all; `None` where a sign is
    /// wrong.
    fn added(&self, own: &Own, trials: &[&Trial]) -> Option<Vec<Candidate>> {
        let columns = trials.iter().flat_map(|t| t.at.iter().copied());
        let keep: Vec<usize> = own.columns.iter().copied().chain(columns).collect();
        let (z, x) = self.linear(own, &keep)?;
        let mut sizes = x.iter().skip(own.columns.len()).copied();
        let of = |t: &&Trial| {
            let sizes: Vec<f64> = sizes.by_ref().take(t.at.len()).collect();
            let wrong = sizes.first().is_some_and(|x| x * CATALOGUE[t.hypothesis].sign < 0.0);
            let (hypothesis, start, gain) = (t.hypothesis, t.start, z - own.log_z);
            (!wrong).then_some(Candidate { hypothesis, start, sizes, gain })
        };
        trials.iter().map(of).collect()
    }

    /// Linear evidence of columns, the prior centred at no effect.
    fn linear(&self, own: &Own, keep: &[usize]) -> Option<(f64, DVector<f64>)> {
        let ps: Vec<P> = keep.iter().map(|i| self.dirs[*i].p).collect();
        evidence::linear(&evidence::sub(&own.a, keep), &evidence::pick(&own.b, keep), &prior(&ps))
    }
}

impl dyn Evidence + '_ {
    /// Gram matrix of the free parameters and of the directions of all hypotheses in `open`.
    pub(crate) fn screen(&self, fit: &Fit, open: &[usize]) -> Screen {
        let mut dirs = directions(&fit.free, &fit.theta);
        let course = Course::of(&fit.sizes(), &mut dirs);
        let hats = fit.free.len()..dirs.len();
        let mut columns: Vec<Trial> = Vec::new();
        for h in open {
            let hyp = &CATALOGUE[*h];
            for start in hyp.starts {
                let shape: Vec<(P, f64)> = hyp.shapes.iter().copied().zip(*start).collect();
                let mut at = Vec::new();
                for p in hyp.sizes {
                    at.push(dirs.len() - hats.len());
                    let step = p.spec().step * if hyp.nonlinear() { FAR } else { 1.0 };
                    dirs.push(Direction::new(*p, shape.clone(), step));
                    if hyp.nonlinear() {
                        dirs.push(Direction::new(*p, shape.clone(), -step));
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
        let gram = self.gram(&fit.theta, &dirs);
        let mut keep: Vec<usize> = (0..=dirs.len()).collect();
        for hats in hats.rev() {
            dirs.remove(hats);
            keep.remove(hats + 1);
        }
        Screen { fit: fit.clone(), gram, zero: *self.zero(), course, keep, dirs, columns }
    }
}
