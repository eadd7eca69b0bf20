//! Instruments against each other: GPS against wheel speed, altitude against the map, heading
//! against the yaw gyro, the longitudinal accelerometer against speed and grade.

use super::Module as M;
use super::force::weak_form;
use super::prepared::{Prepared, at_index, running_sum};
use crate::Drive;
use crate::causes::param::{P, Theta};

/// GPS speed minus true speed by the wheels, m/s, mean over half a second.
pub(super) fn gps(d: &Prepared, t: &Theta) -> Vec<f64> {
    let lag = t[P::GpsLag as usize] / Drive::STEP_S;
    let scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    rows(d, M::Gps, |a, b| {
        (a..b).map(|i| d.gps[i] - scale * at_index(&d.speed, i as f64 - lag)).sum::<f64>()
            / (b - a) as f64
    })
}

/// Altitude minus the integral of the map's grade, m, mean over a second.
pub(super) fn altitude(d: &Prepared, t: &Theta) -> Vec<f64> {
    let scale = Drive::STEP_S / (1.0 + t[P::SpeedScale as usize]);
    let map = d.grade_shifted(t[P::MapShift as usize]);
    let climb = running_sum((0..d.n).map(|i| {
        let grade = map[i] + t[P::GradeBias as usize];
        grade / (1.0 + grade * grade).sqrt() * d.speed[i] * scale
    }));
    let start = d.altitude.iter().take(20).sum::<f64>() / d.altitude.len().min(20) as f64;
    rows(d, M::Altitude, |a, b| {
        (a..b).map(|i| d.altitude[i] - climb[i] - start).sum::<f64>() / (b - a) as f64
            - t[P::AltitudeOffset as usize]
    })
}

/// Heading minus the integral of the yaw rate, rad, mean over a second.
pub(super) fn heading(d: &Prepared, t: &Theta) -> Vec<f64> {
    let bias = t[P::YawBias as usize];
    let turned = running_sum(d.yaw.iter().map(|w| (w - bias) * Drive::STEP_S));
    let start = d.heading[0];
    rows(d, M::Heading, |a, b| {
        (a..b).map(|i| d.heading[i] - turned[i] - start).sum::<f64>() / (b - a) as f64
            - t[P::HeadingOffset as usize]
    })
}

/// Integral of the accelerometer minus gravity's part minus the change of speed, m/s per second.
pub(super) fn imu(d: &Prepared, t: &Theta) -> Vec<f64> {
    let map = d.grade_shifted(t[P::MapShift as usize]);
    let sum = running_sum((0..d.n).map(|i| {
        let grade = map[i] + t[P::GradeBias as usize];
        (d.accel_x[i] - t[P::ImuBias as usize] - Prepared::gravity_along(grade)) * Drive::STEP_S
    }));
    let scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    let mut r = weak_form(&d.valid[M::Imu as usize], &d.speed, scale, &sum, 0.0);
    r.iter_mut().for_each(|x| *x = -*x);
    r
}

fn rows(d: &Prepared, m: M, f: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let step = m.row_step();
    d.valid[m as usize]
        .iter()
        .enumerate()
        .map(|(k, ok)| if *ok { f(k * step, (k + 1) * step) } else { 0.0 })
        .collect()
}
