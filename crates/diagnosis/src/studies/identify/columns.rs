//! Columns that a log lacks and others say: the gear from engine and road speed, the grade from
//! altitude.

use dynamics::TruckParameters;
use tractrix_core::RPM_PER_RAD_S;

use crate::data::from_log::grade::from_altitude;
use crate::{Action, Channel as C, Drive, Finding, FindingKind};

/// Speed from which a driveline may be closed, m/s, and engine speed over idling.
const DRIVES_M_S: f64 = 2.5;
const OVER_IDLE: f64 = 1.15;
/// Engine over road speed is that of a gear within this part.
const FITS_FRAC: f64 = 0.03;
/// Samples from one altitude to the next: it is taken once a second.
const ALTITUDE_STEP: usize = 20;

/// The drive with what could be worked out, and what was said about it; none where nothing lacks.
pub(super) fn completed(truck: &TruckParameters, drive: &Drive) -> (Option<Drive>, Vec<Finding>) {
    let (mut out, mut findings) = (None, Vec::new());
    let mut note = |channel: C, kind, action| {
        findings.push(Finding {
            drive: drive.name.clone(),
            channel: Some(channel.name().to_owned()),
            time_s: None,
            kind,
            action,
        });
    };
    if !drive.has(C::Gear)
        && let Some((gears, fits_frac)) = gears(truck, drive)
    {
        note(C::Gear, FindingKind::RatioMeasured { fits_frac }, Action::Corrected);
        let with = out.get_or_insert_with(|| drive.clone());
        with.set(C::Gear, gears);
        with.gear_derived = true;
    }
    if !drive.has(C::GradeFrac)
        && drive.coast_down.is_none()
        && let Some((grade, sigma_frac)) = grade(drive)
    {
        note(C::GradeFrac, FindingKind::GradeFromAltitude { sigma_frac }, Action::Corrected);
        out.get_or_insert_with(|| drive.clone()).set(C::GradeFrac, grade);
    }
    (out, findings)
}

/// The gear that is nearest to engine over road speed at every sample, held where the engine idles or
/// the truck stands, and the part of the driving in which it fits.
fn gears(truck: &TruckParameters, drive: &Drive) -> Option<(Vec<f64>, f64)> {
    let (speed, rpm) = (drive.get(C::SpeedMS)?, drive.get(C::EngineSpeedRpm)?);
    let driveline = &truck.driveline;
    let count = driveline.top_gear();
    let (mut held, mut driven, mut fits) = (1.0, 0_usize, 0_usize);
    let mut out = Vec::with_capacity(drive.len);
    for (v, n) in speed.iter().zip(rpm) {
        if *v > DRIVES_M_S && *n > OVER_IDLE * truck.engine.idle_speed_rpm {
            let turning = n / RPM_PER_RAD_S;
            let off = |g: &u8| (turning / driveline.engine_speed_rad_s(*v, *g)).ln().abs();
            let nearest = (1..=count).min_by(|a, b| off(a).total_cmp(&off(b)))?;
            driven += 1;
            fits += usize::from(off(&nearest) < FITS_FRAC);
            held = f64::from(nearest);
        }
        out.push(held);
    }
    (driven > 0).then(|| (out, fits as f64 / driven as f64))
}

/// The grade at every sample and its standard deviation on the average.
fn grade(drive: &Drive) -> Option<(Vec<f64>, f64)> {
    let (speed, altitude) = (drive.get(C::SpeedMS)?, drive.get(C::GpsAltitudeM)?);
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let way: Vec<f64> = speed
        .chunks(ALTITUDE_STEP)
        .map(|v| mean(v).max(0.0) * v.len() as f64 * Drive::STEP_S)
        .collect();
    let altitude: Vec<f64> = altitude.chunks(ALTITUDE_STEP).map(mean).collect();
    let found = from_altitude(&way, &altitude);
    let at = |i: usize| found.get(i / ALTITUDE_STEP).map_or(0.0, |g| g.0);
    let sigmas: Vec<f64> = found.iter().map(|g| g.1).collect();
    Some(((0..drive.len).map(at).collect(), mean(&sigmas)))
}
