//! A drawn road: grade, curvature and target speed over the position.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::random::{between, normal, sign};

/// Spacing of the tables, m.
const CELL_M: f64 = 4.0;

/// Hills, curves and speeds of one route.
pub(crate) struct Road {
    grade: Vec<f64>,
    curvature: Vec<f64>,
    speed: Vec<f64>,
}

/// Running mean over `2 half + 1` cells.
fn mean(x: &[f64], half: usize) -> Vec<f64> {
    let mut sum = vec![0.0];
    for v in x {
        sum.push(sum[sum.len() - 1] + v);
    }
    (0..x.len())
        .map(|i| {
            let (a, b) = (i.saturating_sub(half), (i + half + 1).min(x.len()));
            (sum[b] - sum[a]) / (b - a) as f64
        })
        .collect()
}

impl Road {
    /// A route of `length_m` whose grade spreads by `hills` around `climb`, driven at `cruise` m/s.
    pub(crate) fn draw(
        rng: &mut ChaCha8Rng,
        length_m: f64,
        hills: f64,
        climb: f64,
        cruise: f64,
    ) -> Self {
        let n = (length_m / CELL_M) as usize + 500;
        let mut grade = Vec::with_capacity(n);
        while grade.len() < n {
            let g = (climb + 1.35 * hills * normal(rng)).clamp(-0.052, 0.052);
            grade.extend(std::iter::repeat_n(g, (between(rng, 250.0, 2600.0) / CELL_M) as usize));
        }
        let mut curvature = Vec::with_capacity(n);
        while curvature.len() < n {
            let straight = between(rng, 40.0, 700.0);
            curvature.extend(std::iter::repeat_n(0.0, (straight / CELL_M) as usize));
            let bend = sign(rng) * between(rng, 0.0004, 0.0026);
            let arc = (between(rng, 0.1, 0.9) / bend.abs()).clamp(100.0, 700.0);
            curvature.extend(std::iter::repeat_n(bend, (arc / CELL_M) as usize));
        }
        let mut speed = Vec::with_capacity(n);
        while speed.len() < n {
            let slow = rng.random::<f64>() < 0.45;
            let (v, length) = if slow {
                (cruise * between(rng, 0.25, 0.7), between(rng, 150.0, 900.0))
            } else {
                (cruise * between(rng, 0.72, 1.0), between(rng, 500.0, 2500.0))
            };
            speed.extend(std::iter::repeat_n(v, (length / CELL_M) as usize));
        }
        grade.truncate(n);
        curvature.truncate(n);
        speed.truncate(n);
        let grade = mean(&mean(&grade, 45), 25);
        Self { grade, curvature: mean(&curvature, 10), speed }
    }

    fn at(table: &[f64], s_m: f64) -> f64 {
        let x = (s_m / CELL_M).clamp(0.0, (table.len() - 2) as f64);
        let i = x as usize;
        table[i] + (x - i as f64) * (table[i + 1] - table[i])
    }

    /// Rise over run.
    pub(crate) fn grade(&self, s_m: f64) -> f64 {
        Self::at(&self.grade, s_m)
    }

    /// 1/m, positive left.
    pub(crate) fn curvature(&self, s_m: f64) -> f64 {
        Self::at(&self.curvature, s_m)
    }

    /// Speed at which the driver wants to be at `s_m` who slows by `decel` for what he sees, m/s.
    pub(crate) fn wanted(&self, s_m: f64, decel: f64) -> f64 {
        let from = (s_m / CELL_M).max(0.0) as usize;
        (from..(from + 70).min(self.speed.len()))
            .map(|i| {
                let ahead = (i as f64 * CELL_M - s_m).max(0.0);
                (self.speed[i] * self.speed[i] + 2.0 * decel * ahead).sqrt()
            })
            .fold(f64::INFINITY, f64::min)
    }
}
