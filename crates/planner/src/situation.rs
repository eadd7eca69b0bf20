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
