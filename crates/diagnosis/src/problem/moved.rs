//! Tolerances of where a noisy record is read, where a fit has moved that.
//!
//! A map errs by itself, by `n` at a place. Its tolerance has the column `g' + n'`, and what is left
//! of a map that is moved by `theta` has `n(theta)`. Taken from where nothing is moved the two go
//! together at every `theta` but none, the tolerance takes part of the map's own error at any shift,
//! and shifts come out a third too large. Taken where the map is, `n` and `n'` have nothing to do with
//! each other: the column is worked out anew with the directions of a fit. So it is with the time at
//! which the torque message is read for its fuel: without, the lag of a fuel rate that comes with its
//! torque was learned as -0.08 s.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::signals::Line;
use super::{Direction, Problem, nuisance_directions};
use crate::causes::param::{P, Theta};

/// Shifts of which a drive keeps the column: those of the steps of one fit.
const KEPT: usize = 4;

/// Where the map is read, and when the torque message.
const READ: [P; 2] = [P::MapShift, P::FuelLag];

/// Whether the sensitivity to a tolerance has to be taken where the fit is, and to both sides: an error
/// that a secant shares with its foot pulls to one side.
pub(crate) fn moves(p: P) -> bool {
    READ.contains(&p)
}

/// The columns of what is read elsewhere than in the calibration.
pub(super) struct Moved {
    /// With their numbers among the tolerances.
    columns: Vec<(usize, Line)>,
    /// Cholesky factor of `I + Z'Z`.
    pub(super) factor: Cholesky<f64, Dyn>,
    /// Information of the drive about the means of the tolerances.
    pub(super) information: DMatrix<f64>,
}

/// Columns of one drive by what is read where.
#[derive(Default)]
pub(super) struct Shifts(Mutex<HashMap<[u64; READ.len()], Arc<Moved>>>);

impl Shifts {
    /// Forgets all: noise or tolerances have changed.
    pub(super) fn renew(&self) {
        if let Ok(mut kept) = self.0.lock() {
            kept.clear();
        }
    }
}

impl Problem<'_> {
    /// The columns of drive `i` where `theta` reads; `None` where that is as in the calibration.
    pub(super) fn moved(&self, i: usize, theta: &Theta) -> Option<Arc<Moved>> {
        let reference = &self.reference;
        let elsewhere: Vec<P> = READ
            .into_iter()
            .filter(|p| theta[*p as usize] != reference.theta[*p as usize])
            .filter(|p| reference.tolerance[*p as usize] > 0.0)
            .collect();
        if elsewhere.is_empty() {
            return None;
        }
        let key = READ.map(|p| theta[p as usize].to_bits());
        if let Some(kept) = self.shifts[i].0.lock().ok()?.get(&key) {
            return Some(kept.clone());
        }
        let mut there = reference.theta;
        READ.iter().for_each(|p| there[*p as usize] = theta[*p as usize]);
        let directions = nuisance_directions(&reference.tolerance);
        let columns = elsewhere.into_iter().map(|p| {
            let at = directions.iter().position(|d| d.p == p)?;
            Some((at, self.line(i, &there, &Direction::new(p, Vec::new(), p.spec().step))))
        });
        let columns: Vec<(usize, Line)> = columns.collect::<Option<_>>()?;
        let nuisance = &self.nuisance[i];
        let mut scaled = nuisance.scaled();
        for (at, column) in &columns {
            let mut products = self.products(i, column);
            columns.iter().for_each(|(j, other)| products[*j] = self.dot(i, other, column));
            for (j, product) in products.iter().enumerate() {
                let both = nuisance.sigma[*at] * nuisance.sigma[j] * product;
                (scaled[(*at, j)], scaled[(j, *at)]) = (both, both);
            }
        }
        let q = scaled.nrows();
        let factor = (scaled + DMatrix::identity(q, q)).cholesky()?;
        let information = self.information(&factor);
        let moved = Arc::new(Moved { columns, factor, information });
        let mut kept = self.shifts[i].0.lock().ok()?;
        if kept.len() >= KEPT {
            kept.clear();
        }
        kept.insert(key, moved.clone());
        Some(moved)
    }

    /// Products of a line with the tolerances of drive `i` in their standard deviations, those of where
    /// it reads taken there.
    pub(super) fn against_at(&self, i: usize, line: &Line, moved: Option<&Moved>) -> DVector<f64> {
        let mut out = self.against(i, line);
        for (at, column) in moved.iter().flat_map(|m| &m.columns) {
            out[*at] = self.nuisance[i].sigma[*at] * self.dot(i, column, line);
        }
        out
    }
}
