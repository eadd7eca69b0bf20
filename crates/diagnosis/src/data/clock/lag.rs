//! Where the lag is: cross-correlation over the drive, then in windows.

use super::likelihood::Fit;
use super::{Rates, TOGETHER};

/// Length of a window, s.
const WINDOW_S: f64 = 120.0;
/// Distance of windows, s.
const HOP_S: f64 = 30.0;
/// Largest lag over the whole drive, s: two loggers that were started by hand.
const LARGEST_S: f64 = 600.0;
/// Largest departure of a window's lag from the drive's, s.
const AROUND_S: f64 = 45.0;

/// Lag of one window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WindowLag {
    /// Middle of the window, s.
    pub(super) time_s: f64,
    pub(super) lag_s: f64,
    pub(super) sigma_s: f64,
}

/// Normalised correlation of `x[from + stride i]` with `y` `lag` samples earlier.
fn correlation(r: &Rates, range: core::ops::Range<usize>, lag: i64, stride: usize) -> f64 {
    let last = (r.y.len() as i64 + lag).clamp(0, range.end as i64) as usize;
    let before = usize::try_from(lag - range.start as i64).unwrap_or(0).div_ceil(stride) * stride;
    let first = range.start + before;
    let (x, y) = match (r.x.get(first..last), usize::try_from(first as i64 - lag)) {
        (Some(x), Ok(from)) => (x, r.y.get(from..).unwrap_or_default()),
        _ => return 0.0,
    };
    let (mut n, mut sx, mut sy) = (0.0_f64, 0.0, 0.0);
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (x, y) in x.iter().step_by(stride).zip(y.iter().step_by(stride)) {
        n += 1.0;
        sx += x;
        sy += y;
        xy += x * y;
        xx += x * x;
        yy += y * y;
    }
    let (vx, vy) = (xx - sx * sx / n, yy - sy * sy / n);
    if n > 100.0 && vx > 1e-12 && vy > 1e-12 { (xy - sx * sy / n) / (vx * vy).sqrt() } else { 0.0 }
}

fn peak(
    r: &Rates,
    range: core::ops::Range<usize>,
    lags: impl Iterator<Item = i64>,
    stride: usize,
) -> (f64, i64) {
    lags.map(|lag| (correlation(r, range.clone(), lag, stride), lag))
        .fold((f64::NEG_INFINITY, 0), |best, c| if c.0 > best.0 { c } else { best })
}

/// Lag over the whole drive in samples; `None` if the channels do not move together.
pub(super) fn coarse(r: &Rates) -> Option<i64> {
    let n = r.x.len().min(r.y.len());
    let bound = (LARGEST_S / Rates::STEP_S).min(n as f64 / 4.0) as i64;
    let (_, near) = peak(r, 0..n, (-bound..=bound).step_by(3), 3);
    let (best, at) = peak(r, 0..n, near - 4..=near + 4, 1);
    // A clock that jumps or drifts lowers the correlation over the whole drive.
    (best > 0.5 * TOGETHER).then_some(at)
}

/// Lags of the windows in which the channels move together.
pub(super) fn windows(r: &Rates, coarse: i64) -> Vec<WindowLag> {
    let n = r.x.len().min(r.y.len());
    let (length, hop) = ((WINDOW_S / Rates::STEP_S) as usize, (HOP_S / Rates::STEP_S) as usize);
    let around = (AROUND_S / Rates::STEP_S) as i64;
    (0..n.saturating_sub(length) + 1)
        .step_by(hop)
        .filter_map(|from| {
            let range = from..from + length;
            let (_, near) =
                peak(r, range.clone(), (coarse - around..=coarse + around).step_by(2), 2);
            let (best, at) = peak(r, range.clone(), near - 2..=near + 2, 1);
            if best < TOGETHER {
                return None;
            }
            let fit = Fit::window(r, range.clone(), at as f64 * Rates::STEP_S)?;
            Some(WindowLag {
                time_s: (from as f64 + 0.5 * length as f64) * Rates::STEP_S,
                lag_s: fit.lag_s,
                sigma_s: fit.lag_sigma_s,
            })
        })
        .collect()
}

/// Samples of the windows in which the channels move together. At a steady speed there is nothing but
/// noise, and a drift was fitted to it: half a second over drives with one hill.
pub(super) fn together(r: &Rates, windows: &[WindowLag]) -> Vec<bool> {
    let mut out = vec![false; r.x.len().min(r.y.len())];
    let half = 0.5 * WINDOW_S;
    for w in windows {
        let sample = |t: f64| (t.max(0.0) / Rates::STEP_S) as usize;
        let range = sample(w.time_s - half)..sample(w.time_s + half).min(out.len());
        out[range].fill(true);
    }
    out
}
