//! From a tick to the messages of a recording: pure functions, one per topic. Nothing here knows a
//! file; what does not change during a run is in [`Scenery`].

mod bodies;
mod geo;
mod lanes;
mod motion;

use std::sync::Arc;

use road::Road;
use tractrix_core::{Tick, Time};

pub(crate) use bodies::Combination;
pub(crate) use geo::Geodesy;
pub(super) use lanes::lane_markers;
pub(super) use motion::{clock, fix, odometry, path, static_transforms, transforms};

use self::bodies::{ego_markers, neighbour_marker};
use super::ros::marker::MarkerArray;
use super::ros::standard::{Header, Stamp};
use super::ros::truck::{PlanState, Scene, SceneVehicle, TruckState};

/// What does not change during a run.
pub(crate) struct Scenery {
    /// The road that is driven.
    pub(crate) road: Arc<Road>,
    /// The ego's lengths.
    pub(crate) combination: Combination,
    /// Where the map lies on the earth, if that is known.
    pub(crate) geodesy: Option<Geodesy>,
}

/// Header of a message in map coordinates.
fn in_map(now: Time) -> Header {
    Header { stamp: Stamp::of(now), frame_id: "map" }
}

/// `/truck/state`.
pub(super) fn truck_state(tick: &Tick<'_>, scenery: &Scenery) -> TruckState {
    let grade_rad = scenery.road.at(tick.ego.s_m, tick.ego.d_m).grade_rad;
    TruckState::new(in_map(tick.now), tick.ego, grade_rad, &tick.plan.command)
}

/// `/truck/plan`.
pub(super) fn plan_state(tick: &Tick<'_>) -> PlanState {
    PlanState::new(in_map(tick.now), tick.plan)
}

/// `/scene`.
pub(super) fn scene(tick: &Tick<'_>) -> Scene {
    let vehicles = tick.scene.neighbours.iter().map(SceneVehicle::from).collect();
    Scene { header: in_map(tick.now), vehicles }
}

/// `/markers`: the truck and the other vehicles.
pub(super) fn markers(tick: &Tick<'_>, scenery: &Scenery) -> MarkerArray {
    let header = in_map(tick.now);
    let others = tick.scene.neighbours.iter();
    let markers = ego_markers(&header, tick.ego, scenery)
        .into_iter()
        .chain(others.map(|n| neighbour_marker(&header, n, &scenery.road)))
        .collect();
    MarkerArray { markers }
}
