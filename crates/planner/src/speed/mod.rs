//! How fast, and with which actuator.
//!
//! | file | holds |
//! |---|---|
//! | `reference` | reference speed ahead: set speed or plan, limits, curves, a lane's end |
//! | `profile` | a speed profile planned ahead of time |
//! | `leads` | the vehicles that bound the truck's speed |
//! | `following` | acceleration behind each of them |
//! | `stop_and_go` | in a jam: the jam's mean speed, a gap that breathes, stops and starts |
//! | `road_load` | inverse powertrain: acceleration to force to pedal |
//! | `longitudinal` | the controller: pedal, retarder, brakes |
//! | `estimator` | mass and rolling resistance from driving |

mod estimator;
mod following;
mod leads;
mod longitudinal;
mod profile;
mod reference;
mod road_load;
mod stop_and_go;

pub(crate) use estimator::LoadEstimator;
pub use estimator::{EstimatorConfig, LoadEstimate};
pub use following::FollowingConfig;
pub(crate) use following::{Following, Lead, follow, steady_gap_m};
pub(crate) use leads::{LeadView, leads};
pub use longitudinal::LongitudinalConfig;
pub(crate) use longitudinal::{LongitudinalController, SpeedTarget};
pub use profile::SpeedProfile;
pub(crate) use reference::{ReferenceSpeed, SpeedBounds};
pub(crate) use road_load::power_reserve_w;
pub(crate) use stop_and_go::{KeptGear, StopAndGo};
