//! An interval's fuel over traction as a subproblem has it: a parabola, cheaper below one kink.
//!
//! Over all tractions the kink is at zero wheel force, where the driveline's losses change sides. Over
//! a part of them around a plan it is where the map's slope rises most: a measured map is linear
//! between the torques of its test bench, and a plan that costs least sits on one of them for long.

/// Points at which a part is read.
const POINTS: usize = 13;
/// Part of the rise of slope in the range that a kink has.
const LEAST_SHARE: f64 = 0.6;

/// `q1 p + q2 p²/2` above a kink, straight below it; g, m/s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FuelCosts {
    /// Linear cost above the kink, g per m/s².
    pub(super) q1: f64,
    /// Quadratic cost above it, g per (m/s²)².
    pub(super) q2: f64,
    /// Traction of the kink, m/s².
    pub(super) kink: f64,
    /// Slope below it, g per m/s².
    pub(super) below: f64,
}

impl FuelCosts {
    /// The fuel `fuel_g` from `first` to `first + 2 half`, cut off at zero: its kink if it has one,
    /// else the parabola of the part above the present kink.
    pub(super) fn near(self, fuel_g: impl Fn(f64) -> f64, first: f64, half: f64) -> Self {
        let low = first.max(0.0);
        if let Some(Kink { at, below, above }) = Kink::of(&fuel_g, low, low + 2.0 * half) {
            return Self { q1: above, q2: 0.0, kink: at, below };
        }
        let Parabola { q1, q2, .. } = Parabola::through(fuel_g, first.max(self.kink), half);
        Self { q1, q2, ..self }
    }
}

/// A parabola through three points, no less curved than a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Parabola {
    /// Slope at zero.
    pub(super) q1: f64,
    /// Curvature, not negative.
    pub(super) q2: f64,
    /// Value at the first point.
    pub(super) first_g: f64,
}

impl Parabola {
    /// Through `f` at `first`, `first + half` and `first + 2 half`.
    pub(super) fn through(f: impl Fn(f64) -> f64, first: f64, half: f64) -> Self {
        let f = [0.0, 1.0, 2.0].map(|u| f(first + u * half));
        let bend = (f[2] - 2.0 * f[1] + f[0]) / (half * half);
        let q2 = bend.max(0.0);
        Self { q1: (f[2] - f[0]) / (2.0 * half) - q2 * (first + half), q2, first_g: f[0] }
    }
}

/// Where a slope rises at once.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Kink {
    at: f64,
    below: f64,
    above: f64,
}

impl Kink {
    /// The kink of `f` between `low` and `high`, if most of the rise of its slope is there.
    fn of(f: impl Fn(f64) -> f64, low: f64, high: f64) -> Option<Self> {
        let step = (high - low) / (POINTS - 1) as f64;
        let at: [f64; POINTS] = core::array::from_fn(|i| low + i as f64 * step);
        let value = at.map(f);
        let slope = |i: usize| (value[i + 1] - value[i]) / step;
        let rise = |i: usize| slope(i) - slope(i - 1);
        let all: f64 = (1..POINTS - 1).map(|i| rise(i).max(0.0)).sum();
        // A kink between two points shows in both.
        let pair = |i: usize| rise(i) + rise(i + 1);
        let i = (2..POINTS - 3).max_by(|&a, &b| pair(a).total_cmp(&pair(b)))?;
        let (below, above) = (slope(i - 1), slope(i + 1));
        if pair(i) < LEAST_SHARE * all || above <= below {
            return None;
        }
        // Where the line from below meets that from above.
        let gap = value[i + 1] - value[i] - below * step;
        let to_kink = (step - gap / (above - below)).clamp(0.0, step);
        Some(Self { at: at[i] + to_kink, below, above })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kink_is_found_where_it_is_with_both_slopes() {
        let bent = |p: f64| 2.0 * p + 3.0 * (p - 0.437).max(0.0);
        let kink = Kink::of(bent, 0.1, 0.9).unwrap();
        assert!((kink.at - 0.437).abs() < 1e-12, "{kink:?}");
        assert!((kink.below - 2.0).abs() < 1e-12 && (kink.above - 5.0).abs() < 1e-12, "{kink:?}");
        let costs = FuelCosts { q1: 1.0, q2: 0.0, kink: 0.1, below: 0.5 }.near(bent, 0.1, 0.4);
        assert_eq!((costs.q1, costs.q2, costs.kink), (kink.above, 0.0, kink.at));
    }

    #[test]
    fn a_smooth_map_and_a_dent_have_no_kink_and_get_their_parabola() {
        let smooth = |p: f64| p + p * p;
        assert_eq!(Kink::of(smooth, 0.1, 0.9), None);
        let dent = |p: f64| 5.0 * p - 3.0 * (p - 0.437).max(0.0);
        assert_eq!(Kink::of(dent, 0.1, 0.9), None);
        let whole = FuelCosts { q1: 9.0, q2: 9.0, kink: 0.2, below: 0.5 };
        let costs = whole.near(smooth, 0.1, 0.3);
        assert!((costs.q1 - 1.0).abs() < 1e-9 && (costs.q2 - 2.0).abs() < 1e-9, "{costs:?}");
        assert_eq!((costs.kink, costs.below), (0.2, 0.5));
        assert_eq!(whole.near(dent, 0.1, 0.3).q2, 0.0);
    }
}
