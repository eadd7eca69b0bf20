//! From a wish to the hand wheel: lane changes are planned and watched, paths followed.
//!
//! | file | holds |
//! |---|---|
//! | `path` | lane centres, quintic transitions, what is driven |
//! | `lane_change` | candidates of a change, the cheapest that the safety gate passes |
//! | `corners` | whether tractor and trailer stay between the edges of two lanes |
//! | `maneuver` | the state machine: keep lane, change, abort |
//! | `model` | the truck's lateral dynamics in discrete time, Riccati equation |
//! | `controller` | feedforward and feedback along a path |

mod controller;
mod corners;
mod lane_change;
mod maneuver;
mod model;
mod path;

pub use controller::LateralConfig;
pub(crate) use controller::{LateralController, PREVIEW_POINTS, PREVIEW_STEP_S, PathError};
pub use lane_change::{LaneChangeConfig, PlannedChange, Start, plan_change};
pub(crate) use maneuver::{ManeuverPlanner, Outlook};
pub(crate) use model::LOWEST_SPEED_M_S;
pub use path::{Lateral, LateralPath};
