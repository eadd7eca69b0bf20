//! The next kilometres, renewed while driving.
//!
//! | file | idea |
//! |---|---|
//! | `planner` | a request answered in bounded time |
//! | `setting` | course, bounds and candidates of one plan |
//! | `clock` | trip-time controller: the price of a second |
//! | `fence` | staying behind a vehicle ahead |

mod clock;
mod fence;
mod planner;
mod setting;

pub use clock::TripClock;
pub use fence::LeadAhead;
pub use planner::{
    HorizonConfig, HorizonFailure, HorizonPlan, HorizonPlanner, HorizonPoint, HorizonRequest,
};
