//! The tolerances of every drive: sensitivities, their Gram matrix, and what they can take.

use std::sync::{Arc, OnceLock};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::signals::Line;
use super::white::Whitened;
use super::{Problem, inner, nuisance_directions, rows};
use crate::DiagnosisError;
use crate::causes::param::Theta;
use crate::problem::course::Point;
use crate::replay::MODULES;

/// Tolerances of one drive at the reference.
pub(super) struct Nuisance {
    /// Residuals at the reference.
    pub(super) base: Line,
    /// Sensitivities per unit of the parameter.
    pub(super) columns: Vec<Line>,
    /// Standard deviations of the parameters.
    pub(super) sigma: Vec<f64>,
    /// Inner products of the columns.
    products: DMatrix<f64>,
    /// Cholesky factor of `I + Z'Z`.
    pub(super) factor: Cholesky<f64, Dyn>,
    /// Per module, the columns through the adjoint of its whitening filter.
    adjoint: [OnceLock<Adjoint>; MODULES],
}

/// Whitened signals through the adjoint of their filter: `x . (F h) = (F' x) . h`.
pub(super) struct Adjoint {
    /// Columns that reach the module.
    pub(super) columns: Vec<usize>,
    /// Row by row, all of them.
    pub(super) rows: Vec<f64>,
}

/// What is left of a drive, and the courses of the causes that are there: residual first.
pub(crate) struct Rest {
    /// Whitened residual.
    pub(crate) whitened: [Vec<f64>; MODULES],
    lines: Vec<Line>,
    /// Inner products of the lines.
    pub(super) products: DMatrix<f64>,
    /// Products of the tolerances with the lines.
    pub(super) tolerances: DMatrix<f64>,
    /// Per module, the whitened lines that reach it through the adjoint of its filter.
    pub(super) adjoint: [Vec<(usize, Vec<f64>)>; MODULES],
}

impl Nuisance {
    /// `Z'Z`, columns scaled by their standard deviations.
    pub(super) fn scaled(&self) -> DMatrix<f64> {
        let q = self.sigma.len();
        DMatrix::from_fn(q, q, |a, b| self.sigma[a] * self.products[(a, b)] * self.sigma[b])
    }
}

/// What the rebuilding of the tolerances can take over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Changed {
    /// Nothing.
    Everything,
    /// The sensitivities, which a small change of the reference leaves as they are.
    Noise,
    /// The whitened sensitivities.
    Scatter,
}

