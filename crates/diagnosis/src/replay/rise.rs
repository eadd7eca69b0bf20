//! Torque on its way to a demand: two first-order lags, and the band of torque over which a turbocharger
//! makes the one the other (`dynamics::effects::engine`), sample by sample and exactly for a constant
//! demand.
//!
//! With the lag `tau(T) = tau_0 + b (T - T_0)` the torque follows `T' = (D - T) / tau(T)`. With
//! `y = ln((D - T_0) / (D - T))` time is
//! `t(y) = (tau_0 + b g) y - b g (1 - exp(-y))`, `g = D - T_0`.

use crate::Drive;

/// Newton steps for a sample within the band: `t(y)` bends to one side, so that each comes nearer.
const STEPS: usize = 5;

/// Lags of the torque.
pub(super) struct Rise {
    /// On its way down and below the band, and above the band, s.
    lag_s: [f64; 2],
    /// Of full load.
    band_frac: [f64; 2],
    /// What the lags leave of a gap in a whole sample.
    keep: [f64; 2],
}

impl Rise {
    /// Lags below and above a band of torque, the latter in parts of full load.
    pub(super) fn new(lag_s: [f64; 2], band_frac: [f64; 2]) -> Self {
        Self { lag_s, band_frac, keep: lag_s.map(|lag| (-Drive::STEP_S / lag).exp()) }
    }

    /// Torque a sample later.
    pub(super) fn sample(&self, torque: f64, demand: f64, full: f64) -> f64 {
        let after = |keep: f64| demand + (torque - demand) * keep;
        if demand <= torque {
            return after(self.keep[0]);
        }
        let band = self.band_frac.map(|frac| frac * full);
        if torque >= band[1] {
            return after(self.keep[1]);
        }
        let below = after(self.keep[0]);
        if torque < band[0] && below <= band[0] { below } else { self.across(torque, demand, band) }
    }

    /// Torque after a sample that begins below the upper end of the band.
    fn across(&self, mut torque: f64, demand: f64, band: [f64; 2]) -> f64 {
        let [fast_s, slow_s] = self.lag_s;
        let mut left_s = Drive::STEP_S;
        if torque < band[0] {
            left_s -= fast_s * ((demand - torque) / (demand - band[0])).ln();
            torque = band[0];
        }
        if torque < band[1] {
            let per_nm = (slow_s - fast_s) / (band[1] - band[0]);
            let lag_s = fast_s + per_nm * (torque - band[0]);
            let gap = demand - torque;
            let time_s = |y: f64| (lag_s + per_nm * gap) * y + per_nm * gap * (-y).exp_m1();
            if demand > band[1] {
                let whole_s = time_s((gap / (demand - band[1])).ln());
                if whole_s < left_s {
                    return demand - (demand - band[1]) * (-(left_s - whole_s) / slow_s).exp();
                }
            }
            let mut y = left_s / lag_s;
            for _ in 0..STEPS {
                let slope_s = (lag_s + per_nm * gap * -(-y).exp_m1()).max(1e-3);
                y = (y - (time_s(y) - left_s) / slope_s).max(0.0);
            }
            return demand - gap * (-y).exp();
        }
        demand - (demand - torque) * (-left_s / slow_s).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_that_of_many_small_steps() {
        let (fast_s, full, steps) = (0.15, 2_600.0, 100_000);
        for (from, demand) in
            [(800.0, 2_600.0), (905.0, 1_500.0), (300.0, 1_000.0), (1_000.0, 1_050.0)]
        {
            for (slow_s, band_nm) in [
                (0.9, [910.0, 910.0]),
                (0.9, [860.0, 960.0]),
                (0.9, [500.0, 1_500.0]),
                (0.04, [860.0, 960.0]),
                (0.04, [-300.0, 1_500.0]),
            ] {
                let rise = Rise::new([fast_s, slow_s], band_nm.map(|nm| nm / full));
                let mut torque: f64 = from;
                for _ in 0..steps {
                    let [low, high] = band_nm;
                    let part = if torque < low {
                        0.0
                    } else if torque >= high {
                        1.0
                    } else {
                        (torque - low) / (high - low)
                    };
                    let lag_s = fast_s + part * (slow_s - fast_s);
                    torque += (demand - torque) * Drive::STEP_S / f64::from(steps) / lag_s;
                }
                let at_once = rise.sample(from, demand, full);
                assert!(
                    (at_once - torque).abs() < 0.05,
                    "{from} to {demand}, {slow_s} s, {band_nm:?}: {at_once} {torque}"
                );
            }
        }
        let down = Rise::new([fast_s, 0.9], [0.3, 0.4]).sample(2_000.0, 500.0, full);
        assert!((down - (500.0 + 1_500.0 * (-Drive::STEP_S / fast_s).exp())).abs() < 1e-9);
    }
}
