//! Who is ahead, behind and alongside in a lane, as gaps from bumper to bumper.
//!
//! A neighbour is in a lane if it says so (lane or target lane), or if its body reaches into the
//! corridor that the ego's body needs there.

use road::Road;
use tractrix_core::{EgoState, Geometry, Neighbour, Scene};

/// Lateral clearance that still counts as being in the way, m.
const SIDE_MARGIN_M: f64 = 0.3;

/// The ego's extent along the road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EgoExtent {
    /// Front bumper, m.
    pub front_s_m: f64,
    /// Trailer's rear, m.
    pub rear_s_m: f64,
    /// Body width, m.
    pub width_m: f64,
}

impl EgoExtent {
    /// Of a straight combination at `s_m`.
    #[must_use]
    pub(crate) fn new(ego: &EgoState, geometry: &Geometry) -> Self {
        Self {
            front_s_m: ego.s_m + geometry.front_m,
            rear_s_m: ego.s_m - geometry.rear_m(),
            width_m: geometry.width_m,
        }
    }
}

/// Whether a neighbour is in a lane, or on its way into it.
#[must_use]
pub(crate) fn in_lane(road: &Road, lane: u16, neighbour: &Neighbour, ego_width_m: f64) -> bool {
    if neighbour.lane == lane || neighbour.target_lane == Some(lane) {
        return true;
    }
    let Some(track) = road.lanes().get(usize::from(lane)) else {
        return false;
    };
    let centre = track.center_d_m(0.5 * (neighbour.front_s_m + neighbour.rear_s_m));
    reaches(neighbour, centre, ego_width_m)
}

/// Whether a neighbour's body reaches into the ego's, were the ego centred at `d_m`.
#[must_use]
pub(crate) fn reaches(neighbour: &Neighbour, d_m: f64, ego_width_m: f64) -> bool {
    (neighbour.d_m - d_m).abs() < 0.5 * (neighbour.width_m + ego_width_m) + SIDE_MARGIN_M
}

/// The nearest vehicle ahead among those that `counts` accepts: its front is ahead of the ego's.
pub(crate) fn ahead<'a>(
    scene: &'a Scene,
    ego: &EgoExtent,
    counts: impl Fn(&Neighbour) -> bool,
) -> Option<&'a Neighbour> {
    scene
        .neighbours
        .iter()
        .filter(|n| n.front_s_m > ego.front_s_m && counts(n))
        .min_by(|a, b| a.rear_s_m.total_cmp(&b.rear_s_m))
}

/// The nearest vehicle behind among those that `counts` accepts: its front is behind the ego's
/// front bumper, so that a vehicle alongside the trailer is found with a negative gap.
pub(crate) fn behind<'a>(
    scene: &'a Scene,
    ego: &EgoExtent,
    counts: impl Fn(&Neighbour) -> bool,
) -> Option<&'a Neighbour> {
    scene
        .neighbours
        .iter()
        .filter(|n| n.front_s_m <= ego.front_s_m && counts(n))
        .max_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m))
}
