//! Piecewise cubics over station: heights, bank, lane edges.
//!
//! Each piece is `a + b u + c u² + d u³` with `u = s - start`, as OpenDRIVE writes elevation,
//! superelevation, lane offset and width. The first piece also holds before its start at its
//! start value, the last one ends at `end` and is held there.

use alloc::{vec, vec::Vec};

/// One cubic by its ends: (start m, end m, (value, slope) at the start, (value, slope) at the end).
#[cfg(feature = "std")]
pub(crate) type Span = (f64, f64, (f64, f64), (f64, f64));

/// A function of station made of cubics.
#[derive(Debug, Clone, PartialEq)]
pub struct Cubics {
    starts_m: Vec<f64>,
    coefficients: Vec<[f64; 4]>,
    end_m: f64,
    /// The value everywhere, where it is one.
    constant: Option<f64>,
}

impl Default for Cubics {
    fn default() -> Self {
        Self::constant(0.0)
    }
}

impl Cubics {
    /// A constant.
    #[must_use]
    pub fn constant(value: f64) -> Self {
        Self::of_pieces(vec![0.0], vec![[value, 0.0, 0.0, 0.0]])
    }

    fn of_pieces(starts_m: Vec<f64>, coefficients: Vec<[f64; 4]>) -> Self {
        let constant = match coefficients[..] {
            // plus zero, as the sum of a piece has it
            [[a, b, c, d]] if b == 0.0 && c == 0.0 && d == 0.0 => Some(a + 0.0),
            _ => None,
        };
        Self { starts_m, coefficients, end_m: f64::MAX, constant }
    }

    /// From pieces (start m, `[a, b, c, d]`) in order of station; pieces out of order are left
    /// out, no piece gives the constant zero.
    #[must_use]
    pub fn from_pieces(pieces: &[(f64, [f64; 4])]) -> Self {
        let (mut starts_m, mut coefficients) = (Vec::new(), Vec::new());
        for &(start, c) in pieces {
            match starts_m.last() {
                Some(&last) if start < last => {}
                Some(&last) if start == last => {
                    let i = coefficients.len() - 1;
                    coefficients[i] = c;
                }
                _ => {
                    starts_m.push(start);
                    coefficients.push(c);
                }
            }
        }
        if starts_m.is_empty() { Self::default() } else { Self::of_pieces(starts_m, coefficients) }
    }

    /// Through knots (station m, value, slope) in order of station, cubic between them, constant
    /// outside. Knots closer than a micrometre are merged.
    #[must_use]
    pub fn hermite(knots: &[(f64, f64, f64)]) -> Self {
        let mut pieces: Vec<(f64, [f64; 4])> = Vec::with_capacity(knots.len());
        for w in knots.windows(2) {
            let ((s0, y0, m0), (s1, y1, m1)) = (w[0], w[1]);
            let h = s1 - s0;
            if h > 1e-6 {
                let chord = (y1 - y0) / h;
                let c = (3.0 * chord - 2.0 * m0 - m1) / h;
                let d = (m0 + m1 - 2.0 * chord) / (h * h);
                pieces.push((s0, [y0, m0, c, d]));
            }
        }
        match knots {
            [] => Self::default(),
            [only] => Self::constant(only.1),
            [.., last] if pieces.is_empty() => Self::constant(last.1),
            [.., last] => Self { end_m: last.0, ..Self::from_pieces(&pieces) },
        }
    }

    /// Straight lines between (station m, value) points.
    #[must_use]
    pub fn linear(points: &[(f64, f64)]) -> Self {
        let mut pieces: Vec<(f64, [f64; 4])> = Vec::with_capacity(points.len());
        for w in points.windows(2) {
            let h = w[1].0 - w[0].0;
            if h > 0.0 {
                pieces.push((w[0].0, [w[0].1, (w[1].1 - w[0].1) / h, 0.0, 0.0]));
            }
        }
        match points {
            [] => Self::default(),
            [only] => Self::constant(only.1),
            [.., last] if pieces.is_empty() => Self::constant(last.1),
            [.., last] => Self { end_m: last.0, ..Self::from_pieces(&pieces) },
        }
    }

