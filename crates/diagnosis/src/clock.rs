//! Clock offset and drift between two channels that measure the same quantity.
//!
//! The lag is where the correlation of the detrended, differenced signals peaks, refined by a
//! parabola through the peak (Jacovitti & Scarano, IEEE T-SP 41(2), 1993). Drift is the change of
//! the lag between windows of the drive. Left out: clocks that jump within a window.

use crate::drive::Drive;

/// Lag of `x` behind `y` in samples, refined, within `±max_lag`; `None` if the signals do not move
/// together (peak correlation below one half).
#[must_use]
pub fn lag_samples(x: &[f64], y: &[f64], max_lag: usize) -> Option<f64> {
    let n = x.len().min(y.len());
    if n < 4 * max_lag + 8 {
        return None;
    }
    let smooth_step = 10;
    let diff = |z: &[f64]| -> Vec<f64> {
        (0..n - smooth_step).map(|i| z[i + smooth_step] - z[i]).collect()
    };
    let (dx, dy) = (diff(x), diff(y));
    let m = dx.len();
    let correlation = |lag: i64| {
        let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
        let from = (max_lag as i64 - lag) as usize;
        for (x, y) in dx[max_lag..m - max_lag].iter().zip(&dy[from..]) {
            xy += x * y;
            xx += x * x;
            yy += y * y;
        }
        if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
    };
    let bound = max_lag as i64;
    let (mut best, mut at) = (f64::NEG_INFINITY, 0);
    for lag in -bound..=bound {
        let c = correlation(lag);
        if c > best {
            (best, at) = (c, lag);
        }
    }
    if best < 0.5 {
        return None;
    }
    if at.abs() == bound {
        return Some(at as f64);
    }
    let (a, b, c) = (correlation(at - 1), best, correlation(at + 1));
    let curve = a - 2.0 * b + c;
    let shift = if curve < 0.0 { (0.5 * (a - c) / curve).clamp(-0.5, 0.5) } else { 0.0 };
    Some(at as f64 + shift)
}

/// Offset of one channel's clock behind another's along a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockOffset {
    /// Lag over the whole drive, s.
    pub offset_s: f64,
    /// Lag per window, as (time of the window's centre in s, lag in s); windows in which the
    /// signals do not move are left out.
    pub windows: Vec<(f64, f64)>,
}

/// Lag of `x` behind `y`, s, over the drive and in windows of five minutes.
#[must_use]
pub fn offset(x: &[f64], y: &[f64], max_lag_s: f64) -> Option<ClockOffset> {
    let max_lag = (max_lag_s / Drive::STEP_S) as usize;
    let offset_s = lag_samples(x, y, max_lag)? * Drive::STEP_S;
    let window = (300.0 / Drive::STEP_S) as usize;
    let n = x.len().min(y.len());
    let windows = (0..n / window)
        .filter_map(|w| {
            let r = w * window..(w + 1) * window;
            let lag = lag_samples(&x[r.clone()], &y[r], max_lag)?;
            Some(((w as f64 + 0.5) * 300.0, lag * Drive::STEP_S))
        })
        .collect();
    Some(ClockOffset { offset_s, windows })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wandering(n: usize, shift: f64) -> Vec<f64> {
        (0..n)
            .map(|i| {
                let t = (i as f64 - shift) * Drive::STEP_S;
                10.0 + 3.0 * (0.21 * t).sin() + 1.3 * (0.57 * t).cos() + 0.4 * (1.9 * t).sin()
            })
            .collect()
    }

    #[test]
    fn a_shift_of_a_fraction_of_a_sample_is_found() {
        let lag = lag_samples(&wandering(6000, 7.4), &wandering(6000, 0.0), 40).unwrap();
        assert!((lag - 7.4).abs() < 0.1, "{lag}");
    }

    #[test]
    fn a_clock_that_drifts_shows_in_the_windows() {
        let y = wandering(24_000, 0.0);
        let x: Vec<f64> = (0..24_000)
            .map(|i| {
                let t = (i as f64 - 20.0 * i as f64 / 24_000.0) * Drive::STEP_S;
                10.0 + 3.0 * (0.21 * t).sin() + 1.3 * (0.57 * t).cos() + 0.4 * (1.9 * t).sin()
            })
            .collect();
        let o = offset(&x, &y, 2.0).unwrap();
        assert!(o.windows.last().unwrap().1 - o.windows[0].1 > 0.5);
    }

    #[test]
    fn unrelated_signals_have_no_lag() {
        let x: Vec<f64> = (0..5000).map(|i| ((i * 7919 % 1013) as f64).sin()).collect();
        assert_eq!(lag_samples(&x, &wandering(5000, 0.0), 20), None);
    }
}
