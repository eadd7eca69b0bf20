//! The engine's torque curves as the planner reads them: two curves on common knots, found in one
//! step through equal buckets instead of one search per curve.
//!
//! Both curves are linear between their knots and constant outside, so on the union of the knots
//! they stay what they were.

use alloc::vec::Vec;

use tractrix_core::Curve;

/// Buckets per knot.
const BUCKETS_PER_KNOT: usize = 4;

/// Full load and friction over engine speed.
#[derive(Debug, Clone)]
pub(super) struct TorqueCurves {
    knots: Vec<Knot>,
    /// Last knot at or below the beginning of each bucket.
    bucket: Vec<u32>,
    buckets_per_rad_s: f64,
}

/// Torques at a knot and their slopes up to the next.
#[derive(Debug, Clone, Copy)]
struct Knot {
    speed_rad_s: f64,
    torque_nm: Torque,
    slope: Torque,
}

/// Full-load and friction torque, Nm (or their slopes, Nm s/rad).
#[derive(Debug, Clone, Copy)]
pub(super) struct Torque {
    pub(super) full_load: f64,
    pub(super) friction: f64,
}

impl TorqueCurves {
    /// Two checked curves: abscissae finite and increasing, at least one.
    pub(super) fn new(full_load_nm: &Curve, friction_nm: &Curve) -> Self {
        let mut speeds: Vec<f64> =
            full_load_nm.x().iter().chain(friction_nm.x()).copied().collect();
        speeds.sort_by(f64::total_cmp);
        speeds.dedup();
        let at = |w: f64| Torque { full_load: full_load_nm.at(w), friction: friction_nm.at(w) };
        let knots: Vec<Knot> = (0..speeds.len())
            .map(|i| {
                let (w, next) = (speeds[i], speeds[(i + 1).min(speeds.len() - 1)]);
                let (a, b) = (at(w), at(next));
                let over = (next - w).max(f64::MIN_POSITIVE);
                let slope = Torque {
                    full_load: (b.full_load - a.full_load) / over,
                    friction: (b.friction - a.friction) / over,
                };
                Knot { speed_rad_s: w, torque_nm: a, slope }
            })
            .collect();
        let (first, last) = (speeds[0], speeds[speeds.len() - 1]);
        let count = BUCKETS_PER_KNOT * speeds.len();
        let width = (last - first) / count as f64;
        let bucket = (0..count)
            .map(|i| {
                let begin = first + i as f64 * width;
                speeds.partition_point(|&w| w <= begin).saturating_sub(1) as u32
            })
            .collect();
        let buckets_per_rad_s = if width > 0.0 { 1.0 / width } else { 0.0 };
        Self { knots, bucket, buckets_per_rad_s }
    }

    /// Torques at an engine speed.
    pub(super) fn at(&self, speed_rad_s: f64) -> Torque {
        let above = speed_rad_s - self.knots[0].speed_rad_s;
        // A negative or missing number becomes the first bucket.
        let b = ((above * self.buckets_per_rad_s) as usize).min(self.bucket.len() - 1);
        let mut i = self.bucket[b] as usize;
        while i + 1 < self.knots.len() && self.knots[i + 1].speed_rad_s <= speed_rad_s {
            i += 1;
        }
        let Knot { speed_rad_s: knot, torque_nm, slope } = self.knots[i];
        // Below the first knot as at the first; beyond the last its slope is zero.
        let over = (speed_rad_s - knot).max(0.0);
        Torque {
            full_load: torque_nm.full_load + over * slope.full_load,
            friction: torque_nm.friction + over * slope.friction,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn common_knots_give_what_each_curve_gives_inside_and_outside_its_range() {
        let full =
            Curve::new("full", vec![60.0, 90.0, 91.0, 180.0], vec![900.0, 2600.0, 2590.0, 0.0]);
        let friction = Curve::new("friction", vec![50.0, 110.0, 200.0], vec![90.0, 140.0, 260.0]);
        let flat = Curve::new("flat", vec![100.0], vec![120.0]);
        let (full, friction, flat) = (full.unwrap(), friction.unwrap(), flat.unwrap());
        for (a, b) in [(&full, &friction), (&full, &flat), (&flat, &flat)] {
            let both = TorqueCurves::new(a, b);
            for i in 0..2600 {
                let w = 0.1 * f64::from(i);
                let found = both.at(w);
                assert!((found.full_load - a.at(w)).abs() < 1e-9, "{w}");
                assert!((found.friction - b.at(w)).abs() < 1e-9, "{w}");
            }
        }
    }
}
