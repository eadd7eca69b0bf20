//! Maximum likelihood of lag and drift under autoregressive noise.

use core::ops::Range;

use nalgebra::{Matrix4, Vector4};

use super::Rates;
use crate::problem::stats::whiten::Whitener;

/// Order of the noise model: one second, the span of the differences.
const ORDER: usize = 4;
const ITERATIONS: usize = 12;
/// Samples of a block of scores: ten seconds.
const BLOCK: usize = 40;

/// Lag and drift of one range of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Lag in the middle, s.
    pub(super) lag_s: f64,
    pub(super) lag_sigma_s: f64,
    pub(super) drift_s_s: f64,
    pub(super) drift_sigma_s_s: f64,
    pub(super) correlation: f64,
}

/// Value of a signal on the fine grid (Catmull-Rom); `None` near the ends.
fn interpolate(y: &[f64], time_s: f64) -> Option<f64> {
    let at = time_s / Rates::FINE_S;
    if !(at >= 1.0) {
        return None;
    }
    let k = at as usize;
    let [a, b, c, d] = *y.get(k - 1..k + 3)? else { return None };
    let u = at - k as f64;
    let (p, q, r) = (0.5 * (c - a), a - 2.5 * b + 2.0 * c - 0.5 * d, 0.5 * (d - a) + 1.5 * (b - c));
    Some(b + u * (p + u * (q + u * r)))
}

/// Value, slope and bend of a signal: differences over `h` and `2 h` on both sides, so that the
/// mean of slope squared and of minus value times bend are the same for noise.
fn expand(y: &[f64], time_s: f64) -> Option<(f64, f64, f64)> {
    let h = 3.0 * Rates::FINE_S;
    let at = |k: f64| interpolate(y, time_s + k * h);
    let value = at(0.0)?;
    Some((
        value,
        (at(1.0)? - at(-1.0)?) / (2.0 * h),
        (at(2.0)? - 2.0 * value + at(-2.0)?) / (4.0 * h * h),
    ))
}

/// Correlation of x and y over a range, y read `lag(t)` earlier.
pub(super) fn correlation(r: &Rates, range: Range<usize>, lag: impl Fn(f64) -> f64) -> f64 {
    let pairs: Vec<(f64, f64)> = range
        .filter_map(|i| {
            let t = i as f64 * Rates::STEP_S;
            Some((*r.x.get(i)?, interpolate(&r.fine_y, t - lag(t))?))
        })
        .collect();
    let n = pairs.len().max(1) as f64;
    let (mx, my) = pairs.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0 / n, s.1 + p.1 / n));
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in &pairs {
        xy += (x - mx) * (y - my);
        xx += (x - mx) * (x - mx);
        yy += (y - my) * (y - my);
    }
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

/// Squared difference of x and y for every sample of a range under a lag.
pub(super) fn squared_residuals(
    r: &Rates,
    range: Range<usize>,
    lag: impl Fn(f64) -> f64,
) -> Vec<f64> {
    range
        .map(|i| {
            let t = i as f64 * Rates::STEP_S;
            let y = interpolate(&r.fine_y, t - lag(t));
            r.x.get(i).zip(y).map_or(0.0, |(x, y)| (x - y) * (x - y))
        })
        .collect()
}

/// Covariance that holds although y is noisy too: the bend of the residual takes the noise of y's
/// slope out of the information (its mean is minus the noise's part), and the scores are summed
/// over blocks, which may be correlated inside (White, Econometrica 50(1), 1982).
fn sandwich(
    mut hessian: Matrix4<f64>,
    bend: [f64; 3],
    white: &[Vec<f64>; 4],
    e: &[f64],
    drifts: bool,
) -> Option<Matrix4<f64>> {
    hessian[(0, 0)] -= bend[0];
    if drifts {
        hessian[(0, 1)] -= bend[1];
        hessian[(1, 0)] -= bend[1];
        hessian[(1, 1)] -= bend[2];
    }
    // Far from the peak the bend may exceed the information.
    let inverse = hessian.cholesky()?.inverse();
    let mut scores = Matrix4::zeros();
    for from in (0..e.len()).step_by(BLOCK) {
        let block = from..(from + BLOCK).min(e.len());
        let score = Vector4::from_fn(|k, _| block.clone().map(|i| white[k][i] * e[i]).sum::<f64>());
        scores += score * score.transpose();
    }
    Some(inverse * scores * inverse)
}

