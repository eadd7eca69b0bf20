//! The truth that plans are made for and judged by.
//!
//! | file | idea |
//! |---|---|
//! | `truck` | traction, overrun and fuel per gear, from what the truck reports |
//! | `engine` | the engine's torque curves, read in one step |
//! | `course` | road at equal steps, speed ceilings, tuning |
//! | `drive` | driving a profile through the nonlinear truck |
//! | `cruise` | conventional cruise control, the baselines |

mod course;
mod cruise;
mod drive;
mod engine;
mod truck;

pub(crate) use course::MIN_SPEED_M_S;
pub use course::{Course, SpeedBand, Tuning, profile_of};
pub(crate) use cruise::{cruise_energies, cruise_trip};
pub(crate) use drive::{
    CUT_ROUNDING, Demand, E_FLOOR, coast_energy, demand_m_s2, drive_leg, duration_s, needed_before,
};
pub use drive::{Driven, drive_profile};
pub(crate) use truck::Operating;
pub use truck::{Drive, Truck};