    /// Smooth steps between (station m, value) points: cubic with level ends.
    #[must_use]
    pub fn smooth_steps(points: &[(f64, f64)]) -> Self {
        let knots: Vec<_> = points.iter().map(|&(s, y)| (s, y, 0.0)).collect();
        Self::hermite(&knots)
    }

    /// The integral of straight lines between (station m, slope) points, starting at `value`: a
    /// height whose slope is continuous.
    #[must_use]
    pub fn integral_of_linear(value: f64, slope: &[(f64, f64)]) -> Self {
        let mut y = value;
        let mut knots = Vec::with_capacity(slope.len());
        let mut before: Option<(f64, f64)> = None;
        for &(s, m) in slope {
            if let Some((s0, m0)) = before {
                y += 0.5 * (m0 + m) * (s - s0);
            }
            knots.push((s, y, m));
            before = Some((s, m));
        }
        Self::hermite(&knots)
    }

    /// From spans in order; values may jump between spans. A span that continues the constant before it is merged into it.
    #[cfg(feature = "std")]
    pub(crate) fn from_spans(spans: &[Span], end_m: f64) -> Self {
        let mut pieces: Vec<(f64, [f64; 4])> = Vec::with_capacity(spans.len());
        for &(s0, s1, (y0, m0), (y1, m1)) in spans {
            let h = s1 - s0;
            if h <= 1e-4 {
                continue;
            }
            let chord = (y1 - y0) / h;
            let c = (3.0 * chord - 2.0 * m0 - m1) / h;
            let d = (m0 + m1 - 2.0 * chord) / (h * h);
            let level = (y1 - y0).abs() < 1e-12 && m0.abs() < 1e-14 && m1.abs() < 1e-14;
            let piece = if level { [y0, 0.0, 0.0, 0.0] } else { [y0, m0, c, d] };
            let same = pieces
                .last()
                .is_some_and(|p| level && p.1[1..] == [0.0; 3] && (p.1[0] - y0).abs() < 1e-12);
            if !same {
                pieces.push((s0, piece));
            }
        }
        if pieces.is_empty() {
            Self::default()
        } else {
            Self { end_m, ..Self::from_pieces(&pieces) }
        }
    }

    fn piece(&self, s_m: f64) -> (usize, f64) {
        let s = if s_m < self.end_m { s_m } else { self.end_m };
        let i = locate(&self.starts_m, s);
        (i, (s - self.starts_m[i]).max(0.0))
    }

    /// Value at a station.
    #[must_use]
    #[inline]
    pub fn at(&self, s_m: f64) -> f64 {
        // Most lanes and grades of a highway are one constant.
        self.constant.unwrap_or_else(|| self.by_piece(s_m))
    }

    /// The value everywhere, where it is one.
    #[inline]
    #[must_use]
    pub const fn as_constant(&self) -> Option<f64> {
        self.constant
    }

    fn by_piece(&self, s_m: f64) -> f64 {
        let (i, u) = self.piece(s_m);
        let [a, b, c, d] = self.coefficients[i];
        a + u * (b + u * (c + u * d))
    }

    /// Value and slope at a station; at a joint those of the piece that begins there.
    #[must_use]
    pub fn at_with_slope(&self, s_m: f64) -> (f64, f64) {
        let (i, u) = self.piece(s_m);
        let [a, b, c, d] = self.coefficients[i];
        (a + u * (b + u * (c + u * d)), b + u * (2.0 * c + u * 3.0 * d))
    }

    /// Value and slope at the far end of a span, read from the piece that holds its middle, so
    /// that a jump at the end is not seen.
    #[must_use]
    pub fn at_with_slope_in(&self, s_m: f64, inside_m: f64) -> (f64, f64) {
        let (i, _) = self.piece(inside_m);
        let [a, b, c, d] = self.coefficients[i];
        let u = s_m - self.starts_m[i];
        (a + u * (b + u * (c + u * d)), b + u * (2.0 * c + u * 3.0 * d))
    }

