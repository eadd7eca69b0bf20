//! `/road/lanes`: the painted lines as markers.

use std::ops::Range;

use tractrix_core::Time;

use super::{Scenery, in_map};
use crate::lane_lines::{LaneLines, Marking, Paint, Side};
use crate::ros::marker::{Color, Marker, MarkerArray};
use crate::ros::standard::Vector3;

/// A marker belongs to one stretch of the road this long, m, and keeps its id however often it is
/// sent.
const STRETCH_M: f64 = 1000.0;
/// Markers of one stretch, at most.
const IDS_PER_STRETCH: usize = 10_000;
/// A message is closed when it has reached this size, bytes, so that it stays below 100 kB.
const MESSAGE_BYTES: usize = 80_000;
/// A marker without points and one point in CDR, bytes, rounded up.
const MARKER_BYTES: usize = 300;
const POINT_BYTES: usize = 24;
/// One dash in three pieces of a border: 5 m of paint every 15 m.
const DASH_EVERY: usize = 3;
const PAINT: Color = Color { r: 0.9, g: 0.9, b: 0.88, a: 1.0 };
const PAINT_WIDTH_M: f64 = 0.15;

/// The lines of all stretches that a range of stations touches, in messages below 100 kB.
pub(super) fn lane_markers(
    now: Time,
    stations_m: &Range<f64>,
    scenery: &Scenery,
) -> Vec<MarkerArray> {
    let length_m = scenery.road.length_m();
    let stretch = |s_m: f64| (s_m.clamp(0.0, length_m) / STRETCH_M).floor() as usize;
    let stretches = stretch(stations_m.start)..=stretch(stations_m.end);
    let mut messages: Vec<MarkerArray> = Vec::new();
    let mut bytes = MESSAGE_BYTES;
    for marker in stretches.flat_map(|i| stretch_markers(now, i, scenery)) {
        if bytes >= MESSAGE_BYTES {
            messages.push(MarkerArray::default());
            bytes = 0;
        }
        bytes += MARKER_BYTES + POINT_BYTES * marker.points.len();
        if let Some(message) = messages.last_mut() {
            message.markers.push(marker);
        }
    }
    messages
}

/// The lines of one stretch.
fn stretch_markers(now: Time, stretch: usize, scenery: &Scenery) -> Vec<Marker> {
    let road = &scenery.road;
    let (from_m, to_m) = (stretch as f64 * STRETCH_M, (stretch + 1) as f64 * STRETCH_M);
    let here = road.lanes().iter().filter(|l| l.s_start_m < to_m && l.s_end_m > from_m);
    let lines = here.flat_map(|lane| {
        let lines = LaneLines::between(road, lane, from_m, to_m);
        let painted: Vec<_> = lines.markings.iter().map(|m| points(&lines, m)).collect();
        painted
    });
    let header = in_map(now);
    let numbered = lines.filter(|(_, points)| points.len() > 1).zip(0..IDS_PER_STRETCH);
    numbered
        .map(|((paint, points), number)| {
            let id = i32::try_from(stretch * IDS_PER_STRETCH + number).unwrap_or(i32::MAX);
            let marker = Marker::lines(&header, "lanes", id, points, paint == Paint::Dashed);
            let scale = Vector3 { x: PAINT_WIDTH_M, y: 0.0, z: 0.0 };
            Marker { scale, color: PAINT, ..marker }
        })
        .collect()
}

/// The points of a line: all of a solid one, the ends of each dash of a dashed one.
fn points(lines: &LaneLines, marking: &Marking) -> (Paint, Vec<Vector3>) {
    let border = match marking.side {
        Side::Left => &lines.left,
        Side::Right => &lines.right,
    };
    let all = || (marking.first..).zip(&border[marking.first..=marking.last]);
    let point = |p: &road::RoadPoint| Vector3 { x: p.x_m, y: p.y_m, z: p.z_m };
    let points = match marking.line {
        Paint::Solid => all().map(|(_, p)| point(p)).collect(),
        Paint::Dashed => all()
            .zip(all().skip(1))
            .filter(|((i, _), _)| (lines.first + i).is_multiple_of(DASH_EVERY))
            .flat_map(|((_, a), (_, b))| [point(a), point(b)])
            .collect(),
    };
    (marking.line, points)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Arc;

    use super::super::Combination;
    use super::*;

    fn scenery() -> Scenery {
        let road = Arc::new(road::builtin::highway());
        Scenery { road, combination: Combination::default(), geodesy: None }
    }

    fn ids(messages: &[MarkerArray]) -> Vec<i32> {
        messages.iter().flat_map(|m| m.markers.iter().map(|m| m.id)).collect()
    }

    #[test]
    fn the_whole_road_comes_in_small_messages_and_every_line_once() {
        let scenery = scenery();
        let all = lane_markers(Time::ZERO, &(0.0..scenery.road.length_m()), &scenery);
        assert!(all.len() > 1);
        for message in &all {
            let cdr = cdr_encoding::to_vec::<_, byteorder::LittleEndian>(message).unwrap();
            assert!(cdr.len() < 100_000, "{} bytes", cdr.len());
        }
        let ids = ids(&all);
        assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), ids.len());
    }

    #[test]
    fn a_part_of_the_road_has_the_ids_that_it_has_in_the_whole() {
        let scenery = scenery();
        let all = ids(&lane_markers(Time::ZERO, &(0.0..scenery.road.length_m()), &scenery));
        let part = ids(&lane_markers(Time::ZERO, &(4500.0..6200.0), &scenery));
        assert!(!part.is_empty() && part.len() < all.len());
        assert!(part.iter().all(|id| all.contains(id)));
    }

    #[test]
    fn lines_lie_on_the_road_at_the_borders_of_lanes() {
        let scenery = scenery();
        let road = &scenery.road;
        for message in lane_markers(Time::ZERO, &(2000.0..2500.0), &scenery) {
            for p in message.markers.iter().flat_map(|m| &m.points) {
                let at = road.project(p.x, p.y, None).unwrap();
                let border = road.lanes_at(at.s_m).any(|l| {
                    let off_m = (at.d_m - l.center_d_m(at.s_m)).abs();
                    (off_m - 0.5 * l.width_m(at.s_m)).abs() < 0.01
                });
                assert!(border, "{at:?}");
                assert!((road.at(at.s_m, at.d_m).z_m - p.z).abs() < 0.01);
            }
        }
    }
}
