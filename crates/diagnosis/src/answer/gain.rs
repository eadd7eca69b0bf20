//! What an extension is worth on drives that it has not seen: rollouts of 60 s before and after.

use crate::causes::param::Theta;
use crate::problem::{Problem, replay};
use crate::replay::force::Longitudinal;
use crate::replay::{Module, Prepared};
use crate::search::decisions::STRONG_NATS;
use crate::search::held_out::gains;
use crate::search::refit::Fit;
use crate::{BeforeAfter, Drive, Gain, Plant};

/// Length of a rollout, s.
pub(crate) const HORIZON_S: f64 = 60.0;

/// Errors of one drive under one model.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct DriveError {
    /// Sum of squared speed errors over all rollout samples, and their number.
    pub(crate) speed: [f64; 2],
    /// Sum of speed errors.
    pub(crate) speed_sum: f64,
    /// Sum of squared speeds, for the accuracy.
    pub(crate) speed_power: f64,
    /// The same for the yaw rate.
    pub(crate) yaw: [f64; 2],
    /// Modelled minus measured fuel and measured fuel, in samples times g/s.
    pub(crate) fuel: [f64; 2],
}

/// Free runs of the speed over [`HORIZON_S`] with measured torque, gear and pressure; shifts carry
/// the measured change of speed.
pub(crate) fn drive_error(d: &Prepared, plant: &Plant, theta: &Theta) -> DriveError {
    drive_error_by(d, plant, theta, &mut |_, _| {})
}

/// The same; `visit` sees every sample of the free runs and the speed there, m/s.
pub(crate) fn drive_error_by(
    d: &Prepared,
    plant: &Plant,
    theta: &Theta,
    visit: &mut dyn FnMut(usize, f64),
) -> DriveError {
    let mut e = DriveError::default();
    if d.available[Module::Force as usize] {
        let t = plant.with_instruments(theta);
        let model = Longitudinal::new(d, plant, &t);
        let steps = (HORIZON_S / Drive::STEP_S) as usize;
        let mut start = 0;
        let scale = 1.0 / (1.0 + t[crate::causes::param::P::SpeedScale as usize]);
        while start + steps < d.n {
            let mut v = d.speed[start];
            for i in start..start + steps {
                let moving = (d.engaged[i] || d.coasts) && d.speed[i] > 3.0;
                let [a] = model.acceleration(i, &[v.max(0.5) * scale]);
                v += if moving { a * Drive::STEP_S / scale } else { d.speed[i + 1] - d.speed[i] };
                v = v.clamp(0.0, 60.0);
                let error = v - d.speed[i + 1];
                e.speed[0] += error * error;
                e.speed[1] += 1.0;
                e.speed_sum += error;
                e.speed_power += d.speed[i + 1] * d.speed[i + 1];
                visit(i + 1, v);
            }
            start += steps;
        }
    }
    let r = replay(d, plant, theta);
    for (x, ok) in r[Module::Yaw as usize].iter().zip(&d.valid[Module::Yaw as usize]) {
        if *ok {
            e.yaw[0] += x * x;
            e.yaw[1] += 1.0;
        }
    }
    for (k, (x, ok)) in
        r[Module::Fuel as usize].iter().zip(&d.valid[Module::Fuel as usize]).enumerate()
    {
        if *ok {
            let measured = d.fuel[4 * k..4 * k + 4].iter().sum::<f64>() * 0.25;
            e.fuel[0] -= x * d.row_unit(Module::Fuel, k);
            e.fuel[1] += measured;
        }
    }
    e
}

/// Root mean square over several drives.
pub(crate) fn rms(parts: impl Iterator<Item = [f64; 2]>) -> f64 {
    let (s, n) = parts.fold((0.0, 0.0), |a, p| (a.0 + p[0], a.1 + p[1]));
    if n > 0.0 { (s / n).sqrt() } else { 0.0 }
}

/// What the causes of a fit gain on drives held out.
pub(crate) fn gain(plant: &Plant, problem: &Problem<'_>, fit: &Fit) -> Gain {
    let reference = &problem.reference;
    let errors = |t| problem.drives.iter().map(|d| drive_error(d, plant, t)).collect::<Vec<_>>();
    let (before, after) = (errors(&reference.theta), errors(&fit.theta));
    let gains = gains(problem, &reference.theta, &fit.theta);
    let both = |f: fn(&DriveError) -> [f64; 2]| BeforeAfter {
        before: rms(before.iter().map(f)),
        after: rms(after.iter().map(f)),
    };
    let fuel = |e: &[DriveError]| {
        let (d, m) = e.iter().fold((0.0, 0.0), |a, e| (a.0 + e.fuel[0], a.1 + e.fuel[1]));
        if m > 0.0 { f64::abs(d) / m } else { 0.0 }
    };
    let total: f64 = gains.iter().sum();
    Gain {
        held_out: problem.drives.iter().map(|d| d.name.clone()).collect(),
        speed_rmse_m_s: both(|e| e.speed),
        yaw_rate_rmse_rad_s: both(|e| e.yaw),
        fuel_error_frac: BeforeAfter { before: fuel(&before), after: fuel(&after) },
        log_score_nats: total,
        significant: total > STRONG_NATS && gains.iter().all(|g| *g > -STRONG_NATS),
    }
}
