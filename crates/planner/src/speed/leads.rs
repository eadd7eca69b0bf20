//! The vehicles that the speed controller has to follow: in the lane kept, in the lane left as long
//! as the body reaches into it, and whoever is about to come in.

use super::following::Lead;
use crate::safety::{EgoExtent, RssConfig, ahead, in_lane, reaches};
use crate::steering::ManeuverPlanner;
use road::Road;
use tractrix_core::{EgoState, Maneuver, Neighbour, Scene, VehicleLimits};

/// A vehicle that will reach into the ego's path within this time is in it, s.
const ENTERS_S: f64 = 1.0;

/// What leads are looked for with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeadView<'a> {
    /// The truck.
    pub ego: &'a EgoState,
    /// The others.
    pub scene: &'a Scene,
    /// The road.
    pub road: &'a Road,
    /// The truck's limits.
    pub limits: &'a VehicleLimits,
    /// Safe-gap assumptions.
    pub rss: &'a RssConfig,
}

/// The lead in the lane that the path ends in, and the one in the lane that is being left.
#[must_use]
pub(crate) fn leads(view: &LeadView<'_>, maneuver: &ManeuverPlanner) -> [Option<Lead>; 2] {
    let extent = EgoExtent::new(view.ego, &view.limits.geometry);
    let width = extent.width_m;
    let kept = maneuver.path().lane;
    let changing = matches!(maneuver.maneuver(), Maneuver::ChangeLeft | Maneuver::ChangeRight);
    let front_d_m = maneuver.path().at(view.road, extent.front_s_m).d_m;
    let lead = |n: &Neighbour, being_left: bool| Lead {
        id: n.id,
        gap_m: n.rear_s_m - extent.front_s_m,
        speed_m_s: n.speed_m_s,
        accel_m_s2: n.accel_m_s2,
        brake_max_m_s2: view.rss.brake_max_m_s2(n.class),
        being_left,
        in_path: enters(n, view.ego.d_m, width) || enters(n, front_d_m, width),
    };
    let first = ahead(view.scene, &extent, |n| in_lane(view.road, kept, n, width));
    let second = ahead(view.scene, &extent, |n| {
        reaches(n, view.ego.d_m, width) || reaches(n, front_d_m, width)
    });
    let second = second.filter(|s| first.is_none_or(|f| f.id != s.id));
    [first.map(|n| lead(n, false)), second.map(|n| lead(n, changing))]
}

/// Whether a neighbour reaches into the ego's body at `d_m`, or will within [`ENTERS_S`].
fn enters(n: &Neighbour, d_m: f64, ego_width_m: f64) -> bool {
    let soon = Neighbour { d_m: n.d_m + n.lateral_speed_m_s * ENTERS_S, ..*n };
    let crosses = (n.d_m - d_m) * (soon.d_m - d_m) < 0.0;
    reaches(n, d_m, ego_width_m) || reaches(&soon, d_m, ego_width_m) || crosses
}
