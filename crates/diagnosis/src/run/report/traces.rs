//! Overlays of one drive: measured, before and after, over the two minutes where the extension
//! helps most, and the free-run speed over the whole drive.

use serde::Serialize;

use super::rows::Rows;
use crate::Drive;
use crate::replay::Module;

/// A quantity over time, measured and modelled. NaN where a model says nothing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trace {
    /// Column name, with its unit.
    pub quantity: &'static str,
    /// What is compared.
    pub title: String,
    /// Time of the drive, s.
    pub time_s: Vec<f64>,
    /// Measured.
    pub measured: Vec<f64>,
    /// Modelled with the truck file.
    pub before: Vec<f64>,
    /// Modelled with the extended truck.
    pub after: Vec<f64>,
    /// Root mean square errors over the whole drive, before and after.
    pub rms: [f64; 2],
}

/// Length of a close look, s.
const FOCUS_S: f64 = 120.0;
/// Modules whose residual is the measured signal minus a modelled one.
const SHOWN: [Module; 8] = [
    Module::Torque,
    Module::Brake,
    Module::Fuel,
    Module::Yaw,
    Module::TrailerYaw,
    Module::Gps,
    Module::Altitude,
    Module::Co2,
];
/// Most quantities shown beside the speed.
const MOST: usize = 3;

pub(super) fn traces(r: &Rows) -> Vec<Trace> {
    let mut out: Vec<Trace> = speed(r).into_iter().collect();
    let mut others: Vec<(f64, Trace)> = SHOWN.iter().filter_map(|m| focus(r, *m)).collect();
    others.sort_by(|a, b| b.0.total_cmp(&a.0));
    out.extend(others.into_iter().take(MOST).map(|t| t.1));
    out
}

/// Free runs of 60 s over the whole drive, one point a second; a break at every new start.
fn speed(r: &Rows) -> Option<Trace> {
    if !r.drive.available[Module::Force as usize] {
        return None;
    }
    let run = (crate::answer::gain::HORIZON_S / Drive::STEP_S) as usize;
    let picked: Vec<usize> = (1..r.drive.n).step_by((1.0 / Drive::STEP_S) as usize).collect();
    let gap = |x: &[f64]| -> Vec<f64> {
        picked.iter().map(|i| if *i % run < 20 { f64::NAN } else { x[*i] }).collect()
    };
    let rms = |x: &[f64]| {
        let (s, n) = x
            .iter()
            .zip(&r.drive.speed)
            .filter(|p| p.0.is_finite())
            .fold((0.0, 0.0), |a, (x, m)| (a.0 + (x - m) * (x - m), a.1 + 1.0));
        (s / f64::max(n, 1.0)).sqrt()
    };
    Some(Trace {
        quantity: "speed_m_s",
        title: "Speed in free runs of 60 s".to_owned(),
        time_s: picked.iter().map(|i| *i as f64 * Drive::STEP_S).collect(),
        measured: picked.iter().map(|i| r.drive.speed[*i]).collect(),
        before: gap(&r.speed_before),
        after: gap(&r.speed_after),
        rms: [rms(&r.speed_before), rms(&r.speed_after)],
    })
}

/// The window of a module with the largest fall of squared residuals, and that fall in nats.
fn focus(r: &Rows, m: Module) -> Option<(f64, Trace)> {
    let step_s = m.row_step() as f64 * Drive::STEP_S;
    let window = (FOCUS_S / step_s) as usize;
    let sigma = r.sigma[m as usize].max(1e-12);
    let rows: Vec<(usize, f64, f64)> = r.of(m).collect();
    if rows.len() < 20 {
        return None;
    }
    let last = rows.last().map_or(0, |x| x.0);
    let mut fall = vec![0.0; last + 2];
    for (k, b, a) in &rows {
        fall[k + 1] = (b * b - a * a) / (sigma * sigma);
    }
    for k in 1..fall.len() {
        fall[k] += fall[k - 1];
    }
    let count = fall.len();
    let gain = |k: usize| fall[(k + window).min(count - 1)] - fall[k];
    let start = (0..count.saturating_sub(window).max(1))
        .step_by(10)
        .max_by(|a, b| gain(*a).total_cmp(&gain(*b)))?;
    let mut trace = Trace {
        quantity: m.quantity(),
        title: title(m).to_owned(),
        time_s: Vec::new(),
        measured: Vec::new(),
        before: Vec::new(),
        after: Vec::new(),
        rms: [0.0; 2],
    };
    for k in start..(start + window).min(count) {
        let Some(measured) = r.measured(m, k) else { break };
        let ok = r.drive.valid[m as usize].get(k) == Some(&true);
        let modelled =
            |x: &[f64]| x.get(k).filter(|_| ok).map_or(f64::NAN, |residual| measured - residual);
        trace.time_s.push(k as f64 * step_s);
        trace.measured.push(measured);
        trace.before.push(modelled(&r.before[m as usize]));
        trace.after.push(modelled(&r.after[m as usize]));
    }
    let n = rows.len() as f64;
    let rms = |pick: fn(&(usize, f64, f64)) -> f64| {
        (rows.iter().map(|x| pick(x) * pick(x)).sum::<f64>() / n).sqrt()
    };
    trace.rms = [rms(|x| x.1), rms(|x| x.2)];
    Some((*fall.last()?, trace))
}

/// What a module compares, in words.
pub(super) fn title(m: Module) -> &'static str {
    match m {
        Module::Force => "Force balance over 1 s",
        Module::Torque => "Engine torque from the pedal",
        Module::Brake => "Brake pressure from the demand",
        Module::Shift => "Duration of shifts",
        Module::Fuel => "Fuel rate from torque and engine speed",
        Module::Yaw => "Yaw rate of the tractor from the hand wheel",
        Module::TrailerYaw => "Yaw rate of the trailer from the hand wheel",
        Module::AccelY => "Lateral acceleration from the hand wheel",
        Module::Gps => "GPS speed from the wheels",
        Module::Altitude => "GPS altitude from the map",
        Module::Heading => "Heading from the yaw rate",
        Module::Imu => "Accelerometer from speed and grade",
        Module::Co2 => "CO2 in the exhaust from the fuel rate",
    }
}
