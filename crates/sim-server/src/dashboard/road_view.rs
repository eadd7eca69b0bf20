//! The road as the page draws it: lane borders in the map, markings, and the profile over distance.

use recording::Combination;
use recording::lane_lines::{BORDER_STEP_M, LaneLines, Marking};
use road::{LaneKind, LaneTrack, Road, RoadPoint};
use serde::Serialize;

use super::strip::round;
use crate::provenance::SCHEMA;

/// Distance between two points of the profile, m.
const PROFILE_STEP_M: f64 = 20.0;

/// What `/api/v1/road` answers.
#[derive(Debug, Serialize)]
struct RoadView<'a> {
    schema: u32,
    name: &'a str,
    length_m: f64,
    border_step_m: f64,
    lanes: Vec<Lane>,
    profile: Profile,
    truck: &'a Combination,
}

/// One lane: its borders sampled from `s_start_m` on, and which parts of them carry a line.
#[derive(Debug, Serialize)]
struct Lane {
    id: u16,
    kind: &'static str,
    s_start_m: f64,
    /// Map x and y in turn, m.
    left_xy_m: Vec<f64>,
    right_xy_m: Vec<f64>,
    markings: Vec<Marking>,
}

/// Columns over distance.
#[derive(Debug, Default, Serialize)]
struct Profile {
    s_m: Vec<f64>,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    z_m: Vec<f64>,
    grade_frac: Vec<f64>,
    speed_limit_m_s: Vec<f64>,
}

/// The road and the truck's lengths as JSON.
pub(crate) fn road_json(road: &Road, truck: &Combination) -> String {
    let view = RoadView {
        schema: SCHEMA,
        name: road.name(),
        length_m: road.length_m(),
        border_step_m: BORDER_STEP_M,
        lanes: road.lanes().iter().map(|lane| lane_view(road, lane)).collect(),
        profile: profile(road),
        truck,
    };
    serde_json::to_string(&view).unwrap_or_default()
}

fn stations(start_m: f64, end_m: f64, step_m: f64) -> impl Iterator<Item = f64> {
    let count = ((end_m - start_m) / step_m).floor().max(0.0) as usize;
    (0..=count).map(move |i| start_m + i as f64 * step_m)
}

fn lane_view(road: &Road, lane: &LaneTrack) -> Lane {
    let lines = LaneLines::between(road, lane, lane.s_start_m, lane.s_end_m);
    let flat = |border: &[RoadPoint]| {
        border.iter().flat_map(|p| [round(p.x_m, 1e2), round(p.y_m, 1e2)]).collect()
    };
    Lane {
        id: lane.id,
        kind: match lane.kind {
            LaneKind::Driving => "driving",
            LaneKind::Entry => "entry",
            LaneKind::Exit => "exit",
            LaneKind::Shoulder => "shoulder",
        },
        s_start_m: lane.s_start_m,
        left_xy_m: flat(&lines.left),
        right_xy_m: flat(&lines.right),
        markings: lines.markings,
    }
}

fn profile(road: &Road) -> Profile {
    let mut p = Profile::default();
    for s in stations(0.0, road.length_m(), PROFILE_STEP_M) {
        let at = road.at(s, 0.0);
        p.s_m.push(s);
        p.x_m.push(round(at.x_m, 10.0));
        p.y_m.push(round(at.y_m, 10.0));
        p.z_m.push(round(at.z_m, 1e2));
        p.grade_frac.push(round(at.grade_rad.tan(), 1e5));
        p.speed_limit_m_s.push(round(road.speed_limit_m_s(s), 1e2));
    }
    p
}
