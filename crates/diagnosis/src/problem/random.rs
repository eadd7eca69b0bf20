//! Random effects taken out of Gram matrices (the marginal model of Laird and Ware, Biometrics 38, 1982).

use nalgebra::{DMatrix, DVector};

use super::Gram;
use super::stats::evidence::sub;

impl Gram {
    /// The same over the columns `keep`, with random effects taken out: columns that every drive has
    /// for itself and columns that all share, each with its standard deviation.
    pub(super) fn marginal(
        &self,
        keep: &[usize],
        between: &[(usize, f64)],
        along: &[(usize, f64)],
    ) -> Option<Self> {
        let (u, w) = (between.len(), along.len());
        let n = self.per_drive.first()?.nrows();
        let q = self.own.first().map_or(0, DMatrix::nrows);
        let mut out = Self {
            per_drive: Vec::new(),
            common: Vec::new(),
            own: std::sync::Arc::default(),
            log_det: 0.0,
        };
        let (mut owns, mut all, mut before) =
            (Vec::new(), DMatrix::identity(q + w, q + w), DMatrix::identity(q, q));
        for (i, g) in self.per_drive.iter().enumerate() {
            let empty = DMatrix::zeros(0, n);
            let (c, own) = match (self.common.get(i), self.own.get(i)) {
                (Some(c), Some(own)) => (c, own.clone()),
                _ => (&empty, DMatrix::zeros(0, 0)),
            };
            before += &own;
            let columns = |x: &DMatrix<f64>, of: &[(usize, f64)]| {
                DMatrix::from_fn(x.nrows(), of.len(), |r, j| x[(r, of[j].0)] * of[j].1)
            };
            let (gu, cu) = (columns(g, between), columns(c, between));
            let inner = DMatrix::from_fn(u, u, |a, b| {
                between[a].1 * gu[(between[a].0, b)] + if a == b { 1.0 } else { 0.0 }
            });
            let factor = inner.cholesky()?;
            out.log_det += 2.0 * factor.l().diagonal().iter().map(|x| x.ln()).sum::<f64>();
            let g = g - &gu * factor.solve(&gu.transpose());
            let c = c - &cu * factor.solve(&gu.transpose());
            let own = own - &cu * factor.solve(&cu.transpose());
            let (gw, cw) = (columns(&g, along), columns(&c, along));
            let common = DMatrix::from_fn(q + w, keep.len(), |r, j| {
                if r < q { c[(r, keep[j])] } else { gw[(keep[j], r - q)] }
            });
            let mut wide = DMatrix::zeros(q + w, q + w);
            wide.view_mut((0, 0), (q, q)).copy_from(&own);
            wide.view_mut((0, q), (q, w)).copy_from(&cw);
            wide.view_mut((q, 0), (w, q)).copy_from(&cw.transpose());
            let ww = DMatrix::from_fn(w, w, |a, b| along[a].1 * gw[(along[a].0, b)]);
            wide.view_mut((q, q), (w, w)).copy_from(&ww);
            all += &wide;
            owns.push(wide);
            out.common.push(common);
            out.per_drive.push(sub(&g, keep));
        }
        let log_det = |m: DMatrix<f64>| -> Option<f64> {
            Some(2.0 * m.cholesky()?.l().diagonal().iter().map(|x| x.ln()).sum::<f64>())
        };
        out.log_det += log_det(all)? - log_det(before)?;
        out.own = std::sync::Arc::new(owns);
        Some(out)
    }

    /// Information and gradient over all drives, and what the residual costs: its squared length and
    /// the logarithm of the determinant of the random effects.
    pub(crate) fn total(&self) -> (DMatrix<f64>, DVector<f64>, f64) {
        let (a, b, norm) = self.sum(|_| true);
        (a, b, norm + self.log_det)
    }
}
