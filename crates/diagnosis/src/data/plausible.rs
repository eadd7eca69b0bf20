//! Do the drives belong to this truck? Engine speed over wheel speed in every gear says so.

use crate::{Channel as C, DiagnosisError, Drive, DriveSet, Plant};

/// Deviation of the overall ratio that no tyre wear or slip explains.
const MAX_DEVIATION: f64 = 0.08;

/// Shortest drive that can be judged, s: a rollout, and the rest of the filters' memory.
pub(crate) const MIN_DURATION_S: f64 = 90.0;

/// Change of speed between samples, m/s, that no truck makes (40 m/s²), and the part of the samples
/// with one above which the rows are not in the order of time.
const MAX_JUMP_M_S: f64 = 2.0;
const MAX_JUMPS_FRAC: f64 = 0.05;

/// Refuses drives that are too short, whose rows are in no order, or that hold values which are no
/// numbers.
pub(crate) fn check_length(set: &DriveSet) -> Result<(), DiagnosisError> {
    for d in &set.drives {
        if d.duration_s() < MIN_DURATION_S {
            return Err(DiagnosisError::NoDrives {
                what: format!(
                    "{} has {} samples ({:.1} s); {MIN_DURATION_S} s are needed",
                    d.name,
                    d.len,
                    d.duration_s()
                ),
            });
        }
        let speed = d.get(C::SpeedMS).unwrap_or_default();
        let jumps = speed.windows(2).filter(|w| (w[1] - w[0]).abs() > MAX_JUMP_M_S).count();
        if jumps as f64 > MAX_JUMPS_FRAC * d.len as f64 {
            return Err(DiagnosisError::NoDrives {
                what: format!(
                    "{}: speed_m_s jumps by more than {MAX_JUMP_M_S} m/s {jumps} times: rows are not in the order of time",
                    d.name
                ),
            });
        }
        for c in C::all() {
            let bad = d.get(c).and_then(|x| x.iter().position(|x| !x.is_finite()));
            if let Some(at) = bad {
                return Err(DiagnosisError::NoDrives {
                    what: format!("{}: {} is not a number at sample {at}", d.name, c.name()),
                });
            }
        }
    }
    Ok(())
}

/// Fuel that no engine burns above 0.4 of its full load, g/kWh: with every cause of the catalogue at
/// its bound (the fuel's or the torque's scale, consumption at low load, which is gone there) it stays
/// between; per hour, in kilograms or litres, it does not.
const FUEL_G_PER_KWH: [f64; 2] = [90.0, 500.0];
/// Part of the full load from which an engine's consumption hangs little on the load.
const HIGH_LOAD_FRAC: f64 = 0.4;
/// Work there that a drive needs to be judged by its fuel, kWh.
const LEAST_WORK_KWH: f64 = 1.0;

/// Refuses drives of another truck, drive by drive: two trucks may lie in one folder.
pub(crate) fn check_truck(plant: &Plant, set: &DriveSet) -> Result<(), DiagnosisError> {
    for d in &set.drives {
        check_ratios(plant, d)?;
        check_fuel(plant, d)?;
    }
    Ok(())
}

/// Engine speed over wheel speed, gear by gear.
fn check_ratios(plant: &Plant, d: &Drive) -> Result<(), DiagnosisError> {
    let driveline = &plant.truck.driveline;
    let gears = driveline.gear_ratios.len();
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); gears + 1];
    let mut beyond = 0_usize;
    let (Some(v), Some(n), Some(g)) = (d.get(C::SpeedMS), d.get(C::EngineSpeedRpm), d.get(C::Gear))
    else {
        return Ok(());
    };
    let shifting = d.get(C::ShiftInProcess);
    for i in (0..d.len).step_by(7) {
        if v[i] < 4.0 || shifting.is_some_and(|s| s[i] > 0.5) || g[i] < 1.0 {
            continue;
        }
        match ratios.get_mut(g[i] as usize) {
            Some(r) => r.push(n[i] / tractrix_core::RPM_PER_RAD_S / v[i]),
            None => beyond += 1,
        }
    }
    let total: usize = ratios.iter().map(Vec::len).sum();
    let (mut wrong, mut worst) = (beyond, (0, 0.0, 0.0, 0_usize));
    for (gear, r) in ratios.iter_mut().enumerate().skip(1) {
        if r.len() < 20 {
            continue;
        }
        r.sort_by(f64::total_cmp);
        let measured = r[r.len() / 2];
        let expected = driveline.engine_speed_rad_s(1.0, gear as u8);
        if (measured / expected - 1.0).abs() > MAX_DEVIATION {
            wrong += r.len();
            if r.len() > worst.3 {
                worst = (gear, measured, expected, r.len());
            }
        }
    }
    if total + beyond > 200 && 2 * wrong > total + beyond {
        let (gear, measured, expected, _) = worst;
        let is = |factor: f64| (expected / measured / factor - 1.0).abs() < MAX_DEVIATION;
        let hint = if is(3.6) {
            "; speed_m_s seems to be in km/h"
        } else if is(2.236_936) {
            "; speed_m_s seems to be in mph"
        } else {
            ""
        };
        let drive = d.name.clone();
        return Err(DiagnosisError::WrongTruck { drive, gear, measured, expected, hint });
    }
    Ok(())
}

/// Fuel over the work at the crank, at high load.
fn check_fuel(plant: &Plant, d: &Drive) -> Result<(), DiagnosisError> {
    let (Some(fuel), Some(torque), Some(n)) =
        (d.get(C::FuelRateGS), d.get(C::EngineTorquePercent), d.get(C::EngineSpeedRpm))
    else {
        return Ok(());
    };
    let reference_nm = plant.truck.engine.reference_torque_nm;
    let rows = fuel.iter().zip(torque).zip(n);
    let (mut fuel_g, mut work_j) = (0.0, 0.0);
    for ((fuel, torque), n) in rows {
        let (nm, rad_s) = (0.01 * torque * reference_nm, n / tractrix_core::RPM_PER_RAD_S);
        if nm > HIGH_LOAD_FRAC * plant.engine.full_load_nm.at(rad_s) {
            fuel_g += fuel * Drive::STEP_S;
            work_j += nm * rad_s * Drive::STEP_S;
        }
    }
    let work_kwh = work_j / 3.6e6;
    let g_per_kwh = fuel_g / work_kwh;
    let [least, most] = FUEL_G_PER_KWH;
    if work_kwh < LEAST_WORK_KWH || (least..=most).contains(&g_per_kwh) {
        return Ok(());
    }
    let hint =
        if (500.0..1200.0).contains(&g_per_kwh) { "; it seems to be in l/h or kg/h" } else { "" };
    Err(DiagnosisError::FuelUnit { drive: d.name.clone(), g_per_kwh, hint })
}
