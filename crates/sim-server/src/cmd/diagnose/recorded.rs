//! Our own recordings as measured drives: `run.mcap` to a folder of drives.
//!
//! A recording holds the true state of the simulated truck; the drive holds what a logger would
//! make of it (see [`diagnosis::logger`]). The curvature is that of the road that was driven, where
//! it is still found. The temperature of the coolant is not in a recording.

use std::path::{Path, PathBuf};

use diagnosis::Channel;
use diagnosis::logger::{Draw, as_logged};
use dynamics::{TruckModel, TruckParameters};
use recording::{Entry, Wanted};
use road::Road;
use sim::Scenario;
use tractrix_core::ZERO_DEGC_K;

use diagnosis::Table;

use super::folder::STEP_S;
use crate::failure::Failure;
use crate::output;
use crate::replayed::check_road;

/// Name of a recording in its folder.
const RECORDING: &str = "run.mcap";
/// Part of a step by which a sample may come early: recordings have whole nanoseconds.
const EARLY_S: f64 = 1e-6;

/// Recordings at `path`: the file, the folder of a run, or a folder of such folders. Empty if
/// there is none.
pub(super) fn recordings(path: &Path) -> Vec<PathBuf> {
    if path.extension().is_some_and(|e| e == "mcap") && path.is_file() {
        return vec![path.to_owned()];
    }
    let alone = path.join(RECORDING);
    if alone.is_file() {
        return vec![alone];
    }
    let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> =
        entries.map(|e| e.path().join(RECORDING)).filter(|p| p.is_file()).collect();
    found.sort();
    found
}

/// Fields of `/truck/state` that are read, in the order of the message.
const STATE_FIELDS: [&str; 17] = [
    "s_m",
    "d_m",
    "grade_rad",
    "speed_m_s",
    "yaw_rate_rad_s",
    "trailer_yaw_rate_rad_s",
    "steering_wheel_rad",
    "engine_speed_rpm",
    "engine_torque_nm",
    "brake_pressure_pa",
    "gear",
    "shift_in_progress",
    "fuel_rate_g_s",
    "accelerator_pedal_frac",
    "xbr_decel_m_s2",
    "brake_mode",
    "command_retarder_frac",
];
/// Fields of `/odom` that are read.
const ODOMETRY_FIELDS: [&str; 4] = [
    "pose.pose.position.z",
    "pose.pose.orientation.z",
    "pose.pose.orientation.w",
    "twist.twist.linear.x",
];
/// Fields of `/imu` that are read: with gravity's part, as an accelerometer has it.
const IMU_FIELDS: [&str; 2] = ["linear_acceleration.x", "linear_acceleration.y"];

/// What is read of a recording, by these numbers.
const TOPICS: [Wanted<'_>; 3] = [
    Wanted { topic: "/truck/state", fields: &STATE_FIELDS },
    Wanted { topic: "/odom", fields: &ODOMETRY_FIELDS },
    Wanted { topic: "/imu", fields: &IMU_FIELDS },
];
const STATE: usize = 0;
const ODOMETRY: usize = 1;
const IMU: usize = 2;

/// Columns of what is sampled. The rest follows from where the truck was.
const SAMPLED: [&str; 21] = [
    "time_s",
    "s_map_m",
    "speed_m_s",
    "gps_speed_m_s",
    "gps_altitude_m",
    "heading_rad",
    "accel_x_m_s2",
    "accelerator_pedal_frac",
    "engine_torque_percent",
    "engine_speed_rpm",
    "gear",
    "shift_in_process",
    "engine_brake_frac",
    "xbr_decel_m_s2",
    "brake_pressure_kpa",
    "steering_wheel_rad",
    "yaw_rate_rad_s",
    "trailer_yaw_rate_rad_s",
    "accel_y_m_s2",
    "fuel_rate_g_s",
    "grade_frac",
];

