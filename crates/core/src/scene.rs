//! The other vehicles around the ego, in road coordinates of the ego's route.

use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::Time;

/// Coarse class of another vehicle; safe gaps depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VehicleClass {
    /// Passenger car.
    #[default]
    Car,
    /// Light commercial vehicle.
    Van,
    /// Heavy truck or bus.
    Truck,
    /// A vehicle with right of way: others keep clear of it.
    Emergency,
    /// Something that stands on the road and is no vehicle: the barrier of a closed lane.
    Barrier,
}

/// Another vehicle. Front and rear are given explicitly, so that a gap is a subtraction.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Neighbour {
    /// Stable identifier within a run.
    pub id: u64,
    /// Class.
    pub class: VehicleClass,
    /// Station of the front bumper, m.
    pub front_s_m: f64,
    /// Station of the rear bumper, m.
    pub rear_s_m: f64,
    /// Lateral position of the vehicle's centre line, m, positive left of the reference line.
    pub d_m: f64,
    /// Width, m.
    pub width_m: f64,
    /// Speed along the road, m/s.
    pub speed_m_s: f64,
    /// Lateral speed, m/s, positive left.
    pub lateral_speed_m_s: f64,
    /// Acceleration along the road, m/s².
    pub accel_m_s2: f64,
    /// Lane track that it is in, or leaves during a change.
    pub lane: u16,
    /// Lane track that it is changing to.
    pub target_lane: Option<u16>,
    /// Map x of the body's centre, m.
    pub x_m: f64,
    /// Map y of the body's centre, m.
    pub y_m: f64,
    /// Heading, rad, map frame.
    pub yaw_rad: f64,
}

impl Neighbour {
    /// Length of the body, m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.front_s_m - self.rear_s_m
    }
}

/// All vehicles that the source knows around the ego, sorted by `front_s_m` ascending.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Scene {
    /// Time at which the scene is valid.
    pub time: Time,
    /// The vehicles.
    pub neighbours: Vec<Neighbour>,
}
