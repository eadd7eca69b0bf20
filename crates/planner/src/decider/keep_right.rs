//! The duty to keep right: back to the right lane when it serves.
//!
//! European law asks drivers to use the right lane where they can (StVO section 2 (2); the
//! asymmetric passing rules of Kesting, Treiber and Helbing, "General lane-changing model MOBIL for
//! car-following models", 2007). A return serves when the truck can stay there: it would reach the
//! place behind the next slower vehicle, from which its decider leaves the lane again, no sooner
//! than in [`STAY_S`] at its wish speed. Without that, a truck that overtakes a column would weave
//! into each of its gaps.

use super::{LaneChoice, View};
use crate::safety::in_lane;

/// A return must last, s: the 20 s after which German courts see a right lane as usable.
pub(crate) const STAY_S: f64 = 20.0;

/// Right if the right lane serves, else keep. `leaving_gap_m` is the gap to a vehicle of a given
/// speed, m/s, ahead at which the decider would leave the lane again, m; `rear_gap_m` is what a
/// follower there is left, m.
#[must_use]
pub(crate) fn keep_right(
    view: &View<'_>,
    leaving_gap_m: impl Fn(f64) -> f64,
    rear_gap_m: f64,
) -> LaneChoice {
    let Some(lane) = view.lasting_beside(LaneChoice::Right) else { return LaneChoice::Keep };
    let wish_m_s = view.wish_speed_m_s.max(view.ego.speed_m_s);
    // Every vehicle there counts: a slow one may be hidden by a fast one that will be gone.
    let (front_m, width_m) = (view.extent.front_s_m, view.extent.width_m);
    let ahead = view.scene.neighbours.iter().filter(|n| n.front_s_m > front_m);
    let ahead_serves = ahead.filter(|n| in_lane(view.road, lane, n, width_m)).all(|n| {
        let closing_m = STAY_S * (wish_m_s - n.speed_m_s).max(0.0);
        n.rear_s_m - front_m >= leaving_gap_m(n.speed_m_s) + closing_m
    });
    let behind_serves = view.behind(lane).is_none_or(|(_, gap_m)| gap_m >= rear_gap_m);
    if ahead_serves && behind_serves { LaneChoice::Right } else { LaneChoice::Keep }
}
