//! One drive replayed before and after: residuals per module in physical units, and the speed of
//! free runs.

use crate::Plant;
use crate::answer::gain::drive_error_by;
use crate::problem::replay;
use crate::replay::{MODULES, Module, Prepared, Residuals};
use crate::run::report_models::Models;

/// A drive with its residuals under both models.
pub(super) struct Rows {
    pub(super) drive: Prepared,
    /// Measured minus replayed, in the unit of the module's quantity.
    pub(super) before: Residuals,
    pub(super) after: Residuals,
    /// Speed of free runs of 60 s, m/s; NaN outside them.
    pub(super) speed_before: Vec<f64>,
    pub(super) speed_after: Vec<f64>,
    /// Noise that the search assumed, per module, in the unit of the module's residual.
    pub(super) sigma: [f64; MODULES],
}

impl Rows {
    pub(super) fn new(drive: Prepared, plant: &Plant, m: &Models) -> Self {
        let free_run = |theta| {
            let mut v = vec![f64::NAN; drive.n];
            drive_error_by(&drive, plant, theta, &mut |i, speed| {
                if let Some(at) = v.get_mut(i) {
                    *at = speed;
                }
            });
            v
        };
        let mut sigma = m.sigma;
        Module::ALL.iter().for_each(|m| sigma[*m as usize] *= drive.mean_unit(*m));
        let residuals = |theta| physical(&drive, replay(&drive, plant, theta));
        Self {
            before: residuals(&m.before),
            after: residuals(&m.after),
            speed_before: free_run(&m.before),
            speed_after: free_run(&m.after),
            sigma,
            drive,
        }
    }

    /// Rows of a module that count, with their residuals before and after.
    pub(super) fn of(&self, m: Module) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
        let i = m as usize;
        self.before[i]
            .iter()
            .zip(&self.after[i])
            .zip(&self.drive.valid[i])
            .enumerate()
            .filter(|(_, (_, ok))| **ok)
            .map(|(k, ((b, a), _))| (k, *b, *a))
    }

    /// How much smaller the squared residuals have become, in units of the noise.
    pub(super) fn relief(&self) -> f64 {
        Module::ALL
            .iter()
            .map(|m| {
                let s = self.sigma[*m as usize].max(1e-12);
                let fall: f64 = self.of(*m).map(|(_, b, a)| b * b - a * a).sum();
                fall / (s * s)
            })
            .sum()
    }

    /// Mean squared residual with all causes, in units of the noise, of the module that is worst.
    pub(super) fn left(&self) -> f64 {
        let of = |m: Module| {
            let s = self.sigma[m as usize].max(1e-12);
            let (sum, rows) = self.of(m).fold((0.0, 0.0), |t, (_, _, a)| (t.0 + a * a, t.1 + 1.0));
            sum / (s * s * f64::max(rows, 1.0))
        };
        Module::ALL.into_iter().map(of).fold(0.0, f64::max)
    }

    /// Sample in the middle of a row.
    pub(super) fn sample(&self, m: Module, row: usize) -> usize {
        if m == Module::Shift {
            return self.drive.shifts.get(row).map_or(0, |s| s.0);
        }
        (row * m.row_step() + m.row_step() / 2).min(self.drive.n.saturating_sub(1))
    }

    /// Measured value of a module over a row: the mean over its samples.
    pub(super) fn measured(&self, m: Module, row: usize) -> Option<f64> {
        let step = m.row_step();
        let x = self.drive.measured(m).get(row * step..(row + 1) * step)?;
        Some(x.iter().sum::<f64>() / step as f64)
    }
}

/// Residuals in their quantity's unit.
fn physical(d: &Prepared, mut r: Residuals) -> Residuals {
    for (m, rows) in Module::ALL.into_iter().zip(&mut r) {
        rows.iter_mut().enumerate().for_each(|(k, x)| *x *= d.row_unit(m, k));
    }
    r
}
