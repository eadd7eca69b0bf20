//! A drawn road: grade, curvature and speed limit over the position.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Spacing of the tables, m.
const STEP_M: f64 = 5.0;

/// A road of drawn hills and curves.
pub(crate) struct Road {
    grade: Vec<f64>,
    curvature: Vec<f64>,
    limit: Vec<f64>,
    altitude: Vec<f64>,
}

/// A normal number (sum of uniforms).
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// A number between two bounds.
pub(crate) fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Moving mean, twice: corners become parabolas.
fn smooth(x: &[f64], half: usize) -> Vec<f64> {
    let mean = |x: &[f64]| -> Vec<f64> {
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
    };
    mean(&mean(x))
}

impl Road {
    /// A road of `length_m` that starts at an altitude; `hilliness` is the spread of its grade.
    pub(crate) fn draw(
        rng: &mut ChaCha8Rng,
        length_m: f64,
        start_altitude_m: f64,
        hilliness: f64,
    ) -> Self {
        let n = (length_m / STEP_M) as usize + 400;
        let (mut grade, mut curvature, mut limit) = (Vec::new(), Vec::new(), Vec::new());
        while grade.len() < n {
            let cells = between(rng, 300.0, 1500.0) / STEP_M;
            let g = (hilliness * normal(rng)).clamp(-0.055, 0.055);
            grade.extend(std::iter::repeat_n(g, cells as usize));
        }
        while curvature.len() < n {
            let straight = between(rng, 100.0, 900.0) / STEP_M;
            curvature.extend(std::iter::repeat_n(0.0, straight as usize));
            let radius = between(rng, 0.0, 1.0).mul_add(between(rng, 0.0, 1800.0), 380.0);
            let side = if rng.random::<bool>() { 1.0 } else { -1.0 };
            let arc = between(rng, 0.15, 0.9) * radius / STEP_M;
            curvature.extend(std::iter::repeat_n(side / radius, (arc as usize).clamp(20, 300)));
        }
        while limit.len() < n {
            let slow = rng.random::<f64>() < 0.35;
            let v = if slow { between(rng, 5.0, 14.0) } else { between(rng, 17.5, 24.3) };
            let length = if slow { between(rng, 80.0, 400.0) } else { between(rng, 800.0, 3000.0) };
            limit.extend(std::iter::repeat_n(v, (length / STEP_M) as usize));
        }
        let (grade, curvature) = (smooth(&grade[..n], 12), smooth(&curvature[..n], 8));
        let mut altitude = vec![start_altitude_m];
        for g in &grade {
            altitude.push(altitude[altitude.len() - 1] + STEP_M * g / (1.0 + g * g).sqrt());
        }
        Self { grade, curvature, limit: limit[..n].to_vec(), altitude }
    }

    fn at(table: &[f64], s_m: f64) -> f64 {
        let x = (s_m / STEP_M).clamp(0.0, (table.len() - 2) as f64);
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

    /// m above sea.
    pub(crate) fn altitude(&self, s_m: f64) -> f64 {
        Self::at(&self.altitude, s_m)
    }

    /// Speed that the driver may reach at `s_m` if he brakes in time for what follows, m/s.
    pub(crate) fn target(&self, s_m: f64, decel_m_s2: f64) -> f64 {
        let from = (s_m / STEP_M).max(0.0) as usize;
        (from..(from + 60).min(self.limit.len()))
            .map(|i| {
                let ahead = (i as f64 * STEP_M - s_m).max(0.0);
                (self.limit[i] * self.limit[i] + 2.0 * decel_m_s2 * ahead).sqrt()
            })
            .fold(f64::INFINITY, f64::min)
    }
}
