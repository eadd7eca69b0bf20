//! A route: grade as a smooth random process over the position, bends with clothoids, limits.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::super::random::{between, normal, sign};

use super::Trip;

/// Spacing of the tables, m.
const CELL_M: f64 = 5.0;

/// Grade, curvature and limit over the position.
pub(crate) struct Route {
    grade: Vec<f64>,
    curvature: Vec<f64>,
    limit: Vec<f64>,
}

impl Route {
    pub(crate) fn draw(trip: &Trip, length_m: f64, rng: &mut ChaCha8Rng) -> Self {
        let n = (length_m / CELL_M) as usize + 400;
        // Three first-order filters in a row: hills of about a kilometre.
        let cells = between(rng, 250.0, 420.0) / CELL_M;
        let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
        let raw: Vec<f64> = (0..n + 300)
            .map(|_| {
                a += -a / cells + (2.0 / cells).sqrt() * normal(rng);
                b += (a - b) / cells;
                c += (b - c) / cells;
                c
            })
            .skip(300)
            .collect();
        let mean = raw.iter().sum::<f64>() / n as f64;
        let spread = (raw.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n as f64).sqrt();
        let grade = raw
            .iter()
            .map(|x| (trip.climb + trip.hills * (x - mean) / spread).clamp(-0.055, 0.055))
            .collect();
        let mut curvature = Vec::with_capacity(n);
        while curvature.len() < n {
            let straight = (between(rng, 60.0, 600.0) / CELL_M) as usize;
            curvature.extend(std::iter::repeat_n(0.0, straight));
            let bend = sign(rng) * (between(rng, 0.0005_f64.ln(), 0.0028_f64.ln())).exp();
            let arc = (between(rng, 100.0, 350.0) / CELL_M) as usize;
            let ramp = (between(rng, 50.0, 110.0) / CELL_M) as usize;
            curvature.extend((0..ramp).map(|i| bend * i as f64 / ramp as f64));
            curvature.extend(std::iter::repeat_n(bend, arc));
            curvature.extend((0..ramp).map(|i| bend * (1.0 - i as f64 / ramp as f64)));
        }
        let mut limit = Vec::with_capacity(n);
        while limit.len() < n {
            let (v, length) = match rng.random_range(0..5) {
                0 => (between(rng, 5.5, 9.0), between(rng, 150.0, 450.0)),
                1 => (between(rng, 11.0, 15.5), between(rng, 400.0, 1200.0)),
                _ => (trip.cruise_m_s * between(rng, 0.8, 1.0), between(rng, 800.0, 3000.0)),
            };
            limit.extend(std::iter::repeat_n(v, (length / CELL_M) as usize));
        }
        Self { grade, curvature, limit }
    }

    fn at(table: &[f64], place_m: f64) -> f64 {
        let x = (place_m / CELL_M).clamp(0.0, (table.len() - 2) as f64);
        let i = x as usize;
        table[i] + (x - i as f64) * (table[i + 1] - table[i])
    }

    /// Rise over run.
    pub(crate) fn grade(&self, place_m: f64) -> f64 {
        Self::at(&self.grade, place_m)
    }

    /// 1/m, positive left.
    pub(crate) fn curvature(&self, place_m: f64) -> f64 {
        Self::at(&self.curvature, place_m)
    }

    /// Speed from which `decel` m/s² meets every limit of the next 320 m and 1.8 m/s² of side
    /// acceleration in its bends, m/s.
    pub(crate) fn speed(&self, place_m: f64, decel: f64) -> f64 {
        let from = (place_m / CELL_M).max(0.0) as usize;
        let to = (from + 64).min(self.limit.len()).min(self.curvature.len());
        (from..to)
            .map(|i| {
                let bend = (1.8 / self.curvature[i].abs().max(1e-4)).sqrt();
                let ahead = (i as f64 * CELL_M - place_m).max(0.0);
                (self.limit[i].min(bend).powi(2) + 2.0 * decel * ahead).sqrt()
            })
            .fold(f64::INFINITY, f64::min)
    }
}
