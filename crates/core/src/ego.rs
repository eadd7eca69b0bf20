//! The state of the ego truck as a truck reports it.

use crate::CoreError;
use serde::{Deserialize, Serialize};

/// What the truck reports about itself. Position and velocities are those of the reference point
/// (centre of the drive-axle group, on the ground) in the map frame (x, y, z) and in the tractor's
/// body frame (longitudinal, lateral).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct EgoState {
    /// Map x, m.
    pub x_m: f64,
    /// Map y, m.
    pub y_m: f64,
    /// Map z, m.
    pub z_m: f64,
    /// Tractor heading, rad, counter-clockwise from map x, not wrapped.
    pub yaw_rad: f64,
    /// Position along the route, m.
    pub s_m: f64,
    /// Offset from the route's reference line, m, positive left.
    pub d_m: f64,
    /// Longitudinal speed of the reference point, m/s, body x.
    pub speed_m_s: f64,
    /// Lateral speed of the reference point, m/s, body y.
    pub lateral_speed_m_s: f64,
    /// Longitudinal acceleration, m/s², time derivative of `speed_m_s` (no gravity).
    pub accel_x_m_s2: f64,
    /// Lateral acceleration, m/s², body y (no gravity).
    pub accel_y_m_s2: f64,
    /// Tractor yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// The trailer.
    pub trailer: TrailerState,
    /// Road-wheel steering angle, rad, positive left.
    pub road_wheel_rad: f64,
    /// Hand-wheel angle, rad, positive left.
    pub steering_wheel_rad: f64,
    /// Lateral load-transfer ratio, -1 to 1; 1 = all load on the right wheels.
    pub load_transfer_ratio: f64,
    /// Engine, gearbox and brake signals.
    pub powertrain: PowertrainSignals,
}

/// The trailer as seen from the tractor.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TrailerState {
    /// Articulation angle, rad: trailer heading minus tractor heading (the paper's psi of Eq. 1).
    pub articulation_rad: f64,
    /// Trailer yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
}

/// Engine, gearbox, brake and fuel signals (the longitudinal part of the paper's 16 outputs).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PowertrainSignals {
    /// Engine speed, rad/s.
    pub engine_speed_rad_s: f64,
    /// Indicated engine torque, Nm, before friction (SPN 513 times the reference torque).
    pub engine_torque_nm: f64,
    /// Engine friction torque at this speed, Nm, positive (SPN 514).
    pub engine_friction_torque_nm: f64,
    /// Wheel traction force of the driveline, N (negative under engine braking).
    pub drive_force_n: f64,
    /// Service brake force, N, positive slows.
    pub brake_force_n: f64,
    /// Service brake pressure, Pa, mean over the axles.
    pub brake_pressure_pa: f64,
    /// Engine-brake and retarder force at the wheels, N, positive slows.
    pub retarder_force_n: f64,
    /// Engaged forward gear, 1-based; 0 = neutral.
    pub gear: u8,
    /// A shift is in progress.
    pub shift_in_progress: bool,
    /// Fuel mass flow, g/s.
    pub fuel_rate_g_s: f64,
    /// Fuel used since the start of the run, g.
    pub fuel_used_g: f64,
    /// Mechanical power at the engine's crank, W.
    pub engine_power_w: f64,
}

impl EgoState {
    /// Checks that every number is finite.
    ///
    /// # Errors
    /// [`CoreError::NonFinite`] names the first offending field.
    pub fn check_finite(&self) -> Result<(), CoreError> {
        if self.is_finite() { Ok(()) } else { crate::error::finite(self.numbers()) }
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.numbers().iter().all(|(_, value)| value.is_finite())
    }

    /// Every number of the state, with its name.
    #[must_use]
    pub fn numbers(&self) -> [(&'static str, f64); 26] {
        let p = &self.powertrain;
        [
            ("x_m", self.x_m),
            ("y_m", self.y_m),
            ("z_m", self.z_m),
            ("yaw_rad", self.yaw_rad),
            ("s_m", self.s_m),
            ("d_m", self.d_m),
            ("speed_m_s", self.speed_m_s),
            ("lateral_speed_m_s", self.lateral_speed_m_s),
            ("accel_x_m_s2", self.accel_x_m_s2),
            ("accel_y_m_s2", self.accel_y_m_s2),
            ("yaw_rate_rad_s", self.yaw_rate_rad_s),
            ("trailer.articulation_rad", self.trailer.articulation_rad),
            ("trailer.yaw_rate_rad_s", self.trailer.yaw_rate_rad_s),
            ("road_wheel_rad", self.road_wheel_rad),
            ("steering_wheel_rad", self.steering_wheel_rad),
            ("load_transfer_ratio", self.load_transfer_ratio),
            ("powertrain.engine_speed_rad_s", p.engine_speed_rad_s),
            ("powertrain.engine_torque_nm", p.engine_torque_nm),
            ("powertrain.engine_friction_torque_nm", p.engine_friction_torque_nm),
            ("powertrain.drive_force_n", p.drive_force_n),
            ("powertrain.brake_force_n", p.brake_force_n),
            ("powertrain.brake_pressure_pa", p.brake_pressure_pa),
            ("powertrain.retarder_force_n", p.retarder_force_n),
            ("powertrain.fuel_rate_g_s", p.fuel_rate_g_s),
            ("powertrain.fuel_used_g", p.fuel_used_g),
            ("powertrain.engine_power_w", p.engine_power_w),
        ]
    }
}
