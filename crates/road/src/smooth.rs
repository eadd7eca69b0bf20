//! Local quadratic regression: value, slope and bend of a measured quantity along a road.
//!
//! At each sample a parabola is fitted by weighted least squares to the samples within a window
//! (biweight, W. S. Cleveland, 1979, "Robust locally weighted regression"). It reproduces a
//! parabola exactly and turns survey noise into a continuous slope. The window widens where the
//! samples are sparse, so that at least two of them on either side count.

/// The fitted parabola at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LocalFit {
    /// Value, in the unit of the data.
    pub(crate) value: f64,
    /// First derivative, per metre.
    pub(crate) slope: f64,
    /// Second derivative, per metre squared.
    pub(crate) bend: f64,
}

/// Fits at every sample; `s` increases strictly and holds at least three samples.
pub(crate) fn local_quadratic(s: &[f64], y: &[f64], half_window_m: f64) -> Vec<LocalFit> {
    let n = s.len();
    let at = |i: usize| {
        let sparse = |j: usize| 1.05 * (s[j] - s[i]).abs();
        let neighbours = sparse(i.saturating_sub(2)).max(sparse((i + 2).min(n - 1)));
        let half = half_window_m.max(neighbours);
        let first = s.partition_point(|&v| v <= s[i] - half);
        let last = s.partition_point(|&v| v < s[i] + half);
        fit(&s[first..last], &y[first..last], s[i], y[i], half)
    };
    (0..n).map(at).collect()
}

/// Normal equations of `y = a + b u + c u²` with `u = (s - s0)/half`, about the sample's own value
/// so that large coordinates keep their digits.
fn fit(s: &[f64], y: &[f64], s0: f64, y0: f64, half: f64) -> LocalFit {
    let mut m = [0.0; 5];
    let mut r = [0.0; 3];
    for (s, y) in s.iter().zip(y) {
        let u = (s - s0) / half;
        let w = (1.0 - u * u) * (1.0 - u * u);
        let mut p = w;
        for (k, m) in m.iter_mut().enumerate() {
            *m += p;
            if k < 3 {
                r[k] += p * (y - y0);
            }
            p *= u;
        }
    }
    let det = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    let columns = [[m[0], m[1], m[2]], [m[1], m[2], m[3]], [m[2], m[3], m[4]]];
    let whole = det(columns[0], columns[1], columns[2]);
    if !(whole.abs() > 1e-12 * m[0] * m[0] * m[0]) {
        return LocalFit { value: y0, slope: f64::NAN, bend: f64::NAN };
    }
    LocalFit {
        value: y0 + det(r, columns[1], columns[2]) / whole,
        slope: det(columns[0], r, columns[2]) / whole / half,
        bend: 2.0 * det(columns[0], columns[1], r) / whole / (half * half),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_reproduced_even_with_uneven_samples() {
        let s: Vec<f64> = (0..40).map(|i| f64::from(i) * 7.0 + f64::from(i % 3)).collect();
        let f = |s: f64| 4.0e6 + 0.03 * s - 2e-4 * s * s;
        let y: Vec<f64> = s.iter().map(|&s| f(s)).collect();
        for (fit, &s) in local_quadratic(&s, &y, 30.0).iter().zip(&s) {
            assert!((fit.value - f(s)).abs() < 1e-8);
            assert!((fit.slope - (0.03 - 4e-4 * s)).abs() < 1e-9);
            assert!((fit.bend + 4e-4).abs() < 1e-10);
        }
    }

    #[test]
    fn noise_is_reduced_and_sparse_samples_are_kept() {
        let s: Vec<f64> = (0..200).map(|i| f64::from(i) * 5.0).collect();
        let noise = |i: usize| 0.05 * if (i * 7919) % 13 < 6 { 1.0 } else { -1.0 };
        let y: Vec<f64> = s.iter().enumerate().map(|(i, s)| 0.02 * s + noise(i)).collect();
        let fits = local_quadratic(&s, &y, 40.0);
        assert!(fits[20..180].iter().all(|f| (f.slope - 0.02).abs() < 0.004));
        let sparse = local_quadratic(&[0.0, 500.0, 1_000.0], &[0.0, 5.0, 0.0], 40.0);
        assert!((sparse[1].value - 5.0).abs() < 1e-9);
    }
}
