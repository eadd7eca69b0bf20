//! The grade where no map says it: from altitude over distance.
//!
//! A smoother (Rauch, Tung, Striebel, AIAA J. 3 (1965) 1445) of altitude and grade, `dh = g ds`, with
//! the grade a random walk along the road. Left out: the barometer, whose message has steps of
//! 0.5 kPa (42 m), and the accelerometer, whose message has steps of 1 % of grade.

use nalgebra::{Matrix2, Vector2};

/// Growth of the grade's variance along a road, 1/m: half a per cent in a hundred metres.
const GRADE_WALK_1_M: f64 = 0.005 * 0.005 / 100.0;
/// Standard deviation of an altitude by satellite, m, for samples a second apart: 3 m that last for
/// some seconds.
const ALTITUDE_SD_M: f64 = 8.0;
/// Standard deviation of a grade that nothing is known of.
const GRADE_SD_FRAC: f64 = 0.03;

/// Grade (rise over run) and its standard deviation at every row; rows are `step_m` of way apart and
/// have an altitude, m, or `NaN`.
pub(crate) fn from_altitude(step_m: &[f64], altitude_m: &[f64]) -> Vec<(f64, f64)> {
    let known = altitude_m.iter().copied().find(|a| a.is_finite()).unwrap_or(0.0);
    let mut x = Vector2::new(known, 0.0);
    let mut p = Matrix2::new(1e4, 0.0, 0.0, GRADE_SD_FRAC * GRADE_SD_FRAC);
    let mut forward = Vec::with_capacity(altitude_m.len());
    for (&ds_m, &z_m) in step_m.iter().zip(altitude_m) {
        let f = Matrix2::new(1.0, ds_m, 0.0, 1.0);
        let (x_before, mut p_before) = (f * x, f * p * f.transpose());
        p_before[(1, 1)] += GRADE_WALK_1_M * ds_m.abs();
        (x, p) = (x_before, p_before);
        if z_m.is_finite() {
            let gain = p.column(0) / (p[(0, 0)] + ALTITUDE_SD_M * ALTITUDE_SD_M);
            x += gain * (z_m - x[0]);
            p -= gain * p.row(0).clone_owned();
        }
        forward.push((f, x_before, p_before, x, p));
    }
    let mut later: Option<(Vector2<f64>, Matrix2<f64>)> = None;
    let mut out = vec![(0.0, GRADE_SD_FRAC); altitude_m.len()];
    let mut next = None;
    for (row, out) in forward.into_iter().zip(&mut out).rev() {
        let (f, x_before, p_before, mut x, mut p) = row;
        if let (Some((later_x, later_p)), Some((next_f, next_x, next_p))) = (later, next) {
            let next_p: Matrix2<f64> = next_p;
            let next_f: Matrix2<f64> = next_f;
            if let Some(inverse) = next_p.try_inverse() {
                let back = p * next_f.transpose() * inverse;
                x += back * (later_x - next_x);
                p += back * (later_p - next_p) * back.transpose();
            }
        }
        *out = (x[1], p[(1, 1)].max(0.0).sqrt());
        (later, next) = (Some((x, p)), Some((f, x_before, p_before)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::logger::Draw;

    #[test]
    fn a_hill_is_found_within_its_own_uncertainty() {
        let mut draw = Draw::of_seed(5);
        let (n, ds_m) = (900, 20.0);
        let truth: Vec<f64> = (0..n)
            .map(|k| 0.03 * libm::sin(2.0 * core::f64::consts::PI * k as f64 / 300.0))
            .collect();
        let mut z = 100.0;
        let altitude: Vec<f64> = truth
            .iter()
            .map(|g| {
                z += g * ds_m;
                z + draw.normal(ALTITUDE_SD_M)
            })
            .collect();
        let found = from_altitude(&vec![ds_m; n], &altitude);
        let inner = 60..n - 60;
        let z2: f64 = inner.clone().map(|k| ((found[k].0 - truth[k]) / found[k].1).powi(2)).sum();
        let mean = (z2 / inner.len() as f64).sqrt();
        let sd = found[n / 2].1;
        assert!((0.3..1.3).contains(&mean) && sd < 0.006, "{mean} deviations, sd {sd}");
    }

    #[test]
    fn without_altitude_the_road_is_level_and_nothing_is_known() {
        let found = from_altitude(&[20.0; 50], &[f64::NAN; 50]);
        assert!(found.iter().all(|g| g.0 == 0.0 && g.1 > 0.02));
    }
}
