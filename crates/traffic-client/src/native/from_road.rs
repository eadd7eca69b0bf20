//! The drivers' tables, sampled from a [`Road`].

use road::{LaneEnd, LaneKind, LaneTrack, Road};

use super::lanes::{LaneMap, LaneSource, LaneUse, NO_LANE};
use crate::TrafficError;

/// Samples the road. Lane indices are those of [`Road::lanes`].
///
/// # Errors
/// [`TrafficError::Road`] if there is no lane to drive on.
pub(crate) fn lane_map(road: &Road) -> Result<LaneMap, TrafficError> {
    let tracks = road.lanes();
    if !tracks.iter().any(|track| track.kind == LaneKind::Driving) {
        let why = format!("`{}` has no through lane", road.name());
        return Err(TrafficError::Road { why });
    }
    let lanes = tracks.iter().map(|track| sample(road, track)).collect();
    Ok(LaneMap::new(lanes, 0.0, road.length_m(), &|s| road.at(s, 0.0).grade_rad))
}

fn sample(road: &Road, track: &LaneTrack) -> super::lanes::Lane {
    let usage = match track.kind {
        LaneKind::Driving => LaneUse::Through,
        LaneKind::Entry => LaneUse::Entry,
        LaneKind::Exit => LaneUse::Exit,
        LaneKind::Shoulder => LaneUse::Closed,
    };
    LaneSource {
        usage,
        drops: track.end == LaneEnd::Drops,
        leaves: track.end == LaneEnd::Leaves,
        s_start_m: track.s_start_m,
        s_end_m: track.s_end_m,
        center_d_m: &|s| track.center_d_m(s),
        width_m: &|s| track.width_m(s),
        limit_m_s: &|s| road.lane_speed_limit_m_s(track.id, s),
        beside: &|s| {
            let id = |lane: Option<u16>| lane.unwrap_or(NO_LANE);
            (id(road.left_of(track.id, s)), id(road.right_of(track.id, s)))
        },
    }
    .sample()
}
