//! `autoware_vehicle_msgs`: what a vehicle says of itself in Autoware's words.

use serde::{Deserialize, Serialize};

use super::geometry::{Header, Stamp};

/// The first fields of `truck_msgs/msg/TruckState`, to the gear.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct TruckState {
    header: Header,
    /// Place on the road and its grade.
    _road: [f64; 3],
    speed_m_s: f64,
    lateral_speed_m_s: f64,
    _accel_m_s2: [f64; 2],
    yaw_rate_rad_s: f64,
    _trailer: [f64; 2],
    /// Positive left.
    road_wheel_rad: f64,
    /// Steering wheel, load transfer, engine, and forces at the wheels with the brake pressure.
    _others: [f64; 10],
    gear: u8,
}

/// `VelocityReport`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct VelocityReport {
    header: Header,
    /// m/s, ahead.
    longitudinal_velocity: f32,
    /// m/s, to the left.
    lateral_velocity: f32,
    /// rad/s, counter-clockwise.
    heading_rate: f32,
}

/// `SteeringReport`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct SteeringReport {
    stamp: Stamp,
    /// rad, positive left.
    steering_tire_angle: f32,
}

/// `GearReport`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct GearReport {
    stamp: Stamp,
    report: u8,
}

/// `ControlModeReport`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct ControlModeReport {
    stamp: Stamp,
    mode: u8,
}

/// Of `GearReport`.
const NEUTRAL: u8 = 1;
const DRIVE: u8 = 2;
/// Of `ControlModeReport`.
const AUTONOMOUS: u8 = 1;

impl TruckState {
    pub(crate) fn velocity(&self) -> VelocityReport {
        VelocityReport {
            header: Header { stamp: self.header.stamp, frame_id: "base_link".to_owned() },
            longitudinal_velocity: self.speed_m_s as f32,
            lateral_velocity: self.lateral_speed_m_s as f32,
            heading_rate: self.yaw_rate_rad_s as f32,
        }
    }

    pub(crate) fn steering(&self) -> SteeringReport {
        let steering_tire_angle = self.road_wheel_rad as f32;
        SteeringReport { stamp: self.header.stamp, steering_tire_angle }
    }

    /// The truck's gears are the gearbox's own affair: they are all "drive".
    pub(crate) fn gear(&self) -> GearReport {
        let report = if self.gear == 0 { NEUTRAL } else { DRIVE };
        GearReport { stamp: self.header.stamp, report }
    }

    /// The stack drives, always.
    pub(crate) fn control_mode(&self) -> ControlModeReport {
        ControlModeReport { stamp: self.header.stamp, mode: AUTONOMOUS }
    }
}
