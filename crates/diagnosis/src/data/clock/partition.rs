//! From lags of windows to stretches of linear lag between jumps.

use core::ops::Range;

use super::Rates;
use super::lag::WindowLag;
use super::likelihood::squared_residuals;

/// Squared normalised residual at which a window counts as an outlier and costs no more.
const OUTLIER: f64 = 16.0;
/// Fewest windows of a stretch.
const FEWEST: usize = 3;
/// A jump smaller than this is not told from the windows' own errors, s.
const SMALLEST_SIGMA_S: f64 = 0.05;

/// Windows that overlap at any time.
const OVERLAP: usize = 4;

/// Consecutive windows on one line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    windows: Range<f64>,
    /// Lag at time zero, s, and drift, s/s.
    line: (f64, f64),
    /// Scatter of the mean of the windows about the line, s.
    scatter_s: f64,
}

/// A stretch in samples, with a first guess of its line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bounds {
    pub(super) samples: Range<usize>,
    /// Lag in the middle, s, and drift, s/s.
    pub(super) line: (f64, f64),
    pub(super) scatter_s: f64,
}

impl Bounds {
    /// This stretch and the next one as one; the longer one's line continues.
    pub(super) fn joined(&self, next: &Self) -> Self {
        let longer = if next.samples.len() > self.samples.len() { next } else { self };
        let samples = self.samples.start..next.samples.end;
        let middle = |r: &Range<usize>| 0.5 * (r.start + r.end) as f64 * Rates::STEP_S;
        let moved = middle(&samples) - middle(&longer.samples);
        let line = (longer.line.0 + longer.line.1 * moved, longer.line.1);
        Self { samples, line, scatter_s: longer.scatter_s }
    }
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Weighted line with outliers weighted down, and its bounded cost.
fn line(windows: &[WindowLag], floor_s: f64) -> ((f64, f64), f64) {
    let mut lags: Vec<f64> = windows.iter().map(|w| w.lag_s).collect();
    let mut fit = (median(&mut lags), 0.0);
    let sigma = |w: &WindowLag| w.sigma_s.hypot(floor_s);
    for _ in 0..6 {
        let (mut s, mut st, mut stt, mut sl, mut stl) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for w in windows {
            let z = (w.lag_s - fit.0 - fit.1 * w.time_s) / sigma(w);
            let weight = (OUTLIER / (OUTLIER + z * z)).powi(2) / sigma(w).powi(2);
            s += weight;
            st += weight * w.time_s;
            stt += weight * w.time_s * w.time_s;
            sl += weight * w.lag_s;
            stl += weight * w.time_s * w.lag_s;
        }
        let determinant = s * stt - st * st;
        if determinant > 1e-9 * s * stt {
            fit = ((stt * sl - st * stl) / determinant, (s * stl - st * sl) / determinant);
        } else {
            fit = (sl / s, 0.0);
        }
    }
    let cost = windows
        .iter()
        .map(|w| ((w.lag_s - fit.0 - fit.1 * w.time_s) / sigma(w)).powi(2).min(OUTLIER))
        .sum();
    (fit, cost)
}

/// Optimal partition of the windows into lines; `None` with too few windows.
pub(super) fn pieces(windows: &[WindowLag]) -> Option<Vec<Piece>> {
    let n = windows.len();
    if n < FEWEST {
        return None;
    }
    // The windows' own scatter, from neighbours that share no data.
    let mut steps: Vec<f64> = windows
        .iter()
        .zip(&windows[OVERLAP.min(n - 1)..])
        .map(|(a, b)| (b.lag_s - a.lag_s).abs())
        .collect();
    let floor_s = (1.4826 / 2.0_f64.sqrt() * median(&mut steps)).max(SMALLEST_SIGMA_S);
    // A new stretch costs its three parameters (Bayesian information criterion, in chi squared of
    // overlapping windows) and must explain more than one outlying window.
    let penalty = OVERLAP as f64 * (3.0 * (n as f64).ln() + OUTLIER);
    let mut best = vec![0.0; n + 1];
    let mut from = vec![0; n + 1];
    for end in 1..=n {
        best[end] = f64::INFINITY;
        for start in 0..=end.saturating_sub(FEWEST) {
            if end < FEWEST || (start > 0 && start < FEWEST) {
                continue;
            }
            let cost = best[start] + penalty + line(&windows[start..end], floor_s).1;
            if cost < best[end] {
                (best[end], from[end]) = (cost, start);
            }
        }
    }
    let mut pieces = Vec::new();
    let mut end = n;
    while end > 0 {
        let start = from[end];
        let part = &windows[start..end];
        let (fit, _) = line(part, floor_s);
        let mut off: Vec<f64> =
            part.iter().map(|w| (w.lag_s - fit.0 - fit.1 * w.time_s).abs()).collect();
        let independent = (part.len() as f64 / OVERLAP as f64).max(1.0);
        pieces.push(Piece {
            windows: part[0].time_s..part[part.len() - 1].time_s,
            line: fit,
            scatter_s: 1.4826 * median(&mut off) / independent.sqrt(),
        });
        end = start;
    }
    pieces.reverse();
    Some(pieces)
}

/// Places every jump where the squared residuals of the two lines change over.
pub(super) fn boundaries(rates: &Rates, pieces: &[Piece]) -> Vec<Bounds> {
    let n = rates.x.len().min(rates.y.len());
    let sample = |t: f64| ((t / Rates::STEP_S).max(0.0) as usize).min(n);
    let mut cuts = vec![0];
    for pair in pieces.windows(2) {
        let [a, b] = pair else { continue };
        let range = sample(a.windows.end - 60.0)..sample(b.windows.start + 60.0);
        let residuals =
            |line: (f64, f64)| squared_residuals(rates, range.clone(), |t| line.0 + line.1 * t);
        let (mut sum, mut least, mut cut) = (0.0, f64::INFINITY, range.start);
        for (i, (ea, eb)) in residuals(a.line).iter().zip(residuals(b.line)).enumerate() {
            sum += ea - eb;
            if sum < least {
                (least, cut) = (sum, range.start + i + 1);
            }
        }
        cuts.push(cut);
    }
    cuts.push(n);
    pieces
        .iter()
        .zip(cuts.windows(2))
        .map(|(p, c)| {
            let samples = c[0]..c[1].max(c[0]);
            let middle = 0.5 * (c[0] + c[1]) as f64 * Rates::STEP_S;
            Bounds {
                samples,
                line: (p.line.0 + p.line.1 * middle, p.line.1),
                scatter_s: p.scatter_s,
            }
        })
        .collect()
}
