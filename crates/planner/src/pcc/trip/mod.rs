//! Whole trips against two cruise controls.
//!
//! | file | idea |
//! |---|---|
//! | `planner` | a request checked, sampled and solved |
//! | `price` | what a second and a joule are worth in fuel |
//! | `result` | what a trip's plan comes to: totals, rows, savings |
//! | `tube` | speeds once more, with the fuel map as it is |

mod planner;
mod price;
mod result;
mod tube;

pub use planner::{Trip, TripRequest};
pub use price::{Leg, Price};
pub use result::{
    TripPlan, TripResult, TripRow, TripStatus, TripTotals, plan_trip, plan_trip_with,
};
