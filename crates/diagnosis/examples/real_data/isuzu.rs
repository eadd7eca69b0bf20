//! Box truck with known coast-down results (NREL): two coast-downs and a log as drives.
//!
//! `coastdown*.csv` holds the coast-downs (`direction`, `t_s`, `speed_mph`, both directions on one
//! road), the 5 Hz log the driving. The log's torque is that at the crank: the truck file's friction
//! is added, as messages have it (SAE J1939-71, SPN 513). Its wheel speed has whole km/h, so that the
//! receiver's is taken.

use std::fmt::Write as _;
use std::path::Path;

use dynamics::TruckParameters;

use crate::drives::Folder;
use crate::table::{column, files, number, read};

const MPH: f64 = 0.447_04;
/// A uniform error of half width 1 has this standard deviation.
const UNIFORM: f64 = 0.577;
/// The scales, kg: the mass of the coast-downs.
const SCALES_KG: f64 = 6590.0;

/// Writes the drives into `out`.
pub(crate) fn prepare(dir: &Path, out: &Path, truck: &TruckParameters) -> crate::Outcome {
    let mut folder = Folder::new(out, &truck.name)?;
    for file in files(dir, &["coastdown_digitised.csv", "coastdown.csv"])? {
        // Runs by the direction's name, which is no number.
        let text = std::fs::read_to_string(&file)?;
        let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|l| l.split(',').collect()).collect();
        for run in rows.chunk_by(|a, b| a.first() == b.first()) {
            let name = run.first().and_then(|r| r.first()).copied().unwrap_or_default();
            let quarter = core::f64::consts::FRAC_PI_2;
            let heading = if name.eq_ignore_ascii_case("north") { quarter } else { -quarter };
            let mut csv = "time_s,speed_m_s,gear,heading_rad\n".to_owned();
            for row in run {
                let field = |k: usize| row.get(k).map_or(f64::NAN, |f| number(f));
                writeln!(csv, "{},{},0,{heading}", field(1), field(2) * MPH)?;
            }
            // Read off a plot to +-1 s and +-0.5 mph.
            let known = format!(
                "reported_mass_kg = {SCALES_KG}\ntime_sigma_s = {UNIFORM}\nspeed_sigma_m_s = {:.4}",
                0.5 * MPH * UNIFORM
            );
            folder.add(&format!("coast_{name}"), &csv, &known)?;
        }
    }
    for file in files(dir, &["onroad_5hz.csv"])? {
        let table = read(&file)?;
        let take = |name: &str| column(&table, &file, name);
        let (t, v) = (take("time[s]")?, take("gps_Speed[km/h]")?);
        let (torque, rpm) = (take("EngPercentTorque_ACT[%]")?, take("EngSpeed[RPM]")?);
        let (altitude, pedal) =
            (take("gps_Altitude[m]")?, take("Accelerator_Pedal_Position_D[%]")?);
        let (air, kpa) = (take("Ambient_Air_Temperature[ºC]")?, take("Barometric_Pressure[kPa]")?);
        let released = pedal.iter().copied().fold(f64::INFINITY, f64::min);
        let mut csv = "time_s,speed_m_s,gps_altitude_m,engine_torque_percent,engine_speed_rpm,\
                       accelerator_pedal_frac,ambient_temp_degc,baro_pressure_pa\n"
            .to_owned();
        let e = &truck.engine;
        for i in 0..t.len() {
            let friction_nm = e.friction_constant_nm + e.friction_per_rpm_nm * rpm[i];
            let percent = torque[i] + 100.0 * friction_nm / e.reference_torque_nm;
            let foot = (pedal[i] - released) / (100.0 - released);
            writeln!(
                csv,
                "{},{},{},{percent},{},{foot},{},{}",
                t[i],
                v[i] / 3.6,
                altitude[i],
                rpm[i],
                air[0],
                1000.0 * kpa[i]
            )?;
        }
        folder.add("road", &csv, "")?;
    }
    folder.write()
}
