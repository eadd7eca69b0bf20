//! Evidence of a few given matrices: residuals that fall linearly with the sizes of causes.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::Evidence;
use crate::hypothesis::CATALOGUE;
use crate::param::{P, PARAMS, Theta};
use crate::problem::{Direction, Gram};
use crate::replay::{MODULES, Module};

/// One drive: whitened rows, what each parameter does to them, and the tolerances.
pub(crate) struct LinearDrive {
    /// Module of every row.
    pub(crate) module: Module,
    /// Residual without any cause.
    pub(crate) residual: Vec<f64>,
    /// Rows of a size of one, per parameter.
    pub(crate) columns: Vec<(P, Vec<f64>)>,
    /// Rows of one standard deviation of each tolerance.
    pub(crate) tolerances: Vec<Vec<f64>>,
}

/// Drives given as matrices.
pub(crate) struct LinearProblem {
    pub(crate) drives: Vec<LinearDrive>,
    zero: Theta,
}

impl LinearProblem {
    pub(crate) fn new(drives: Vec<LinearDrive>) -> Self {
        Self { drives, zero: [0.0; PARAMS] }
    }

    /// Index of a cause.
    pub(crate) fn cause(id: &str) -> usize {
        CATALOGUE.iter().position(|h| h.id == id).unwrap()
    }
}

impl LinearDrive {
    fn column(&self, p: P) -> Vec<f64> {
        let own = self.columns.iter().find(|c| c.0 == p);
        own.map_or_else(|| vec![0.0; self.residual.len()], |c| c.1.clone())
    }

    fn residual_at(&self, theta: &Theta) -> Vec<f64> {
        let mut r = self.residual.clone();
        for (p, column) in &self.columns {
            r.iter_mut().zip(column).for_each(|(r, c)| *r -= theta[*p as usize] * c);
        }
        r
    }

    fn gram(&self, theta: &Theta, directions: &[Direction]) -> DMatrix<f64> {
        let mut lines = vec![self.residual_at(theta)];
        lines.extend(directions.iter().map(|d| self.column(d.p)));
        let of = |lines: &[Vec<f64>]| {
            let rows = self.residual.len();
            DMatrix::from_fn(rows, lines.len(), |i, j| lines[j][i])
        };
        let x = of(&lines);
        let mut g = x.transpose() * &x;
        if !self.tolerances.is_empty() {
            let z = of(&self.tolerances);
            let zx = z.transpose() * &x;
            let q = self.tolerances.len();
            let factor = (DMatrix::identity(q, q) + z.transpose() * &z).cholesky().unwrap();
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

    fn gram_along(
        &self,
        theta: &Theta,
        _: &Theta,
        directions: &[Direction],
    ) -> (Gram, [f64; MODULES]) {
        let per_drive = self.drives.iter().map(|d| d.gram(theta, directions)).collect();
        let mut chi = [0.0; MODULES];
        for d in &self.drives {
            chi[d.module as usize] += d.residual_at(theta).iter().map(|r| r * r).sum::<f64>();
        }
        (Gram::without_common(per_drive), chi)
    }

    fn chi_at_zero(&self) -> [f64; MODULES] {
        self.gram_along(&self.zero, &self.zero, &[]).1
    }
}

impl Gram {
    /// Gram matrices of drives whose tolerances' means are known.
    fn without_common(per_drive: Vec<DMatrix<f64>>) -> Self {
        Self { per_drive, common: Vec::new(), own: Arc::default() }
    }
}

mod tests;
