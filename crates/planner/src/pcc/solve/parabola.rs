//! An interval's fuel over traction as a subproblem has it above zero wheel force.

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_convex_parabola_is_met_and_a_concave_one_becomes_its_chord() {
        let convex = Parabola::through(|p| 2.0 + p + 3.0 * p * p, 0.1, 0.3);
        assert!((convex.q1 - 1.0).abs() < 1e-12 && (convex.q2 - 6.0).abs() < 1e-12, "{convex:?}");
        assert!((convex.first_g - 2.13).abs() < 1e-12);
        let concave = Parabola::through(|p| 5.0 * p - p * p, 0.0, 1.0);
        assert_eq!((concave.q1, concave.q2), (3.0, 0.0));
    }
}
