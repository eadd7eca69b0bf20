//! Contracts of Tractrix: what the rooms say to each other.
//!
//! SI units and radians everywhere, the unit in every name. ISO 8855 axes: x forward, y left,
//! z up, yaw counter-clockwise. Road frame: `s` along the route, `d` to the left of the reference
//! line; grade positive uphill, bank positive with the left side up.
//!
//! **One reference point**: the centre of the tractor's drive-axle group, on the ground. Every
//! ego position, velocity and road coordinate refers to it (see [`Geometry`]).
//!
//! Left out on purpose: algorithms, I/O, clocks and random numbers. The crate is `no_std + alloc`,
//! so that the same types run on the on-truck computer.
#![cfg_attr(not(feature = "std"), no_std)]
extern crate alloc;

mod can;
mod command;
mod ego;
mod error;
mod fuel;
mod limits;
mod limits_check;
mod pedal;
mod plan;
mod pose;
mod provenance;
pub mod road_load;
mod scene;
mod seams;
#[cfg(feature = "std")]
mod sheet;
mod status;
mod table;
mod time;
#[cfg(feature = "std")]
pub mod words;

pub use can::{BusRecorder, BusTrouble, RawFrame};
pub use command::{BrakeMode, Command, GearRequest};
pub use ego::{EgoState, PowertrainSignals, TrailerState};
pub use error::CoreError;
pub use fuel::{FuelModel, LowLoadFuel, RPM_PER_RAD_S};
pub use limits::{BrakeLimits, Geometry, LateralLimits, PowertrainLimits, VehicleLimits};
pub use plan::{
    GuardReason, LaneChangeReason, LaneChangeRefusal, LaneChoice, Maneuver, PathPoint, Plan,
    PlanStatus, SpeedPoint,
};
pub use pose::{Fix, Motion, Pose, PoseSource};
pub use provenance::Provenance;
pub use road_load::{RoadLoad, RoadPiece, Wind};
pub use scene::{Neighbour, Scene, VehicleClass};
pub use seams::{Recorder, Stamped, Step, Tick, TrafficSource, Vehicle};
pub use status::{ActiveFault, SafetySignal, VehicleFault, VehicleStatus};
pub use table::{Curve, Grid};
pub use time::Time;

/// Standard gravity, m/s² (ISO 80000-3).
pub const GRAVITY_M_S2: f64 = 9.806_65;
/// 0 °C in K (SI brochure).
pub const ZERO_DEGC_K: f64 = 273.15;
/// Specific gas constant of dry air, J/(kg K).
pub const GAS_CONSTANT_AIR_J_KG_K: f64 = 287.05;
