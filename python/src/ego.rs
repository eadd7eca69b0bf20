//! The ego's state as a dictionary; the fields and their documentation are those of
//! `tractrix.Ego`.

use pyo3::IntoPyObject;
use tractrix_core::{EgoState, RPM_PER_RAD_S, Time};

/// The fields of `tractrix.Ego`.
#[derive(IntoPyObject)]
pub(crate) struct Ego {
    time_s: f64,
    s_m: f64,
    d_m: f64,
    speed_m_s: f64,
    lateral_speed_m_s: f64,
    accel_x_m_s2: f64,
    accel_y_m_s2: f64,
    yaw_rate_rad_s: f64,
    x_m: f64,
    y_m: f64,
    z_m: f64,
    yaw_rad: f64,
    articulation_rad: f64,
    trailer_yaw_rate_rad_s: f64,
    steering_wheel_rad: f64,
    road_wheel_rad: f64,
    load_transfer_ratio: f64,
    gear: u8,
    shift_in_progress: bool,
    engine_speed_rpm: f64,
    engine_torque_nm: f64,
    engine_power_w: f64,
    drive_force_n: f64,
    brake_force_n: f64,
    brake_pressure_pa: f64,
    retarder_force_n: f64,
    fuel_rate_g_s: f64,
    fuel_used_g: f64,
}

impl Ego {
    /// The state `ego`, true at `time`.
    pub(crate) fn new(time: Time, ego: &EgoState) -> Self {
        let p = &ego.powertrain;
        Self {
            time_s: time.seconds(),
            s_m: ego.s_m,
            d_m: ego.d_m,
            speed_m_s: ego.speed_m_s,
            lateral_speed_m_s: ego.lateral_speed_m_s,
            accel_x_m_s2: ego.accel_x_m_s2,
            accel_y_m_s2: ego.accel_y_m_s2,
            yaw_rate_rad_s: ego.yaw_rate_rad_s,
            x_m: ego.x_m,
            y_m: ego.y_m,
            z_m: ego.z_m,
            yaw_rad: ego.yaw_rad,
            articulation_rad: ego.trailer.articulation_rad,
            trailer_yaw_rate_rad_s: ego.trailer.yaw_rate_rad_s,
            steering_wheel_rad: ego.steering_wheel_rad,
            road_wheel_rad: ego.road_wheel_rad,
            load_transfer_ratio: ego.load_transfer_ratio,
            gear: p.gear,
            shift_in_progress: p.shift_in_progress,
            engine_speed_rpm: p.engine_speed_rad_s * RPM_PER_RAD_S,
            engine_torque_nm: p.engine_torque_nm,
            engine_power_w: p.engine_power_w,
            drive_force_n: p.drive_force_n,
            brake_force_n: p.brake_force_n,
            brake_pressure_pa: p.brake_pressure_pa,
            retarder_force_n: p.retarder_force_n,
            fuel_rate_g_s: p.fuel_rate_g_s,
            fuel_used_g: p.fuel_used_g,
        }
    }
}
