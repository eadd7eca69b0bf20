//! Whole trips against two cruise controls.
//!
//! | file | idea |
//! |---|---|
//! | `planner` | a request checked, sampled and solved |
//! | `result` | what a trip's plan comes to: totals, rows, savings |

mod planner;
mod result;

pub use planner::{Trip, TripRequest};
pub use result::{
    TripPlan, TripResult, TripRow, TripStatus, TripTotals, plan_trip, plan_trip_with,
};
