//! Deciders, predictive cruise control, lane-change paths, safety gate, controllers, guard.
//!
//! [`Stack`] is the planning stack of one truck and [`drive_tick`] one tick of the loop around it.
//!
//! | folder | holds |
//! |---|---|
//! | `stack` | one tick of the stack: decide, plan, control, guard; its configuration |
//! | [`decider`] | who wishes for a lane change: rules, MOBIL, a learned policy |
//! | [`steering`] | lane-change planning and manoeuvres, paths, the lateral controller |
//! | [`speed`] | reference speed, car following, the longitudinal controller, the load estimator |
//! | [`safety`] | safe gaps, the gate before a lane change, the guard before the vehicle |
//! | [`localise`] | the pose from wheel speed, yaw rate and satellites |
//! | [`pcc`] | predictive cruise control: the fuel-optimal speed over a trip or a horizon |
//!
//! Without default features the crate is `no_std + alloc` and needs no solver. It plans with what a
//! truck tells about itself ([`tractrix_core::VehicleLimits`]) and never sees the plant's model.
//!
//! ```
//! use planner::safety::{RssConfig, SafeGap};
//! use tractrix_core::VehicleClass;
//!
//! // A car that comes with 25 m/s may be this near to a truck that changes into its lane with 22.
//! let rss = RssConfig::default();
//! let behind = SafeGap::new(&rss.behind(VehicleClass::Car), rss.ego_brake_max_m_s2, 0.0);
//! assert!((behind.gap_m(25.0, 22.0) - 80.5).abs() < 0.1);
//! ```
#![cfg_attr(not(feature = "std"), no_std)]
extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod decider;
mod drive;
mod error;
pub mod localise;
pub mod pcc;
pub mod safety;
mod situation;
pub mod speed;
mod stack;
pub mod steering;
#[cfg(test)]
#[path = "../tests/support/data_sheet.rs"]
mod testing;

pub use decider::{DeciderKind, LaneChoice};
pub use drive::{DriveError, TickOutcome, drive_tick};
pub use error::PlannerError;
pub use situation::Situation;
pub use speed::SpeedProfile;
pub use stack::{
    OutsideDemand, RatesConfig, SpeedPlannerKind, Stack, StackConfig, TacticalPlan, Tactics,
};

/// Angle in -pi..pi.
pub(crate) fn wrapped(angle_rad: f64) -> f64 {
    libm::remainder(angle_rad, 2.0 * core::f64::consts::PI)
}