/// Reads a recording as a drive of `truck`.
///
/// # Errors
/// [`Failure::Input`] if it is no recording of this program, or holds no state.
pub(super) fn table(path: &Path, truck: &TruckParameters, seed: u64) -> Result<Table, Failure> {
    let folder = path.parent().and_then(Path::file_name);
    let name = folder.map_or_else(|| "run".to_owned(), |n| n.to_string_lossy().into_owned());
    let mut reader = Reader {
        odometry: None,
        specific_force_m_s2: None,
        scenario: None,
        road_fingerprint: None,
        table: Table::new(name, &SAMPLED),
        reference_torque_nm: truck.engine.reference_torque_nm,
        last_s: f64::NEG_INFINITY,
        start_z_m: None,
        climbed_m: Vec::new(),
        at_m: Vec::new(),
        draw: Draw::of_seed(seed),
    };
    let mut recording = recording::Reader::open(path, &TOPICS)?;
    while let Some(entry) = recording.next_entry()? {
        reader.take(entry);
    }
    let scenario = reader.scenario.as_deref().ok_or_else(|| {
        Failure::file(path, "no recording of this program (no scenario is attached), or torn")
    })?;
    let scenario =
        Scenario::from_toml_str(&path.display().to_string(), scenario).map_err(Failure::input)?;
    let mut table = reader.table;
    let air = reader.climbed_m.iter().map(|z| scenario.weather.air_at(*z));
    let (kelvin, pascal): (Vec<f64>, Vec<f64>) = air.unzip();
    let ambient = kelvin.into_iter().map(|t| t - ZERO_DEGC_K).collect();
    table.columns.push(("ambient_temp_degc", ambient));
    table.columns.push(("baro_pressure_pa", pascal));
    match road_of(&scenario, reader.road_fingerprint.as_deref()) {
        Ok(road) => {
            let curvature = |&(s_m, d_m): &(f64, f64)| road.at(s_m, d_m).curvature_1_m;
            let curvature = reader.at_m.iter().map(curvature).collect();
            table.columns.push(("curvature_1_m", curvature));
        }
        Err(why) => {
            output::note(&format!("{}: no curvature of its road: {why}", path.display()));
        }
    }
    let empty_kg = TruckModel::new(truck.clone(), 0.0).map_err(Failure::input)?.mass_kg();
    table.reported_mass_kg = Some(empty_kg + scenario.truck.payload_kg);
    Ok(table)
}

/// The road that was driven, or why it is not to be had.
fn road_of(scenario: &Scenario, fingerprint: Option<&str>) -> Result<Road, String> {
    let road = scenario.load_road().map_err(|e| e.to_string())?;
    fingerprint.map_or(Ok(()), |driven| check_road(&road, driven))?;
    Ok(road)
}

struct Reader {
    /// Altitude, m, heading, rad, and speed over ground, m/s.
    odometry: Option<[f64; 3]>,
    /// Along and across, m/s².
    specific_force_m_s2: Option<[f64; 2]>,
    scenario: Option<String>,
    road_fingerprint: Option<String>,
    table: Table,
    reference_torque_nm: f64,
    last_s: f64,
    start_z_m: Option<f64>,
    climbed_m: Vec<f64>,
    /// Station and offset of each sample, m.
    at_m: Vec<(f64, f64)>,
    draw: Draw,
}

impl Reader {
    fn take(&mut self, entry: Entry) {
        match entry {
            Entry::Values { wanted, time, values } => match (wanted, &*values) {
                (ODOMETRY, [z, qz, qw, speed]) => {
                    self.odometry = Some([*z, 2.0 * qz.atan2(*qw), *speed]);
                }
                (IMU, [x, y]) => self.specific_force_m_s2 = Some([*x, *y]),
                (STATE, values) if time.seconds() >= self.last_s + STEP_S - EARLY_S => {
                    self.state(time.seconds(), values);
                }
                _ => {}
            },
            Entry::Attachment { name, data } if name == "scenario.toml" => {
                self.scenario = Some(String::from_utf8_lossy(&data).into_owned());
            }
            Entry::Record { name, mut values } if name == "run" => {
                self.road_fingerprint = values.remove("road_fingerprint");
            }
            Entry::Attachment { .. } | Entry::Record { .. } => {}
        }
    }

    fn state(&mut self, time_s: f64, state: &[f64]) {
        let (Some([z, heading, gps_speed]), Ok(state)) =
            (self.odometry, <[f64; STATE_FIELDS.len()]>::try_from(state))
        else {
            return;
        };
        let [accel_x, accel_y] = self.specific_force_m_s2.unwrap_or([f64::NAN; 2]);
        let [
            s,
            d,
            grade,
            speed,
            yaw,
            trailer_yaw,
            wheel,
            rpm,
            torque,
            pressure,
            gear,
            shift,
            fuel,
            pedal,
            decel,
            mode,
            retarder,
        ] = state;
        self.last_s = time_s;
        self.at_m.push((s, d));
        self.climbed_m.push(z - *self.start_z_m.get_or_insert(z));
        let mut row = [
            time_s,
            s,
            speed,
            gps_speed,
            z,
            heading,
            accel_x,
            pedal,
            100.0 * torque / self.reference_torque_nm,
            rpm,
            gear,
            shift,
            retarder,
            if mode == 0.0 { 0.0 } else { decel },
            pressure * 1e-3,
            wheel,
            yaw,
            trailer_yaw,
            accel_y,
            fuel,
            grade.tan(),
        ];
        for (column, x) in SAMPLED.iter().zip(&mut row) {
            if let Some(channel) = Channel::of(column) {
                *x = as_logged(channel, *x, &mut self.draw);
            }
        }
        self.table.push(&row);
    }
}