    /// The pieces: (start m, `[a, b, c, d]`).
    pub fn pieces(&self) -> impl Iterator<Item = (f64, [f64; 4])> + '_ {
        self.starts_m.iter().copied().zip(self.coefficients.iter().copied())
    }

    /// Starts of the pieces, m.
    #[must_use]
    pub fn starts_m(&self) -> &[f64] {
        &self.starts_m
    }
}

/// Tables up to this length are bisected.
const SHORT_TABLE: usize = 64;

/// Index of the last start at or before `s` (0 if none): by bisection for short tables, else a guess
/// as if the starts were evenly spaced, a few steps from it, and bisection where they are not.
fn locate(starts: &[f64], s: f64) -> usize {
    let last = starts.len() - 1;
    if last == 0 || !(s > starts[0]) {
        return 0;
    }
    if last < SHORT_TABLE {
        return starts.partition_point(|&v| v <= s) - 1;
    }
    let share = (s - starts[0]) / (starts[last] - starts[0]);
    let mut i = ((share * last as f64) as usize).min(last);
    for _ in 0..4 {
        if starts[i] > s {
            i -= 1;
        } else if i < last && starts[i + 1] <= s {
            i += 1;
        } else {
            return i;
        }
    }
    starts.partition_point(|&v| v <= s) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hermite_reproduces_a_cubic_and_holds_its_ends() {
        let f = |s: f64| 1.0 + 2.0 * s - 0.3 * s * s + 0.01 * s * s * s;
        let g = |s: f64| 2.0 - 0.6 * s + 0.03 * s * s;
        let c =
            Cubics::hermite(&[(0.0, f(0.0), g(0.0)), (3.0, f(3.0), g(3.0)), (9.0, f(9.0), g(9.0))]);
        for s in [0.0, 0.7, 3.0, 5.5, 9.0] {
            let (v, m) = c.at_with_slope(s);
            assert!((v - f(s)).abs() < 1e-12 && (m - g(s)).abs() < 1e-12, "{s}");
        }
        assert_eq!(c.at(-5.0), f(0.0));
        assert!((c.at(50.0) - f(9.0)).abs() < 1e-12);
    }

    #[test]
    fn a_piece_at_the_same_start_replaces_and_one_out_of_order_is_left_out() {
        let c = Cubics::from_pieces(&[
            (0.0, [1.0, 0.0, 0.0, 0.0]),
            (0.0, [2.0, 0.0, 0.0, 0.0]),
            (10.0, [3.0, 0.0, 0.0, 0.0]),
            (5.0, [9.0, 0.0, 0.0, 0.0]),
        ]);
        assert_eq!((c.at(1.0), c.at(7.0), c.at(12.0)), (2.0, 2.0, 3.0));
    }

    #[test]
    fn pieces_are_found_however_unevenly_they_lie() {
        let mut starts = vec![0.0, 0.1, 0.2, 0.3, 5.0, 5.5, 100.0, 1_000.0, 1_000.5];
        starts.extend((0..90).map(|i| 1_100.0 + f64::from(i * i)));
        for i in -10..60_000 {
            let s = f64::from(i) * 0.1;
            let expected = starts.iter().rposition(|v| *v <= s).unwrap_or(0);
            assert_eq!(locate(&starts, s), expected, "{s}");
        }
    }

    #[test]
    fn the_integral_of_a_linear_slope_has_that_slope() {
        let c = Cubics::integral_of_linear(5.0, &[(0.0, 0.0), (10.0, 0.02), (30.0, -0.02)]);
        assert!((c.at(10.0) - 5.1).abs() < 1e-12);
        assert!((c.at_with_slope(20.0).1).abs() < 1e-12);
        assert!((c.at(30.0) - 5.1).abs() < 1e-12);
    }
}
