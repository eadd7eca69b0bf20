//! From a tick to the messages of a recording: pure functions. Nothing here knows a file; what does
//! not change during a run is in [`Scenery`].

mod bodies;
mod geo;
mod health;
mod lanes;
mod motion;

use std::ops::Range;
use std::sync::Arc;

use road::Road;
use tractrix_core::{Tick, Time};

pub use bodies::Combination;
pub use geo::Geodesy;

use self::bodies::{ego_markers, neighbour_marker};
use self::health::diagnostics;
use self::lanes::lane_markers;
use self::motion::{clock, fix, imu, odometry, path, static_transforms, transforms};
use crate::error::RecordingError;
use crate::ros::marker::MarkerArray;
use crate::ros::standard::{Header, Stamp};
use crate::ros::truck::{PlanState, Scene, SceneVehicle, TruckState};
use crate::schedule::{Due, LANES_AT_START_M};
use crate::topic::{
    CLOCK, DIAGNOSTICS, FIX, FRAMES, IMU, LANES, MARKERS, ODOMETRY, PATH, PLAN, SCENE,
    STATIC_FRAMES, TRUCK, TopicMessage,
};

/// How far around the truck the lane lines are repeated, m.
const LANES_BEHIND_M: f64 = 500.0;
const LANES_AHEAD_M: f64 = 1500.0;

/// What does not change during a run.
pub struct Scenery {
    /// The road that is driven.
    pub road: Arc<Road>,
    /// The ego's lengths.
    pub combination: Combination,
    /// Where the map lies on the earth, if that is known.
    pub geodesy: Option<Geodesy>,
}

/// The messages of a tick: those of every tick, and what of the others is due.
///
/// # Errors
/// [`RecordingError::Encode`] names the topic.
pub fn messages(
    tick: &Tick<'_>,
    scenery: &Scenery,
    due: Due,
) -> Result<Vec<TopicMessage>, RecordingError> {
    let mut messages = vec![
        CLOCK.encode(&clock(tick.now))?,
        FRAMES.encode(&transforms(tick, scenery))?,
        ODOMETRY.encode(&odometry(tick, scenery))?,
        IMU.encode(&imu(tick, scenery))?,
        TRUCK.encode(&truck_state(tick, scenery))?,
        PLAN.encode(&plan_state(tick))?,
    ];
    if due.scene {
        messages.push(PATH.encode(&path(tick, scenery))?);
        messages.push(SCENE.encode(&scene(tick))?);
        messages.push(MARKERS.encode(&markers(tick, scenery))?);
        if let Some(fix) = fix(tick, scenery) {
            messages.push(FIX.encode(&fix)?);
        }
    }
    if due.diagnostics {
        messages.push(DIAGNOSTICS.encode(&diagnostics(tick))?);
    }
    if due.lanes {
        let s_m = tick.ego.s_m;
        let around_m = s_m - LANES_BEHIND_M..s_m + LANES_AHEAD_M;
        messages.extend(lanes(tick.now, &around_m, scenery)?);
    }
    Ok(messages)
}

/// `/tf_static`, once before the first tick.
///
/// # Errors
/// [`RecordingError::Encode`] names the topic.
pub fn static_frames(scenery: &Scenery) -> Result<TopicMessage, RecordingError> {
    STATIC_FRAMES.encode(&static_transforms(scenery))
}

/// `/road/lanes` of the whole road, or of the first 100 km of a longer one, before the first tick.
///
/// # Errors
/// [`RecordingError::Encode`] names the topic.
pub fn lanes_at_start(scenery: &Scenery) -> Result<Vec<TopicMessage>, RecordingError> {
    let length_m = scenery.road.length_m();
    lanes(Time::ZERO, &(0.0..length_m.min(LANES_AT_START_M)), scenery)
}

/// `/road/lanes`: the lane lines of a part of the road.
fn lanes(
    now: Time,
    stations_m: &Range<f64>,
    scenery: &Scenery,
) -> Result<Vec<TopicMessage>, RecordingError> {
    lane_markers(now, stations_m, scenery).iter().map(|message| LANES.encode(message)).collect()
}

/// Header of a message in map coordinates.
fn in_map(now: Time) -> Header {
    Header { stamp: Stamp::of(now), frame_id: "map" }
}

/// `/truck/state`.
fn truck_state(tick: &Tick<'_>, scenery: &Scenery) -> TruckState {
    let grade_rad = scenery.road.at(tick.ego.s_m, tick.ego.d_m).grade_rad;
    TruckState::new(in_map(tick.now), tick.ego, grade_rad, &tick.plan.command)
}

/// `/truck/plan`.
fn plan_state(tick: &Tick<'_>) -> PlanState {
    PlanState::new(in_map(tick.now), tick.plan)
}

/// `/scene`.
fn scene(tick: &Tick<'_>) -> Scene {
    let vehicles = tick.scene.neighbours.iter().map(SceneVehicle::from).collect();
    Scene { header: in_map(tick.now), vehicles }
}

/// `/markers`: the truck and the other vehicles.
fn markers(tick: &Tick<'_>, scenery: &Scenery) -> MarkerArray {
    let header = in_map(tick.now);
    let others = tick.scene.neighbours.iter();
    let markers = ego_markers(&header, tick.ego, scenery)
        .into_iter()
        .chain(others.map(|n| neighbour_marker(&header, n, &scenery.road)))
        .collect();
    MarkerArray { markers }
}
