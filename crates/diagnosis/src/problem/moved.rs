//! The tolerance of the map's place, where a fit has moved the map.
//!
//! A map errs by itself, by `n` at a place. Its tolerance has the column `g' + n'`, and what is left
//! of a map that is moved by `theta` has `n(theta)`. Taken from where nothing is moved the two go
//! together at every `theta` but none, the tolerance takes part of the map's own error at any shift,
//! and shifts come out a third too large. Taken where the map is, `n` and `n'` have nothing to do with
//! each other: the column is worked out anew with the directions of a fit.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::signals::Line;
use super::{Direction, Problem, nuisance_directions};
use crate::causes::param::{P, Theta};

/// Shifts of which a drive keeps the column: those of the steps of one fit.
const KEPT: usize = 4;

/// Whether the sensitivity to a tolerance has to be taken where the fit is.
pub(crate) fn moves(p: P) -> bool {
    p == P::MapShift
}

/// The column of the map's place at another shift than the calibration's.
pub(super) struct Moved {
    /// Its number among the tolerances.
    at: usize,
    column: Line,
    /// Cholesky factor of `I + Z'Z`.
    pub(super) factor: Cholesky<f64, Dyn>,
    /// Information of the drive about the means of the tolerances.
    pub(super) information: DMatrix<f64>,
}

/// Columns of one drive by the shift.
#[derive(Default)]
pub(super) struct Shifts(Mutex<HashMap<u64, Arc<Moved>>>);

impl Shifts {
    /// Forgets all: noise or tolerances have changed.
    pub(super) fn renew(&self) {
        if let Ok(mut kept) = self.0.lock() {
            kept.clear();
        }
    }
}

impl Problem<'_> {
    /// The column of drive `i` at the shift of `theta`; `None` where it is the calibration's.
    pub(super) fn moved(&self, i: usize, theta: &Theta) -> Option<Arc<Moved>> {
        let (p, reference) = (P::MapShift, &self.reference);
        let shift = theta[p as usize];
        if shift == reference.theta[p as usize] || reference.tolerance[p as usize] <= 0.0 {
            return None;
        }
        if let Some(kept) = self.shifts[i].0.lock().ok()?.get(&shift.to_bits()) {
            return Some(kept.clone());
        }
        let at = nuisance_directions(&reference.tolerance).iter().position(|d| d.p == p)?;
        let mut there = reference.theta;
        there[p as usize] = shift;
        let column = self.line(i, &there, &Direction::new(p, Vec::new(), p.spec().step));
        let nuisance = &self.nuisance[i];
        let mut scaled = nuisance.scaled();
        let products = self.products(i, &column);
        for (j, product) in products.iter().enumerate() {
            let both = nuisance.sigma[at] * nuisance.sigma[j] * product;
            (scaled[(at, j)], scaled[(j, at)]) = (both, both);
        }
        scaled[(at, at)] = nuisance.sigma[at].powi(2) * self.dot(i, &column, &column);
        let q = scaled.nrows();
        let factor = (scaled + DMatrix::identity(q, q)).cholesky()?;
        let information = self.information(&factor);
        let moved = Arc::new(Moved { at, column, factor, information });
        let mut kept = self.shifts[i].0.lock().ok()?;
        if kept.len() >= KEPT {
            kept.clear();
        }
        kept.insert(shift.to_bits(), moved.clone());
        Some(moved)
    }

    /// Products of a line with the tolerances of drive `i` in their standard deviations, that of the
    /// map's place where it is.
    pub(super) fn against_at(&self, i: usize, line: &Line, moved: Option<&Moved>) -> DVector<f64> {
        let mut out = self.against(i, line);
        if let Some(m) = moved {
            out[m.at] = self.nuisance[i].sigma[m.at] * self.dot(i, &m.column, line);
        }
        out
    }
}
