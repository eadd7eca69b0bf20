//! Lane borders as points and which parts of them carry a painted line: for the page and for the
//! recording's markers.

use road::{LaneKind, LaneTrack, Road, RoadPoint};
use serde::Serialize;

/// Distance between two points of a border, m: 5 mm off a 600 m curve.
pub const BORDER_STEP_M: f64 = 5.0;
/// Two lanes whose borders are closer than this touch, m.
const TOUCH_M: f64 = 0.5;

/// The borders of a lane over a stretch of road.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LaneLines {
    /// Number of the first point along the lane: the same for any stretch that holds it.
    pub first: usize,
    /// Points of the left border.
    pub left: Vec<RoadPoint>,
    /// Points of the right border.
    pub right: Vec<RoadPoint>,
    /// The painted lines along them.
    pub markings: Vec<Marking>,
}

/// A painted line along a border, from one of the stretch's points to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Marking {
    /// Which border.
    pub side: Side,
    /// How it is painted.
    pub line: Paint,
    /// Its first point among those of the border.
    pub first: usize,
    /// Its last one.
    pub last: usize,
}

/// A side of a lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// In the direction of travel.
    Left,
    /// In the direction of travel.
    Right,
}

/// How a line is painted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Paint {
    /// Not to be crossed.
    Solid,
    /// Between two lanes.
    Dashed,
}

impl LaneLines {
    /// Points every [`BORDER_STEP_M`] from the lane's start, those between two stations.
    #[must_use]
    pub fn between(road: &Road, lane: &LaneTrack, from_m: f64, to_m: f64) -> Self {
        let number = |s_m: f64| ((s_m - lane.s_start_m) / BORDER_STEP_M).max(0.0);
        let (first, end) = (number(from_m).floor() as usize, number(to_m).ceil() as usize);
        let count = number(lane.s_end_m).floor() as usize;
        let mut lines = Self { first, ..Self::default() };
        let (mut left_paint, mut right_paint) = (Vec::new(), Vec::new());
        for i in first..=end.min(count) {
            let s = lane.s_start_m + i as f64 * BORDER_STEP_M;
            let (d, half) = (lane.center_d_m(s), 0.5 * lane.width_m(s));
            lines.left.push(road.at(s, d + half));
            lines.right.push(road.at(s, d - half));
            left_paint.push(paint_at(road, lane, s, Side::Left));
            right_paint.push(paint_at(road, lane, s, Side::Right));
        }
        lines.markings = runs(Side::Left, &left_paint);
        lines.markings.extend(runs(Side::Right, &right_paint));
        lines
    }
}

/// The line on one side of a lane: solid at the edge of the road, dashed between two lanes
/// (painted by the right one of the two).
fn paint_at(road: &Road, lane: &LaneTrack, s_m: f64, side: Side) -> Option<Paint> {
    let sign = match side {
        Side::Left => 1.0,
        Side::Right => -1.0,
    };
    let border_m = lane.center_d_m(s_m) + sign * 0.5 * lane.width_m(s_m);
    let touching = road.lanes_at(s_m).find(|other| {
        let facing_m = other.center_d_m(s_m) - sign * 0.5 * other.width_m(s_m);
        other.id != lane.id && (facing_m - border_m).abs() < TOUCH_M
    });
    let inside = road.lanes_at(s_m).any(|other| {
        let off_m = (other.center_d_m(s_m) - border_m).abs();
        other.id != lane.id && off_m < 0.5 * other.width_m(s_m) - TOUCH_M
    });
    match touching {
        Some(other) if other.kind == LaneKind::Shoulder => Some(Paint::Solid),
        Some(_) if lane.kind == LaneKind::Shoulder => None,
        Some(_) => (side == Side::Left).then_some(Paint::Dashed),
        None => (!inside).then_some(Paint::Solid),
    }
}

/// Stretches of the same line.
fn runs(side: Side, paints: &[Option<Paint>]) -> Vec<Marking> {
    let mut markings: Vec<Marking> = Vec::new();
    for (i, paint) in paints.iter().enumerate() {
        let Some(line) = *paint else { continue };
        match markings.last_mut() {
            Some(m) if m.last + 1 == i && m.line == line => m.last = i,
            _ => markings.push(Marking { side, line, first: i, last: i }),
        }
    }
    markings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(road: &Road, lane: usize) -> LaneLines {
        LaneLines::between(road, &road.lanes()[lane], 0.0, road.length_m())
    }

    #[test]
    fn two_lanes_have_two_edges_and_one_dashed_line_between() {
        let road = road::builtin::flat(100.0);
        let marking = |side, line| Marking { side, line, first: 0, last: 20 };
        let (dashed, solid) = (Paint::Dashed, Paint::Solid);
        let right = [marking(Side::Left, dashed), marking(Side::Right, solid)];
        assert_eq!(lines(&road, 0).markings, right);
        assert_eq!(lines(&road, 1).markings, [marking(Side::Left, solid)]);
        assert_eq!(lines(&road, 1).left.len(), 21);
        let first = lines(&road, 1).left[0];
        assert_eq!((first.x_m, first.y_m), (0.0, 3.75));
    }

    #[test]
    fn pieces_of_a_lane_share_their_end_points() {
        let road = road::builtin::flat(100.0);
        let lane = &road.lanes()[0];
        let (a, b) = (
            LaneLines::between(&road, lane, 0.0, 40.0),
            LaneLines::between(&road, lane, 40.0, 1e9),
        );
        assert_eq!((a.first, b.first), (0, 8));
        assert_eq!(a.left.last(), b.left.first());
        assert_eq!(a.left.len() + b.left.len(), 22);
    }

    #[test]
    fn an_added_lane_turns_the_edge_into_a_dashed_line_while_it_lasts() {
        let road = road::builtin::highway();
        let third = &road.lanes()[2];
        let left: Vec<_> =
            lines(&road, 1).markings.into_iter().filter(|m| m.side == Side::Left).collect();
        let paints: Vec<_> = left.iter().map(|m| m.line).collect();
        assert_eq!(paints, [Paint::Solid, Paint::Dashed, Paint::Solid]);
        let dashed_from_m = left[1].first as f64 * BORDER_STEP_M;
        assert!((dashed_from_m - third.s_start_m).abs() < 2.0 * BORDER_STEP_M);
    }
}
