//! Class-8 trucks over 800 m climbs (VT, UC Riverside) as drives with a fuel meter and a CO2 meter.
//!
//! Every `veh*.csv` or `veh*.csv.gz` with `speed_mph, fuel_gps, co2_gps, engine_rpm, elevation_m`
//! at 1 Hz is a vehicle; without `segment` a stretch ends where altitude or speed jump. A stretch that
//! is long enough to be judged is a drive.

use std::fmt::Write as _;
use std::path::Path;

use dynamics::TruckParameters;

use crate::drives::Folder;
use crate::table::{column, files, read, stem};

const MPH: f64 = 0.447_04;
/// Shortest stretch, rows of a second.
const LEAST_ROWS: usize = 95;
/// Changes from row to row that no truck makes: altitude, m, and speed, m/s.
const JUMPS: (f64, f64) = (3.0, 5.4);

/// Writes the drives into `out`.
pub(crate) fn prepare(dir: &Path, out: &Path, truck: &TruckParameters) -> crate::Outcome {
    let mut folder = Folder::new(out, &truck.name)?;
    for file in files(dir, &[".csv", ".csv.gz"])? {
        let table = read(&file)?;
        let take = |name: &str| column(&table, &file, name);
        // Names of this project's copy, or of the published files.
        let either = |ours: &str, theirs: &str| take(ours).or_else(|_| take(theirs));
        let speed: Vec<f64> = either("speed_mph", "vel (mph)")?.iter().map(|v| v * MPH).collect();
        let altitude = either("elevation_m", "elevation (m)")?;
        let rpm = either("engine_rpm", "engine (rpm)")?;
        let fuel = either("fuel_gps", "fuel (g/s)")?;
        let co2 = either("co2_gps", "CO2 (g/s)")?;
        let segment = take("segment").ok();
        let goes_on = |i: usize| match segment {
            Some(s) => s[i] == s[i - 1],
            None => {
                (altitude[i] - altitude[i - 1]).abs() <= JUMPS.0
                    && (speed[i] - speed[i - 1]).abs() <= JUMPS.1
            }
        };
        let (mut from, mut number) = (0, 0);
        for i in 1..=speed.len() {
            if i < speed.len() && goes_on(i) {
                continue;
            }
            if i - from >= LEAST_ROWS {
                let mut csv = "time_s,speed_m_s,gps_altitude_m,engine_speed_rpm,fuel_rate_g_s,\
                               co2_rate_g_s\n"
                    .to_owned();
                for k in from..i {
                    writeln!(
                        csv,
                        "{},{},{},{},{},{}",
                        k - from,
                        speed[k],
                        altitude[k],
                        rpm[k],
                        fuel[k],
                        co2[k]
                    )?;
                }
                number += 1;
                folder.add(&format!("{}_{number:02}", stem(&file)), &csv, "")?;
            }
            from = i;
        }
    }
    folder.write()
}