impl Problem<'_> {
    /// Residuals and sensitivities to the tolerances at the reference.
    pub(super) fn rebuild(&mut self, changed: Changed) -> Result<(), DiagnosisError> {
        if changed != Changed::Scatter {
            self.kept.iter().for_each(super::signals::Kept::renew);
            let over = |i: usize| {
                core::array::from_fn(|m| self.reference.whiteners[m].over(rows(&self.drives[i], m)))
            };
            self.slow = self.each(over);
        }
        self.shifts.iter().for_each(super::moved::Shifts::renew);
        let directions = nuisance_directions(&self.reference.tolerance);
        let sigma: Vec<f64> =
            directions.iter().map(|d| self.reference.tolerance[d.p as usize]).collect();
        let theta = self.reference.theta;
        let mut old: Vec<Option<Nuisance>> = core::mem::take(&mut self.nuisance)
            .into_iter()
            .map(|n| (n.columns.len() == directions.len()).then_some(n))
            .collect();
        old.resize_with(self.drives.len(), || None);
        let built = self.each(|i| {
            let base = self.at(i, &theta);
            let before = old[i].as_ref().filter(|_| changed != Changed::Everything);
            let renew = |line: &Line| line.iter().map(|s| s.renewed()).collect();
            let columns: Vec<Line> = match before {
                Some(n) if changed == Changed::Noise => n.columns.iter().map(renew).collect(),
                Some(n) => n.columns.clone(),
                None => directions.iter().map(|d| self.line(i, &theta, d)).collect(),
            };
            let products = match before {
                Some(n) if changed == Changed::Scatter => n.products.clone(),
                _ => self.inner_products(i, &columns),
            };
            let q = columns.len();
            let s = DMatrix::from_fn(q, q, |a, b| {
                sigma[a] * products[(a, b)] * sigma[b] + if a == b { 1.0 } else { 0.0 }
            });
            let factor = s.cholesky()?;
            let sigma = sigma.clone();
            Some(Nuisance { base, columns, sigma, products, factor, adjoint: Default::default() })
        });
        self.nuisance = built
            .into_iter()
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| DiagnosisError::Numerics("tolerances of a drive".into()))?;
        let information = |n: &Nuisance| self.information(&n.factor);
        self.common = Arc::new(self.nuisance.iter().map(information).collect());
        Ok(())
    }

    /// Information of a drive about the means of the tolerances, from its factor of `I + Z'Z`.
    pub(super) fn information(&self, factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
        let inverse = factor.inverse();
        let q = inverse.nrows();
        let means = &self.reference.means;
        means.tr_mul(&(DMatrix::identity(q, q) - inverse)) * means
    }

    /// Symmetric matrix of the inner products of lines.
    pub(super) fn inner_products(&self, i: usize, lines: &[Line]) -> DMatrix<f64> {
        let n = lines.len();
        let mut out = DMatrix::zeros(n, n);
        for a in 0..n {
            for b in a..n {
                let v = self.dot(i, &lines[a], &lines[b]);
                out[(a, b)] = v;
                out[(b, a)] = v;
            }
        }
        out
    }

    /// Products of a line with the tolerances of drive `i` in their standard deviations.
    pub(super) fn against(&self, i: usize, line: &Line) -> DVector<f64> {
        let products = self.products(i, line);
        let sigma = &self.nuisance[i].sigma;
        DVector::from_iterator(sigma.len(), products.iter().zip(sigma).map(|(x, s)| x * s))
    }

    /// Posterior mean of a drive's tolerances at the reference, in their sigmas.
    pub(super) fn nuisance_mean(&self, i: usize) -> Vec<f64> {
        self.most_probable(i, &self.nuisance[i].base, &self.reference.theta).as_slice().to_vec()
    }

    /// The same where its residuals at `theta` are `line`.
    pub(super) fn most_probable(&self, i: usize, line: &Line, theta: &Theta) -> DVector<f64> {
        let moved = self.moved(i, theta);
        let mut z = self.against_at(i, line, moved.as_deref());
        moved.as_ref().map_or(&self.nuisance[i].factor, |m| &m.factor).solve_mut(&mut z);
        z
    }

    /// The reference off by tolerances in their sigmas, within the bounds of each.
    pub(super) fn off_by(&self, z: &[f64]) -> Theta {
        let mut t = self.reference.theta;
        for (d, z) in nuisance_directions(&self.reference.tolerance).iter().zip(z) {
            let (spec, x) = (d.p.spec(), &mut t[d.p as usize]);
            *x = (*x + z * self.reference.tolerance[d.p as usize]).clamp(spec.lo, spec.hi);
        }
        t
    }

    /// What is left of drive `i`.
    pub(crate) fn rest(&self, i: usize, at: &Point) -> Rest {
        let mut lines = vec![self.at(i, &at.theta)];
        lines.extend(at.directions.iter().map(|d| self.line(i, &at.theta, d)));
        let tolerances: Vec<DVector<f64>> = lines.iter().map(|l| self.against(i, l)).collect();
        let mut adjoint: [Vec<(usize, Vec<f64>)>; MODULES] = Default::default();
        for (j, line) in lines.iter().enumerate() {
            for (m, white) in line.iter().flat_map(|signals| self.whites(i, signals)) {
                adjoint[m].push((j, self.through_adjoint(i, m, white)));
            }
        }
        Rest {
            whitened: self.spread(i, &lines[0]),
            products: self.inner_products(i, &lines),
            tolerances: DMatrix::from_columns(&tolerances),
            adjoint,
            lines,
        }
    }

    /// Mean square of whitened residuals per module after what the tolerances of each drive can
    /// and the courses of the causes can take is taken out; 1 where a module has no rows.
    pub(crate) fn settled(&self, at: &Point) -> [f64; MODULES] {
        let own = at.course.deviations(at.directions.len(), &at.theta, &self.reference.theta);
        let parts = self.each(|i| {
            let rest = self.rest(i, at);
            let nuisance = &self.nuisance[i];
            let sigma: Vec<f64> = nuisance.sigma.iter().chain(&own).copied().collect();
            let z = self.taken(i, &rest, &own);
            let columns = nuisance.columns.iter().chain(&rest.lines[1..]);
            let mut left = rest.whitened.clone();
            for ((line, sigma), z) in columns.zip(&sigma).zip(z.iter()) {
                for (m, white) in line.iter().flat_map(|signals| self.whites(i, signals)) {
                    white.add_to(&mut left[m], -z * sigma, self.slow[i][m].as_ref());
                }
            }
            left.map(|x| inner(&x, &x))
        });
        core::array::from_fn(|m| {
            let rows: usize =
                self.drives.iter().map(|d| d.valid[m].iter().filter(|x| **x).count()).sum();
            let sum: f64 = parts.iter().map(|p| p[m]).sum();
            if rows > 0 && sum > 0.0 { sum / rows as f64 } else { 1.0 }
        })
    }

    /// Posterior means of the tolerances of a drive and of the courses, whose deviations are `own`,
    /// in their deviations.
    fn taken(&self, i: usize, rest: &Rest, own: &[f64]) -> DVector<f64> {
        let scaled = self.nuisance[i].scaled();
        let (q, w) = (scaled.nrows(), own.len());
        let against = |a: usize, j: usize| {
            if a < q { rest.tolerances[(a, j)] } else { own[a - q] * rest.products[(a - q + 1, j)] }
        };
        let information = DMatrix::from_fn(q + w, q + w, |a, b| {
            let product = match (a < q, b < q) {
                (true, true) => scaled[(a, b)],
                (_, false) => own[b - q] * against(a, b - q + 1),
                (false, true) => own[a - q] * against(b, a - q + 1),
            };
            product + if a == b { 1.0 } else { 0.0 }
        });
        let gradient = DVector::from_fn(q + w, |a, _| against(a, 0));
        information.cholesky().map_or_else(|| DVector::zeros(q + w), |f| f.solve(&gradient))
    }

    /// A whitened record of module `m` through the adjoint of its filter.
    fn through_adjoint(&self, i: usize, m: usize, white: &Whitened) -> Vec<f64> {
        let whitener = &self.reference.whiteners[m];
        whitener.adjoint(self.written_out(i, m, white), self.slow[i][m].as_ref())
    }

    /// The tolerances' columns in module `m` of drive `i` through the adjoint of its filter.
    pub(super) fn adjoint(&self, i: usize, m: usize) -> &Adjoint {
        self.nuisance[i].adjoint[m].get_or_init(|| {
            let nuisance = &self.nuisance[i];
            let mut columns = Vec::new();
            let mut filtered: Vec<Vec<f64>> = Vec::new();
            for (j, (line, sigma)) in nuisance.columns.iter().zip(&nuisance.sigma).enumerate() {
                let whites = line.iter().flat_map(|signals| self.whites(i, signals));
                for (_, white) in whites.filter(|(at, _)| *at == m) {
                    let mut back = self.through_adjoint(i, m, white);
                    back.iter_mut().for_each(|x| *x *= sigma);
                    columns.push(j);
                    filtered.push(back);
                }
            }
            let rows = filtered.iter().map(Vec::len).max().unwrap_or(0);
            let at = |k: usize| filtered.iter().map(move |c| c.get(k).copied().unwrap_or(0.0));
            Adjoint { columns, rows: (0..rows).flat_map(at).collect() }
        })
    }
}
