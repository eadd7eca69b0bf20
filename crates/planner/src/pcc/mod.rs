//! Predictive cruise control (paper Section VI-B1, Eq. 18 to 24).
//!
//! The paper minimises fuel plus an acceleration penalty over a trip of given average speed, in the
//! time domain, by a relaxed Newton method that takes a minute and has neither speed limits nor a
//! power limit. Here the same objective is solved in the space domain with specific kinetic energy
//! `E = v²/2` as state: dynamics and drag become linear, road and limits sit at fixed places, and
//! what remains nonlinear (duration, full load, fuel) is linearised successively around driven
//! profiles. Each subproblem is a convex quadratic programme.
//!
//! | folder | holds |
//! |---|---|
//! | [`model`] | truck, course, and driving a profile: the truth |
//! | `search` | gears: joint search over speed and gear, shift places |
//! | [`solve`] | the convex subproblem, its solvers, the iteration |
//! | [`trip`] | whole trips against two cruise controls |
//! | [`horizon`] | the next kilometres, renewed while driving |
//!
//! Left out: wind, torque build-up, and the speed lost during a shift (charged as fuel).

mod error;
pub mod horizon;
pub mod model;
mod search;
pub mod solve;
pub mod trip;

pub use error::PccError;
pub use model::{SpeedBand, Tuning, profile_of};
pub use trip::{
    Leg, Price, Trip, TripPlan, TripRequest, TripResult, TripRow, TripStatus, TripTotals,
    plan_trip, plan_trip_with,
};
