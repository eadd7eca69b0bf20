//! Gear ratios and wheel radius from engine and road speed.
//!
//! With the driveline closed `omega / v = i_g i_0 / r`. Only the products show: one gear is the
//! anchor, the direct one or else the one that is driven most, whose ratio the truck file must know,
//! as it must the final drive's. Ratios are compared inside a drive, where the tyres are the same; the
//! radius counts at the speed of the satellites if there is one, else at that of the wheels' message.

use std::collections::BTreeMap;

use dynamics::{KnownBy, TruckParameters};
use tractrix_core::RPM_PER_RAD_S;

use super::{Identified, NotTold};
use crate::{Channel as C, DiagnosisError, Drive, DriveSet};

/// Rows after a shift and before one that do not count, and rows of a block.
const MARGIN: usize = 12;
const BLOCK: usize = 20;
/// Speed from which the wheels' message is fine enough, m/s, and that above which satellites are
/// compared with the wheels.
const LEAST_M_S: f64 = 2.5;
const FAST_M_S: f64 = 10.0;
/// Blocks of a gear in a drive at least.
const LEAST_BLOCKS: usize = 5;
/// A block this far from the gear's median is not a closed driveline.
const CLOSED_FRAC: f64 = 0.03;
/// What messages of speed and engine speed resolve in a mean over a drive, relative.
const RESOLUTION_FRAC: f64 = 5e-5;
/// A gear box whose gears differ so much from the truck file's is another one.
const ANOTHER_FRAC: f64 = 0.12;
/// Student's t that holds 90 %, by degrees of freedom from one on (Abramowitz and Stegun, 26.10).
const T_90: [f64; 10] = [6.31, 2.92, 2.35, 2.13, 2.02, 1.94, 1.89, 1.86, 1.83, 1.81];

/// What engine and road speed tell.
pub(super) struct Ratios {
    pub(super) truck: TruckParameters,
    pub(super) figures: Vec<Identified>,
    pub(super) not_told: Vec<NotTold>,
}

/// Log of engine speed over road speed, 1/m, by gear, of one drive.
type Logs = BTreeMap<usize, f64>;

pub(super) fn identify(
    truck: &TruckParameters,
    drives: &DriveSet,
) -> Result<Ratios, DiagnosisError> {
    let mut out = Ratios { truck: truck.clone(), figures: Vec::new(), not_told: Vec::new() };
    let of_drives: Vec<(Logs, Option<f64>)> =
        drives.drives.iter().map(|d| (logs(d, truck), wheels_over_satellites(d))).collect();
    let d = &truck.driveline;
    let driven = |gear: usize| of_drives.iter().filter(|x| x.0.contains_key(&gear)).count();
    let direct = d.gear_ratios.iter().position(|r| *r == 1.0).map(|i| i + 1);
    let most = (1..=d.gear_ratios.len()).max_by_key(|g| (driven(*g), *g));
    let Some(anchor) = direct.filter(|g| driven(*g) > 0).or(most).filter(|g| driven(*g) > 0) else {
        let why = "no closed driveline in gear: engine speed, road speed or gear is missing";
        out.refuse("driveline.wheel_radius_m", why);
        out.refuse("driveline.gear_ratios", why);
        return Ok(out);
    };
    for gear in (1..=d.gear_ratios.len()).filter(|g| *g != anchor) {
        let path = format!("driveline.gear_ratios[{}]", gear - 1);
        let beside = |x: &(Logs, Option<f64>)| Some(x.0.get(&gear)? - x.0.get(&anchor)?);
        let logs: Vec<f64> = of_drives.iter().filter_map(beside).collect();
        let nominal = d.gear_ratios[gear - 1];
        match mean(&logs) {
            Some((log, sigma, half)) => {
                let value = d.gear_ratios[anchor - 1] * log.exp();
                out.take(path, nominal, value, sigma, half)?;
            }
            None => out.refuse(&path, &few(logs.len(), "this gear and the anchor")),
        }
    }
    let has_satellites = of_drives.iter().any(|x| x.1.is_some());
    let logs: Vec<f64> = of_drives
        .iter()
        .filter(|x| x.1.is_some() || !has_satellites)
        .filter_map(|x| Some(x.0.get(&anchor)? + x.1.unwrap_or(0.0)))
        .collect();
    let path = "driveline.wheel_radius_m".to_owned();
    match mean(&logs) {
        Some((log, sigma, half)) => {
            let value = d.gear_ratios[anchor - 1] * d.final_drive_ratio / log.exp();
            out.take(path, d.wheel_radius_m, value, sigma, half)?;
        }
        None => out.refuse(&path, &few(logs.len(), "the anchor gear")),
    }
    Ok(out)
}

