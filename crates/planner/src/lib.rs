//! Deciders, predictive cruise control, lane-change paths, safety gate, controllers, guard.
//!
//! Without default features the crate is `no_std + alloc` and needs no solver. It plans with what a
//! truck tells about itself ([`tractrix_core::VehicleLimits`]) and never sees the plant's model.
#![cfg_attr(not(feature = "std"), no_std)]
extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod config;
pub mod decider;
mod drive;
mod error;
pub mod estimator;
pub mod following;
pub mod gate;
pub mod guard;
pub mod lane_change;
pub mod lateral;
pub mod lateral_model;
pub mod leads;
mod limits_check;
pub mod longitudinal;
pub mod maneuver;
pub mod observation;
pub mod path;
pub mod pcc;
pub mod reference_speed;
pub mod road_load;
pub mod rss;
mod speed_profile;
mod stack;
pub mod surroundings;
#[cfg(test)]
#[path = "../tests/support/data_sheet.rs"]
mod testing;

pub use config::{RatesConfig, SpeedPlannerKind, StackConfig};
pub use decider::{DeciderKind, LaneChoice};
pub use drive::{DriveError, TickOutcome, drive_tick};
pub use error::PlannerError;
pub use speed_profile::SpeedProfile;
pub use stack::Stack;
