//! Evidence of a few given matrices: residuals that fall linearly with the sizes of causes, and with
//! tolerances that may have squares.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::Evidence;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{P, PARAMS, Theta};
use crate::problem::{Direction, Gram, Hat};
use crate::search::worth::Dispersion;

/// One drive: whitened rows, what each parameter does to them, and the tolerances.
pub(crate) struct LinearDrive {
    /// Residual without any cause.
    pub(crate) residual: Vec<f64>,
    /// Rows of a size of one, per parameter.
    pub(crate) columns: Vec<(P, Vec<f64>)>,
    /// Rows of one standard deviation of each tolerance.
    pub(crate) tolerances: Vec<Vec<f64>>,
    /// Rows of the square of each, where it has one.
    pub(crate) squares: Vec<Vec<f64>>,
}

/// Drives given as matrices.
pub(crate) struct LinearProblem {
    pub(crate) drives: Vec<LinearDrive>,
    /// Over-dispersion of drives in order about any cause.
    pub(crate) scatter: Dispersion,
    zero: Theta,
}

impl LinearProblem {
    pub(crate) fn new(drives: Vec<LinearDrive>) -> Self {
        Self { drives, scatter: Dispersion::NONE, zero: [0.0; PARAMS] }
    }

    /// Index of a cause.
    pub(crate) fn cause(id: &str) -> usize {
        CATALOGUE.iter().position(|h| h.id == id).unwrap()
    }
}

fn rows_of(lines: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(lines[0].len(), lines.len(), |i, j| lines[j][i])
}

impl LinearDrive {
    fn column(&self, p: P) -> Vec<f64> {
        let own = self.columns.iter().find(|c| c.0 == p);
        own.map_or_else(|| vec![0.0; self.residual.len()], |c| c.1.clone())
    }

    /// Rows times a hat function of their place.
    fn under(&self, rows: Vec<f64>, hat: Option<Hat>) -> Vec<f64> {
        let Some(hat) = hat else { return rows };
        let knots = hat.last as f64;
        let place = |i: usize| i as f64 / (rows.len() - 1) as f64 * knots;
        let weight = |i: usize| (1.0 - (place(i) - hat.knot as f64).abs()).max(0.0);
        rows.iter().enumerate().map(|(i, x)| x * weight(i)).collect()
    }

    fn residual_at(&self, theta: &Theta) -> Vec<f64> {
        let mut r = self.residual.clone();
        for (p, column) in &self.columns {
            r.iter_mut().zip(column).for_each(|(r, c)| *r -= theta[*p as usize] * c);
        }
        r
    }

    /// Their rows, and the Cholesky factor of `I + Z'Z`.
    fn tolerances(&self) -> (DMatrix<f64>, Cholesky<f64, Dyn>) {
        let (z, q) = (rows_of(&self.tolerances), self.tolerances.len());
        let factor = (DMatrix::identity(q, q) + z.transpose() * &z).cholesky().unwrap();
        (z, factor)
    }

    /// The residual without the squares of the most probable tolerances.
    fn as_driven(&self, theta: &Theta) -> Vec<f64> {
        let mut r = self.residual_at(theta);
        if self.squares.is_empty() {
            return r;
        }
        let (z, factor) = self.tolerances();
        let most_probable = factor.solve(&(z.transpose() * DVector::from_column_slice(&r)));
        for (square, z) in self.squares.iter().zip(most_probable.iter()) {
            r.iter_mut().zip(square).for_each(|(r, x)| *r -= z * z * x);
        }
        r
    }

    fn gram(&self, residual: Vec<f64>, directions: &[Direction]) -> DMatrix<f64> {
        let mut lines = vec![residual];
        lines.extend(directions.iter().map(|d| self.under(self.column(d.p), d.hat)));
        let x = rows_of(&lines);
        let mut g = x.transpose() * &x;
        if !self.tolerances.is_empty() {
            let (z, factor) = self.tolerances();
            let zx = z.transpose() * &x;
            g -= zx.transpose() * factor.solve(&zx);
        }
        g
    }
}

impl Evidence for LinearProblem {
    fn zero(&self) -> &Theta {
        &self.zero
    }

    fn drives(&self) -> usize {
        self.drives.len()
    }

    fn scatter_of(&self, _: usize) -> Dispersion {
        self.scatter
    }

    fn gram_along(&self, theta: &Theta, _: &Theta, directions: &[Direction]) -> Gram {
        let of = |d: &LinearDrive| d.gram(d.residual_at(theta), directions);
        Gram::without_common(self.drives.iter().map(of).collect())
    }

    fn gram_as_driven(&self, theta: &Theta, directions: &[Direction]) -> Gram {
        let of = |d: &LinearDrive| d.gram(d.as_driven(theta), directions);
        Gram::without_common(self.drives.iter().map(of).collect())
    }
}

impl Gram {
    /// Gram matrices of drives whose tolerances' means are known.
    fn without_common(per_drive: Vec<DMatrix<f64>>) -> Self {
        Self { per_drive, common: Vec::new(), own: Arc::default(), log_det: 0.0 }
    }
}

mod tests;
