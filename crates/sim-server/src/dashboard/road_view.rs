//! The road as the page draws it: lane borders in the map, markings, and the profile over distance.

use road::{LaneKind, LaneTrack, Road};
use serde::Serialize;

use super::strip::round;
use crate::provenance::SCHEMA;
use crate::recording::Combination;

/// Distance between two points of a border, m: 5 mm off a 600 m curve.
const BORDER_STEP_M: f64 = 5.0;
/// Distance between two points of the profile, m.
const PROFILE_STEP_M: f64 = 20.0;
/// Two lanes whose borders are closer than this touch, m.
const TOUCH_M: f64 = 0.5;

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

/// A painted line along a border, from one of its points to another.
#[derive(Debug, PartialEq, Eq, Serialize)]
struct Marking {
    side: &'static str,
    line: &'static str,
    first: usize,
    last: usize,
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
    let (mut left, mut right) = (Vec::new(), Vec::new());
    let (mut left_lines, mut right_lines) = (Vec::new(), Vec::new());
    for s in stations(lane.s_start_m, lane.s_end_m, BORDER_STEP_M) {
        let (d, half) = (lane.center_d_m(s), 0.5 * lane.width_m(s));
        for (border, d_m) in [(&mut left, d + half), (&mut right, d - half)] {
            let p = road.at(s, d_m);
            border.extend([round(p.x_m, 1e2), round(p.y_m, 1e2)]);
        }
        left_lines.push(line_at(road, lane, s, 1.0));
        right_lines.push(line_at(road, lane, s, -1.0));
    }
    let mut markings = runs("left", &left_lines);
    markings.extend(runs("right", &right_lines));
    Lane {
        id: lane.id,
        kind: match lane.kind {
            LaneKind::Driving => "driving",
            LaneKind::Entry => "entry",
            LaneKind::Exit => "exit",
            LaneKind::Shoulder => "shoulder",
        },
        s_start_m: lane.s_start_m,
        left_xy_m: left,
        right_xy_m: right,
        markings,
    }
}

/// The line on one side of a lane (1 left, -1 right): solid at the edge of the road, dashed
/// between two lanes (painted by the right one of the two).
fn line_at(road: &Road, lane: &LaneTrack, s_m: f64, side: f64) -> Option<&'static str> {
    let border_m = lane.center_d_m(s_m) + side * 0.5 * lane.width_m(s_m);
    let touching = road.lanes_at(s_m).find(|other| {
        let facing_m = other.center_d_m(s_m) - side * 0.5 * other.width_m(s_m);
        other.id != lane.id && (facing_m - border_m).abs() < TOUCH_M
    });
    let inside = road.lanes_at(s_m).any(|other| {
        let off_m = (other.center_d_m(s_m) - border_m).abs();
        other.id != lane.id && off_m < 0.5 * other.width_m(s_m) - TOUCH_M
    });
    match touching {
        Some(other) if other.kind == LaneKind::Shoulder => Some("solid"),
        Some(_) if lane.kind == LaneKind::Shoulder => None,
        Some(_) => (side > 0.0).then_some("dashed"),
        None => (!inside).then_some("solid"),
    }
}

/// Stretches of the same line.
fn runs(side: &'static str, lines: &[Option<&'static str>]) -> Vec<Marking> {
    let mut markings: Vec<Marking> = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        let Some(line) = *line else { continue };
        match markings.last_mut() {
            Some(m) if m.last + 1 == i && m.line == line => m.last = i,
            _ => markings.push(Marking { side, line, first: i, last: i }),
        }
    }
    markings
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

#[cfg(test)]
mod tests {
    use super::*;

    fn view(road: &Road, lane: usize) -> Lane {
        lane_view(road, &road.lanes()[lane])
    }

    #[test]
    fn two_lanes_have_two_edges_and_one_dashed_line_between() {
        let road = road::builtin::flat(100.0);
        let marking = |side, line| Marking { side, line, first: 0, last: 20 };
        assert_eq!(view(&road, 0).markings, [marking("left", "dashed"), marking("right", "solid")]);
        assert_eq!(view(&road, 1).markings, [marking("left", "solid")]);
        assert_eq!(view(&road, 1).left_xy_m.len(), 42);
        assert_eq!(&view(&road, 1).left_xy_m[..2], &[0.0, 3.75]);
    }

    #[test]
    fn an_added_lane_turns_the_edge_into_a_dashed_line_while_it_lasts() {
        let road = road::builtin::highway();
        let left: Vec<_> =
            view(&road, 1).markings.into_iter().filter(|m| m.side == "left").collect();
        let lines: Vec<_> = left.iter().map(|m| m.line).collect();
        assert_eq!(lines, ["solid", "dashed", "solid"]);
        assert_eq!(left[1].first, 1200, "the third lane starts at 6 km");
    }
}
