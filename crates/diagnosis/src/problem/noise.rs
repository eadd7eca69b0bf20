//! The noise of every module: what is fitted, of what order, and how small it may be.

use super::{Problem, rows};
use crate::problem::stats::slow::Slow;
use crate::problem::stats::whiten::Whitener;
use crate::replay::{Module, Prepared, Residuals};

/// Samples over which slow noise is taken as one: 8 s, beyond what the filters of any module reach.
const BLOCK_SAMPLES: usize = 160;

/// What noise is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Noise {
    White,
    /// Of drives that need not be in order: what is slow there may be what is wrong.
    Coloured,
    /// Of drives in order.
    Slow,
}

/// The noise of every module in residuals that the tolerances have left.
pub(super) fn fit_whiteners(
    drives: &[Prepared],
    residuals: &[Residuals],
    noise: Noise,
) -> Vec<Whitener> {
    Module::ALL
        .iter()
        .map(|m| {
            let i = *m as usize;
            let records = drives
                .iter()
                .zip(residuals)
                .filter(|(d, _)| d.available[i])
                .map(|(d, r)| (r[i].as_slice(), d.valid[i].as_slice()));
            let order = if noise == Noise::White { 0 } else { order(*m) };
            let block = BLOCK_SAMPLES / m.row_step();
            let fitted = Whitener::fit(records.clone(), order);
            let mut w = fitted.unwrap_or_else(|| Whitener::white(1.0));
            w.sigma = w.sigma.max(resolution(*m));
            // Events have no order, and rows of half a minute no blocks.
            if noise == Noise::Slow && order > 0 && block > 1 {
                let of = |(d, r): (&Prepared, &Residuals)| {
                    let rows = rows(d, i);
                    (w.apply(&r[i], rows.ok), w.weights(rows))
                };
                let with = drives.iter().zip(residuals).filter(|(d, _)| d.available[i]);
                w.slow = Slow::fit(&with.map(of).collect::<Vec<_>>(), block);
            }
            w
        })
        .collect()
}

/// Resolution of the channels: noise is never assumed smaller.
pub(crate) fn resolution(m: Module) -> f64 {
    match m {
        Module::Force | Module::Imu | Module::Gps => 1e-3,
        Module::Torque => 0.2,
        Module::Fuel | Module::Co2 => 0.05,
        // messages of 4 kPa a bit, mean of two samples
        Module::Brake => 0.8,
        Module::Shift => 0.02,
        Module::Yaw | Module::TrailerYaw | Module::Heading => 5e-5,
        Module::AccelY | Module::Altitude => 1e-2,
    }
}

fn order(m: Module) -> usize {
    match m {
        Module::Shift => 0,
        Module::Force | Module::Imu => 8,
        // rows that are longer than what they remember
        Module::Co2 => 2,
        _ => 6,
    }
}

/// How sums over rows of drives in order scatter that the filters should have made white.
#[derive(Debug, Clone, Copy)]
pub struct NoiseOfSums {
    /// The quantity, as in `diagnosis.json`.
    pub quantity: &'static str,
    /// Variance over that of white noise with the autoregressive filter alone, 1.
    pub autoregressive: f64,
    /// The same with slow noise, 1.
    pub slow: f64,
}

impl Problem<'_> {
    /// Sums over `rows` rows of each module that has as many in a drive; those of which less than half
    /// are valid are left out.
    pub(super) fn noise_of_sums(&self, rows_of_a_sum: usize) -> Vec<NoiseOfSums> {
        let left = self.each(|i| self.without_nuisance(i, &self.nuisance_mean(i)));
        let of = |m: &Module| {
            let i = *m as usize;
            let (w, mut sums) = (&self.reference.whiteners[i], [0.0; 3]);
            let drives = self.drives.iter().zip(&left).enumerate();
            for (at, (d, r)) in drives.filter(|(_, (d, _))| d.available[i]) {
                let both = [
                    w.apply(&r[i], &d.valid[i]),
                    w.whiten(&r[i], &d.valid[i], self.slow[at][i].as_ref()),
                ];
                let chunks = |k: usize| both[k].chunks_exact(rows_of_a_sum);
                let ok = d.valid[i].chunks_exact(rows_of_a_sum);
                for ((a, b), ok) in chunks(0).zip(chunks(1)).zip(ok) {
                    let valid = ok.iter().filter(|ok| **ok).count();
                    if 2 * valid > rows_of_a_sum {
                        sums[0] += a.iter().sum::<f64>().powi(2) / valid as f64;
                        sums[1] += b.iter().sum::<f64>().powi(2) / valid as f64;
                        sums[2] += 1.0;
                    }
                }
            }
            (sums[2] > 0.0).then(|| NoiseOfSums {
                quantity: m.quantity(),
                autoregressive: sums[0] / sums[2],
                slow: sums[1] / sums[2],
            })
        };
        Module::ALL.iter().filter_map(of).collect()
    }
}
