//! Gram matrices in the metric of a drive.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::signals::Line;
use super::{Direction, Problem, Rest};
use crate::causes::param::Theta;
use crate::outside::unknown::KNOTS;
use crate::problem::stats::slow::State;
use crate::replay::Module;

/// Marginal Gram matrix per drive over `[r, columns]`.
///
/// The means of the tolerances are known from a few drives only. Their error is common to all
/// drives: random effects beside those of each drive, marginalised when drives are summed.
#[derive(Debug, Clone)]
pub(crate) struct Gram {
    pub(crate) per_drive: Vec<DMatrix<f64>>,
    /// Products of the common effects with `[r, columns]`, per drive.
    pub(crate) common: Vec<DMatrix<f64>>,
    /// Information of a drive about the common effects.
    pub(crate) own: Arc<Vec<DMatrix<f64>>>,
    /// Logarithm of the determinant of the random effects that were taken out beyond those of the
    /// drives in order.
    pub(crate) log_det: f64,
}

impl Gram {
    /// Information, gradient and residual norm over the drives chosen.
    pub(crate) fn sum(&self, pick: impl Fn(usize) -> bool) -> (DMatrix<f64>, DVector<f64>, f64) {
        let k = self.per_drive.first().map_or(1, DMatrix::nrows);
        let mut total = DMatrix::zeros(k, k);
        for (i, g) in self.per_drive.iter().enumerate() {
            if pick(i) {
                total += g;
            }
        }
        if let Some((against, means)) = self.means(&pick) {
            total -= against.transpose() * means;
        }
        let a = total.view((1, 1), (k - 1, k - 1)).into_owned();
        let b = total.view((1, 0), (k - 1, 1)).column(0).into_owned();
        (a, b, total[(0, 0)])
    }

    /// Products of the common effects with residual and columns over the drives chosen, and their
    /// posterior means for each.
    fn means(&self, pick: &impl Fn(usize) -> bool) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let q = self.own.first()?.nrows();
        let mut information = DMatrix::identity(q, q);
        let mut against: Option<DMatrix<f64>> = None;
        for (i, (own, c)) in self.own.iter().zip(&self.common).enumerate() {
            if pick(i) {
                information += own;
                against = Some(against.map_or_else(|| c.clone(), |sum| sum + c));
            }
        }
        let against = against?;
        let means = information.cholesky()?.solve(&against);
        Some((against, means))
    }

    /// Gradient of every drive after a step of `x` along the columns, once the common effects have
    /// taken what they can.
    pub(crate) fn scores(&self, x: &DVector<f64>) -> Vec<DVector<f64>> {
        let k = x.len();
        let means = self.means(&|_| true).map(|m| m.1.column(0) - m.1.columns(1, k) * x);
        let scores = self.per_drive.iter().enumerate().map(|(i, g)| {
            let own = g.view((1, 0), (k, 1)) - g.view((1, 1), (k, k)) * x;
            match (&means, self.common.get(i)) {
                (Some(u), Some(c)) => own - (c.transpose() * u).rows(1, k),
                _ => own,
            }
        });
        scores.map(|s| s.column(0).into_owned()).collect()
    }
}

