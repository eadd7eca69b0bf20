//! Predictive cruise control (paper Section VI-B1, Eq. 18 to 24).
//!
//! The paper minimises fuel plus an acceleration penalty over a trip of given average speed, in the
//! time domain, by a relaxed Newton method that takes a minute and has neither speed limits nor a
//! power limit. Here the same objective is solved in the space domain with specific kinetic energy
//! `E = v²/2` as state: dynamics and drag become linear, road and limits sit at fixed places, and
//! what remains nonlinear (duration, full load, fuel) is linearised successively around driven
//! profiles. Each subproblem is a convex quadratic programme.
//!
//! | file | idea |
//! |---|---|
//! | [`truck`] | traction, overrun and fuel per gear, from what the truck reports |
//! | `engine` | the engine's torque curves, read in one step |
//! | [`course`] | road at equal steps, speed ceilings, tuning |
//! | [`drive`] | the truth: driving a profile through the nonlinear truck |
//! | [`cruise`] | conventional cruise control, the baselines |
//! | [`lin`], [`quadratic`] | the convex subproblem |
//! | [`programme`], [`clarabel_backend`] | its solution by Clarabel |
//! | [`structured`] | its solution by a banded interior-point method, without a library |
//! | [`solver`] | which of the two a subproblem goes to |
//! | [`search`] | joint search over speed and gear on a grid |
//! | [`gears`] | shift places along a profile |
//! | [`sqp`] | the iteration |
//! | [`trip`] | whole trips against both baselines |
//! | [`trip_result`] | what a trip's plan comes to |
//! | [`eco_roll`] | coasting with the driveline open |
//! | [`horizon`] | the next kilometres, renewed while driving |
//! | [`horizon_time`] | trip-time controller: the price of a second |
//! | [`horizon_fence`] | staying behind a vehicle ahead |
//!
//! Left out: wind, torque build-up, and the speed lost during a shift (charged as fuel).

#[cfg(feature = "solver")]
pub mod clarabel_backend;
pub mod course;
pub mod cruise;
pub mod drive;
pub mod eco_roll;
mod engine;
mod error;
pub mod gears;
pub mod horizon;
pub mod horizon_fence;
mod horizon_setting;
pub mod horizon_time;
pub mod lin;
#[cfg(feature = "solver")]
pub mod programme;
pub mod quadratic;
pub mod search;
pub mod solution;
pub mod solver;
pub mod sqp;
pub mod structured;
pub mod trip;
pub mod trip_result;
pub mod truck;

pub use course::{SpeedBand, Tuning};
pub use error::PccError;
pub use trip::TripRequest;
pub use trip_result::{
    TripPlan, TripResult, TripRow, TripStatus, TripTotals, plan_trip, plan_trip_with,
};
