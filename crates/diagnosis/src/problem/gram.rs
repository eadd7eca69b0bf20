//! Gram matrices in the metric of a drive.

use nalgebra::{DMatrix, DVector};

use super::signals::Line;
use super::{Direction, Problem, Rest, inner};
use crate::param::Theta;
use crate::replay::MODULES;
use crate::unknown::KNOTS;

/// Marginal Gram matrix per drive over `[r, columns]`.
#[derive(Debug, Clone)]
pub(crate) struct Gram {
    pub(crate) per_drive: Vec<DMatrix<f64>>,
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
        let a = total.view((1, 1), (k - 1, k - 1)).into_owned();
        let b = total.view((1, 0), (k - 1, 1)).column(0).into_owned();
        (a, b, total[(0, 0)])
    }
}

impl Problem<'_> {
    /// Gram matrix of the residual at `theta` and the directions from there, and the raw
    /// (not marginal) chi-square per module.
    pub(crate) fn gram(&self, theta: &Theta, directions: &[Direction]) -> (Gram, [f64; MODULES]) {
        let parts = self.each(|i| {
            let mut lines = vec![self.at(i, theta)];
            lines.extend(directions.iter().map(|d| self.line(i, theta, d)));
            (self.marginal(i, &lines), self.chi(i, &lines[0]))
        });
        let mut chi = [0.0; MODULES];
        for p in &parts {
            for (c, x) in chi.iter_mut().zip(&p.1) {
                *c += x;
            }
        }
        (Gram { per_drive: parts.into_iter().map(|p| p.0).collect() }, chi)
    }

    /// Squared length of whitened signals per module.
    fn chi(&self, i: usize, line: &Line) -> [f64; MODULES] {
        let mut out = [0.0; MODULES];
        for signals in line {
            for (m, w) in signals.group.modules().iter().zip(self.white(i, signals)) {
                out[*m as usize] += inner(w, w);
            }
        }
        out
    }

    /// Squared whitened residuals per module at the reference.
    pub(crate) fn chi_at_reference(&self) -> [f64; MODULES] {
        let mut out = [0.0; MODULES];
        for (i, n) in self.nuisance.iter().enumerate() {
            out.iter_mut().zip(self.chi(i, &n.base)).for_each(|(x, c)| *x += c);
        }
        out
    }

    /// Gram matrix of given lines in the metric `M` of a drive.
    fn marginal(&self, i: usize, lines: &[Line]) -> DMatrix<f64> {
        let mut g = self.inner_products(i, lines);
        let against: Vec<DVector<f64>> = lines.iter().map(|l| self.against(i, l)).collect();
        if self.nuisance[i].sigma.is_empty() {
            return g;
        }
        let zc = DMatrix::from_columns(&against);
        if let Some(y) = self.nuisance[i].factor.l_dirty().solve_lower_triangular(&zc) {
            g -= y.transpose() * y;
        }
        g
    }

    /// Marginal Gram matrix over the residual and hat functions of one module: `places` gives the
    /// knot to the left and the way to the next, per row. Only a few hats touch a row, so the
    /// whitened hats are never written out, and everything else comes to the hats through the
    /// adjoint of the whitening filter.
    pub(crate) fn hats(
        &self,
        i: usize,
        m: usize,
        places: &[Option<(usize, f64)>],
        rest: &Rest,
    ) -> DMatrix<f64> {
        let nuisance = &self.nuisance[i];
        let whitener = &self.reference.whiteners[m];
        let adjoint = self.adjoint(i, m);
        let touched = adjoint.columns.len();
        let residual = whitener.adjoint(&rest.whitened[m]);
        let mut g = [[0.0; KNOTS]; KNOTS];
        let mut r = [0.0; KNOTS];
        let mut z = vec![0.0; touched * KNOTS];
        let rows = residual.len().min(places.len());
        for k in 0..rows {
            let Some((left, way)) = places[k] else { continue };
            let row = &adjoint.rows[k * touched..(k + 1) * touched];
            for (at, w) in [(left, 1.0 - way), (left + 1, way)] {
                r[at] += residual[k] * w;
                let z = &mut z[at * touched..(at + 1) * touched];
                z.iter_mut().zip(row).for_each(|(z, c)| *z += c * w);
            }
            let (mut hat, mut low, mut high) = ([0.0; KNOTS], left, left + 1);
            hat[left] = 1.0 - way;
            hat[left + 1] = way;
            for (a, before) in whitener.coefficients.iter().zip(places[..k].iter().rev()) {
                if let Some((j, w)) = *before {
                    hat[j] -= a * (1.0 - w);
                    hat[j + 1] -= a * w;
                    (low, high) = (low.min(j), high.max(j + 1));
                }
            }
            for a in low..=high {
                for b in a..=high {
                    g[a][b] += hat[a] * hat[b];
                }
            }
        }
        let scale = 1.0 / (whitener.sigma * whitener.sigma);
        let mut out = DMatrix::zeros(KNOTS + 1, KNOTS + 1);
        let mut against = DMatrix::zeros(nuisance.sigma.len(), KNOTS + 1);
        out[(0, 0)] = rest.norm;
        against.set_column(0, &rest.tolerances);
        for a in 0..KNOTS {
            out[(0, a + 1)] = r[a];
            out[(a + 1, 0)] = r[a];
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
        out
    }
}
