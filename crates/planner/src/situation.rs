//! What a truck is in at an instant.

use road::Road;
use tractrix_core::{EgoState, Scene, Time, VehicleLimits};

/// The truck and what is around it.
#[derive(Debug, Clone, Copy)]
pub struct Situation<'a> {
    /// Time.
    pub now: Time,
    /// The truck.
    pub ego: &'a EgoState,
    /// The others.
    pub scene: &'a Scene,
    /// The road.
    pub road: &'a Road,
    /// The truck's limits.
    pub limits: &'a VehicleLimits,
}

/// Mean grade under the combination, rad (uphill positive).
pub(crate) fn grade_rad(road: &Road, ego: &EgoState, limits: &VehicleLimits) -> f64 {
    let g = &limits.geometry;
    let length_m = g.length_m().max(1.0);
    let front_m = road.line().height_m(ego.s_m + g.front_m);
    let rear_m = road.line().height_m(ego.s_m - g.rear_m());
    libm::atan((front_m - rear_m) / length_m)
}

impl Situation<'_> {
    /// Mean grade under the combination, rad (uphill positive).
    pub(crate) fn grade_rad(&self) -> f64 {
        grade_rad(self.road, self.ego, self.limits)
    }

    /// The steepest descent under the combination and within its stopping distance ahead, rad.
    pub(crate) fn descent_rad(&self) -> f64 {
        let slopes = (0..8).map(|i| self.road.line().slope(self.ego.s_m + 25.0 * f64::from(i)));
        self.grade_rad().min(libm::atan(slopes.fold(0.0, f64::min)))
    }
}