fn few(drives: usize, what: &str) -> String {
    format!("{drives} drives hold {what} for five seconds, 2 are needed")
}

impl Ratios {
    fn refuse(&mut self, path: &str, why: &str) {
        self.not_told.push(NotTold { path: path.to_owned(), why: why.to_owned() });
    }

    /// A figure of the driveline, with relative spread and half width.
    fn take(
        &mut self,
        path: String,
        nominal: f64,
        value: f64,
        sigma_frac: f64,
        half_frac: f64,
    ) -> Result<(), DiagnosisError> {
        // a sheet's ratio is exact: the drives check it
        let sheet = self.truck.provenance.get("driveline.gear_ratios");
        let is_ratio = path.starts_with("driveline.gear_ratios");
        let exact = is_ratio && sheet.is_some_and(|o| o.known_by == KnownBy::Sheet);
        if (value / nominal - 1.0).abs() > ANOTHER_FRAC {
            return Err(DiagnosisError::Truck(format!(
                "{path} = {nominal} in the truck file, the drives say {value:.4}: another gearbox, \
                 axle or tyre"
            )));
        }
        if exact && (value / nominal - 1.0).abs() <= half_frac {
            return Ok(());
        }
        let bad = |e: dynamics::DynamicsError| DiagnosisError::Truck(e.to_string());
        self.truck = self.truck.with_parameter(&path, value).map_err(bad)?;
        let half = value * half_frac;
        self.figures.push(Identified {
            path,
            is_factor: false,
            nominal,
            value,
            sigma: value * sigma_frac,
            interval_90: [value - half, value + half],
            prior_sigma: None,
        });
        Ok(())
    }
}

/// Mean, standard deviation of the mean, half width that holds 90 %; of two values at least.
fn mean(x: &[f64]) -> Option<(f64, f64, f64)> {
    let n = x.len();
    let t = T_90[n.checked_sub(2)?.min(T_90.len() - 1)];
    let mean = x.iter().sum::<f64>() / n as f64;
    let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
    let sigma = (variance / n as f64).sqrt().hypot(RESOLUTION_FRAC);
    Some((mean, sigma, t * sigma))
}

/// Log of what the wheels' message says over what satellites say.
fn wheels_over_satellites(d: &Drive) -> Option<f64> {
    let (wheels, satellites) = (d.get(C::SpeedMS)?, d.get(C::GpsSpeedMS)?);
    let fast = wheels.iter().zip(satellites).filter(|(a, b)| **a > FAST_M_S && **b > FAST_M_S);
    let (sum, other, n) = fast.fold((0.0, 0.0, 0usize), |s, (a, b)| (s.0 + a, s.1 + b, s.2 + 1));
    (n >= 100 * BLOCK).then(|| (sum / other).ln())
}

fn logs(d: &Drive, truck: &TruckParameters) -> Logs {
    let gear = d.get(C::Gear).filter(|_| !d.gear_derived);
    let (Some(speed), Some(rpm), Some(gear)) = (d.get(C::SpeedMS), d.get(C::EngineSpeedRpm), gear)
    else {
        return Logs::new();
    };
    let shifting = |i: usize| d.get(C::ShiftInProcess).is_some_and(|s| s[i] > 0.5);
    let idle = truck.engine.idle_speed_rpm;
    let mut found: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    let mut at = MARGIN;
    while at + BLOCK + MARGIN < d.len {
        let around = at - MARGIN..at + BLOCK + MARGIN;
        let steady = around.clone().all(|i| gear[i] == gear[at] && !shifting(i));
        let turns = (at..at + BLOCK).all(|i| rpm[i] > 1.15 * idle && speed[i] > LEAST_M_S);
        if steady && turns && gear[at] >= 1.0 {
            let sum = |x: &[f64]| x[at..at + BLOCK].iter().sum::<f64>();
            let log = (sum(rpm) / RPM_PER_RAD_S / sum(speed)).ln();
            found.entry(gear[at] as usize).or_default().push(log);
        }
        at += BLOCK;
    }
    let settle = |(gear, mut x): (usize, Vec<f64>)| {
        x.sort_by(f64::total_cmp);
        let middle = *x.get(x.len() / 2)?;
        x.retain(|v| (v - middle).abs() < CLOSED_FRAC);
        (x.len() >= LEAST_BLOCKS).then(|| (gear, x.iter().sum::<f64>() / x.len() as f64))
    };
    found.into_iter().filter_map(settle).collect()
}
