//! Collects every violated bound of a truck file, so that one reading names them all.

use tractrix_core::{CoreError, Curve};

/// Bounds of a parameter block, with the block's name before each key.
#[derive(Debug)]
pub(crate) struct Bounds {
    block: &'static str,
    pub(crate) violations: Vec<String>,
}

impl Bounds {
    pub(crate) const fn of(block: &'static str) -> Self {
        Self { block, violations: Vec::new() }
    }

    /// `low <= value <= high`; NaN violates.
    pub(crate) fn within(&mut self, key: &str, value: f64, low: f64, high: f64) {
        if !(value >= low && value <= high) {
            self.violations
                .push(format!("{}.{key} = {value} is outside {low} to {high}", self.block));
        }
    }

    /// A table that must be a curve.
    pub(crate) fn curve(&mut self, key: &str, x: &[f64], y: &[f64]) {
        self.result(key, Curve::new(key, x.to_vec(), y.to_vec()).map(|_| ()));
    }

    pub(crate) fn result(&mut self, key: &str, result: Result<(), CoreError>) {
        if let Err(e) = result {
            self.violations.push(format!("{}.{key}: {e}", self.block));
        }
    }

    pub(crate) fn require(&mut self, ok: bool, why: String) {
        if !ok {
            self.violations.push(format!("{}.{why}", self.block));
        }
    }
}