impl Fit {
    /// Lag of a window, without drift.
    pub(super) fn window(r: &Rates, range: Range<usize>, start_s: f64) -> Option<Self> {
        Self::new(r, range, (start_s, 0.0), None)
    }

    /// Lag and drift of a stretch, from a line (lag in its middle s, drift s/s) and the samples that
    /// `together` picks.
    pub(super) fn stretch(
        r: &Rates,
        range: Range<usize>,
        line: (f64, f64),
        together: &[bool],
    ) -> Option<Self> {
        Self::new(r, range, line, Some(together))
    }

    /// Gauss-Newton over (lag, drift, gain, offset), whitened at every step.
    fn new(
        r: &Rates,
        range: Range<usize>,
        start: (f64, f64),
        drifting: Option<&[bool]>,
    ) -> Option<Self> {
        let drifts = drifting.is_some();
        let picked = |i: usize| drifting.is_none_or(|t| t.get(i).copied().unwrap_or(false));
        let middle = 0.5 * (range.start + range.end) as f64 * Rates::STEP_S;
        let half = 0.5 * range.len() as f64 * Rates::STEP_S;
        // Drift is scaled by the half length so that all columns have like size.
        let mut p = Vector4::new(start.0, start.1 * half, 1.0, 0.0);
        let mut last = None;
        for iteration in 0..ITERATIONS {
            let mut ok = Vec::with_capacity(range.len());
            let mut columns: [Vec<f64>; 4] = Default::default();
            let mut bends: [Vec<f64>; 3] = Default::default();
            let mut residual = Vec::with_capacity(range.len());
            for i in range.clone() {
                let t = i as f64 * Rates::STEP_S;
                let u = (t - middle) / half;
                let found = expand(&r.fine_y, t - p[0] - p[1] * u);
                let (y, slope, bend) = found.unwrap_or((0.0, 0.0, 0.0));
                ok.push(found.is_some() && picked(i));
                residual.push(r.x.get(i).copied().unwrap_or(0.0) - p[2] * y - p[3]);
                for (c, v) in columns.iter_mut().zip([
                    -p[2] * slope,
                    if drifts { -p[2] * slope * u } else { 0.0 },
                    y,
                    1.0,
                ]) {
                    c.push(v);
                }
                for (c, power) in bends.iter_mut().zip([1.0, u, u * u]) {
                    c.push(p[2] * bend * power);
                }
            }
            let noise = Whitener::fit([(residual.as_slice(), ok.as_slice())].into_iter(), ORDER)?;
            let e = noise.apply(&residual, &ok);
            let white: [Vec<f64>; 4] = core::array::from_fn(|k| noise.apply(&columns[k], &ok));
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let mut information = Matrix4::from_fn(|i, j| dot(&white[i], &white[j]));
            if !drifts {
                information[(1, 1)] = 1.0;
            }
            let gradient = Vector4::from_fn(|i, _| dot(&white[i], &e));
            let step = information.cholesky()?.solve(&gradient);
            last = Some((noise, ok, bends, information, white, e));
            // The likelihood is a parabola only within the correlation length of the rates.
            let limit = (0.5 / step[0].abs().max(step[1].abs())).min(1.0);
            p += step * limit;
            if iteration > 2 && step[0].abs() < 1e-4 && step[1].abs() < 1e-4 {
                break;
            }
        }
        let (noise, ok, bends, information, white, e) = last?;
        let bend: [f64; 3] = core::array::from_fn(|k| {
            noise.apply(&bends[k], &ok).iter().zip(&e).map(|(a, b)| a * b).sum::<f64>()
        });
        let covariance = sandwich(information, bend, &white, &e, drifts)
            .or_else(|| sandwich(information, [0.0; 3], &white, &e, drifts))?;
        let (lag_s, drift_s_s) = (p[0], if drifts { p[1] / half } else { 0.0 });
        let fit = Self {
            lag_s,
            lag_sigma_s: covariance[(0, 0)].sqrt(),
            drift_s_s,
            drift_sigma_s_s: if drifts { covariance[(1, 1)].sqrt() / half } else { 0.0 },
            correlation: correlation(r, range, |t| lag_s + drift_s_s * (t - middle)),
        };
        (fit.lag_s.is_finite() && fit.lag_sigma_s.is_finite()).then_some(fit)
    }
}