impl Problem<'_> {
    /// Gram matrix of the residual at `theta` and the directions from there.
    pub(crate) fn gram(&self, theta: &Theta, directions: &[Direction]) -> Gram {
        self.gram_along(theta, theta, directions)
    }

    /// The same with the directions from another point.
    pub(crate) fn gram_along(&self, theta: &Theta, from: &Theta, directions: &[Direction]) -> Gram {
        let parts = self.each(|i| {
            let mut lines = vec![self.at(i, theta)];
            lines.extend(directions.iter().map(|d| self.line(i, from, d)));
            self.marginal(i, &lines, from)
        });
        self.with_moved(parts, from)
    }

    /// The Gram matrices of all drives whose tolerances were taken at `from`.
    pub(super) fn with_moved(
        &self,
        parts: Vec<(DMatrix<f64>, DMatrix<f64>)>,
        from: &Theta,
    ) -> Gram {
        let mut out = self.together(parts.into_iter());
        let own: Option<Vec<_>> = (0..self.drives.len())
            .map(|i| Some(self.moved(i, from)?.information.clone()))
            .collect();
        if let Some(own) = own.filter(|o| !o.is_empty()) {
            out.own = Arc::new(own);
        }
        out
    }

    /// Gram matrix of the residual at `theta`, the directions from there, and further columns of one
    /// module, given per drive.
    pub(crate) fn gram_beside(
        &self,
        theta: &Theta,
        directions: &[Direction],
        module: Module,
        columns: &(dyn Fn(usize) -> Vec<Vec<f64>> + Sync),
    ) -> Gram {
        let parts = self.each(|i| {
            let mut lines = vec![self.at(i, theta)];
            lines.extend(directions.iter().map(|d| self.line(i, theta, d)));
            lines.extend(columns(i).into_iter().map(|c| Self::column(module, c)));
            self.marginal(i, &lines, &self.reference.theta)
        });
        self.together(parts.into_iter())
    }

    /// Gram matrices of all drives and their products with the common effects.
    pub(crate) fn together(
        &self,
        parts: impl Iterator<Item = (DMatrix<f64>, DMatrix<f64>)>,
    ) -> Gram {
        let (per_drive, common) = parts.unzip();
        Gram { per_drive, common, own: self.common.clone(), log_det: 0.0 }
    }

    /// Gram matrix of given lines in the metric `M` of a drive, its tolerances taken at `from`, and
    /// their products with the common effects.
    pub(super) fn marginal(
        &self,
        i: usize,
        lines: &[Line],
        from: &Theta,
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let mut g = self.inner_products(i, lines);
        let moved = self.moved(i, from);
        let moved = moved.as_deref();
        let against: Vec<DVector<f64>> =
            lines.iter().map(|l| self.against_at(i, l, moved)).collect();
        if self.nuisance[i].sigma.is_empty() {
            return (g, DMatrix::zeros(0, lines.len()));
        }
        let factor = moved.map_or(&self.nuisance[i].factor, |m| &m.factor);
        let mut zc = DMatrix::from_columns(&against);
        if let Some(y) = factor.l_dirty().solve_lower_triangular(&zc) {
            g -= y.transpose() * y;
        }
        factor.solve_mut(&mut zc);
        (g, self.reference.means.tr_mul(&zc))
    }

    /// Marginal Gram matrix over the residual, hat functions of one module and the courses of the
    /// causes: `places` gives the knot to the left and the size of its hat and of the next, per row.
    /// Only a few hats touch a row, so the whitened hats are never written out, and everything else
    /// comes to the hats through the adjoint of the whitening filter. With the products with the
    /// common effects.
    pub(crate) fn hats(
        &self,
        i: usize,
        m: usize,
        places: &[Option<(usize, [f64; 2])>],
        rest: &Rest,
    ) -> (DMatrix<f64>, DMatrix<f64>) {
        let nuisance = &self.nuisance[i];
        let whitener = &self.reference.whiteners[m];
        let adjoint = self.adjoint(i, m);
        let touched = adjoint.columns.len();
        let lines = rest.products.nrows();
        let own = &rest.adjoint[m];
        let mut g = [[0.0; KNOTS]; KNOTS];
        let mut r = vec![[0.0; KNOTS]; own.len()];
        let mut z = vec![0.0; touched * KNOTS];
        let count = rest.whitened[m].len().min(places.len());
        // Sums over the blocks of slow noise.
        let slow = self.slow[i][m].as_ref();
        let block = slow.map_or(1, |s| s.block);
        let weights = slow.map_or(&[][..], |s| &s.weights);
        let mut sums = vec![[0.0; KNOTS]; weights.len().div_ceil(block)];
        for k in 0..count {
            let Some((left, sizes)) = places[k] else { continue };
            let row = &adjoint.rows[k * touched..(k + 1) * touched];
            for (at, w) in [(left, sizes[0]), (left + 1, sizes[1])] {
                for (r, (_, line)) in r.iter_mut().zip(own) {
                    r[at] += line.get(k).copied().unwrap_or(0.0) * w;
                }
                let z = &mut z[at * touched..(at + 1) * touched];
                z.iter_mut().zip(row).for_each(|(z, c)| *z += c * w);
            }
            let (mut hat, mut low, mut high) = ([0.0; KNOTS], left, left + 1);
            [hat[left], hat[left + 1]] = sizes;
            for (a, before) in whitener.coefficients.iter().zip(places[..k].iter().rev()) {
                if let Some((j, sizes)) = *before {
                    hat[j] -= a * sizes[0];
                    hat[j + 1] -= a * sizes[1];
                    (low, high) = (low.min(j), high.max(j + 1));
                }
            }
            for a in low..=high {
                for b in a..=high {
                    g[a][b] += hat[a] * hat[b];
                }
            }
            if let Some((sums, w)) = sums.get_mut(k / block).zip(weights.get(k)) {
                (low..=high).for_each(|a| sums[a] += w * hat[a]);
            }
        }
        if let Some(slow) = slow {
            let mut states = [State::default(); KNOTS];
            for (sums, gain) in sums.iter().zip(&slow.gains) {
                let e: [f64; KNOTS] =
                    core::array::from_fn(|a| states[a].innovation(gain, gain.mean(sums[a])));
                for a in 0..KNOTS {
                    for b in a..KNOTS {
                        g[a][b] += gain.product((sums[a], e[a]), (sums[b], e[b]));
                    }
                }
            }
        }
        let scale = 1.0 / (whitener.sigma * whitener.sigma);
        // Columns: residual, hats, courses.
        let at = |line: usize| if line == 0 { 0 } else { KNOTS + line };
        let mut out = DMatrix::zeros(KNOTS + lines, KNOTS + lines);
        let mut against = DMatrix::zeros(nuisance.sigma.len(), KNOTS + lines);
        for a in 0..lines {
            against.set_column(at(a), &rest.tolerances.column(a));
            for b in 0..lines {
                out[(at(a), at(b))] = rest.products[(a, b)];
            }
        }
        for ((line, _), r) in own.iter().zip(&r) {
            for (a, r) in r.iter().enumerate() {
                out[(at(*line), a + 1)] = *r;
                out[(a + 1, at(*line))] = *r;
            }
        }
        for a in 0..KNOTS {
            for b in a..KNOTS {
                out[(a + 1, b + 1)] = scale * g[a][b];
                out[(b + 1, a + 1)] = scale * g[a][b];
            }
            for (j, z) in adjoint.columns.iter().zip(&z[a * touched..]) {
                against[(*j, a + 1)] = *z;
            }
        }
        if let Some(y) = nuisance.factor.l_dirty().solve_lower_triangular(&against) {
            out -= y.transpose() * y;
        }
        nuisance.factor.solve_mut(&mut against);
        (out, self.reference.means.tr_mul(&against))
    }
}

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;

    use super::*;
    use crate::problem::course::Point;
    use crate::problem::nuisance::Changed;
    use crate::problem::stats::slow::Slow;
    use crate::replay::Prepared;
    use crate::replay::tests::recorded;
    use crate::{Plant, Serial};

    /// The hats are never written out: their sums over blocks have to give what written out ones give,
    /// where slow noise is added and where it is a factor.
    #[test]
    fn hats_beside_slow_noise_are_those_that_are_written_out() {
        let truck = TruckParameters::load("reference").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let drives = vec![Prepared::new(&recorded(&truck, 16_000.0), &plant)];
        let mut problem = Problem::learn(&plant, drives, false, &Serial).unwrap();
        let slow = Slow::of(40, [0.02, 0.01, 0.05]);
        for module in [Module::Torque, Module::Force] {
            let m = module as usize;
            problem.reference.whiteners[m].slow = Some(slow.clone());
            problem.rebuild(Changed::Noise).unwrap();
            let rows = problem.drives[0].valid[m].iter().enumerate();
            let place = |(k, ok): (usize, &bool)| {
                let way = 0.5 + 0.5 * (0.05 * k as f64).sin();
                ok.then_some((k / 60 % (KNOTS - 1), [1.0 - way, way]))
            };
            let places: Vec<Option<(usize, [f64; 2])>> = rows.map(place).collect();
            assert!(places.iter().flatten().count() > 100, "{module:?}");
            let written = |_: usize| -> Vec<Vec<f64>> {
                let size = |at: &Option<(usize, [f64; 2])>, knot: usize| {
                    at.map_or(0.0, |(j, x)| {
                        if j == knot {
                            x[0]
                        } else if j + 1 == knot {
                            x[1]
                        } else {
                            0.0
                        }
                    })
                };
                (0..KNOTS).map(|knot| places.iter().map(|at| size(at, knot)).collect()).collect()
            };
            let at = Point::bare(problem.reference.theta);
            let (hats, of_means) = problem.hats(0, m, &places, &problem.rest(0, &at));
            let direct = problem.gram_beside(&problem.reference.theta, &[], module, &written);
            let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).norm() < 1e-8 * b.norm();
            assert!(
                near(&hats, &direct.per_drive[0]),
                "{module:?}: {hats} {}",
                direct.per_drive[0]
            );
            assert!(near(&of_means, &direct.common[0]), "{module:?}");
        }
    }
}
