//! State, inputs and outputs of the lateral model.

use serde::{Deserialize, Serialize};

use super::{AXLES, SteeringState};

/// What the lateral model remembers. Position and heading are those of the reference point.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LateralState {
    /// Map x, m.
    pub x_m: f64,
    /// Map y, m.
    pub y_m: f64,
    /// Tractor heading, rad, not wrapped.
    pub yaw_rad: f64,
    /// Trailer heading minus tractor heading, rad.
    pub articulation_rad: f64,
    /// v_yc: lateral speed of the tractor's CG in the 4-state model, m/s. Below the blend
    /// `LateralModel::outputs` has the true one.
    pub cg_lateral_speed_m_s: f64,
    /// omega_c of the 4-state model, rad/s.
    pub yaw_rate_rad_s: f64,
    /// omega_t of the 4-state model, rad/s.
    pub trailer_yaw_rate_rad_s: f64,
    /// Slip angle per axle that the tyres' forces follow, rad; 0 for tyres without a relaxation length.
    #[serde(default)]
    pub tyre_slip_rad: [f64; AXLES],
    /// Steering gear.
    pub steering: SteeringState,
}

/// A side force at and a yaw moment about a body's CG.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BodyForce {
    /// Force along the body's y axis, N.
    pub side_n: f64,
    /// Yaw moment, Nm.
    pub yaw_moment_nm: f64,
}

/// What acts on the truck during one step.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LateralInputs {
    /// Longitudinal speed, m/s; negative backwards.
    pub speed_m_s: f64,
    /// Its time derivative, m/s².
    pub accel_x_m_s2: f64,
    /// Demanded hand-wheel angle, rad, positive left.
    pub steering_wheel_rad: f64,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
    /// Bank, rad, positive with the left side up.
    pub bank_rad: f64,
    /// Wind and other external loads on the tractor.
    pub tractor: BodyForce,
    /// Wind and other external loads on the trailer.
    pub trailer: BodyForce,
    /// Longitudinal tyre force per axle along its body, N, positive drives.
    pub axle_longitudinal_force_n: [f64; AXLES],
}

/// What the model tells others.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LateralOutputs {
    /// Lateral speed of the reference point, m/s, body y.
    pub lateral_speed_m_s: f64,
    /// Lateral acceleration of the reference point, m/s², body y (no gravity).
    pub accel_y_m_s2: f64,
    /// Lateral acceleration of the tractor's CG, m/s².
    pub tractor_accel_y_m_s2: f64,
    /// Lateral acceleration of the trailer's CG in tractor axes, m/s².
    pub trailer_accel_y_m_s2: f64,
    /// Tractor yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Trailer yaw rate, rad/s.
    pub trailer_yaw_rate_rad_s: f64,
    /// Tractor yaw acceleration, rad/s².
    pub yaw_accel_rad_s2: f64,
    /// Trailer heading minus tractor heading, rad.
    pub articulation_rad: f64,
    /// Road-wheel angle, rad.
    pub road_wheel_rad: f64,
    /// Slip angle per axle, rad, positive when it gives a force to the left; the wheels', which the
    /// tyres follow over their relaxation length.
    pub slip_rad: [f64; AXLES],
    /// Side force per axle, N, to the left.
    pub side_force_n: [f64; AXLES],
    /// Lateral force of the trailer on the tractor at the hitch, N, along the tractor's y axis.
    pub hitch_force_n: f64,
    /// Load-transfer ratio; 1 = all load on the right wheels.
    pub load_transfer_ratio: f64,
}

impl LateralState {
    /// Straight and without lateral motion at a pose of the reference point: m, m, rad.
    #[must_use]
    pub fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        Self { x_m, y_m, yaw_rad, ..Self::default() }
    }
}
