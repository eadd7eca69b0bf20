//! OpenDRIVE out: the whole network, or one [`Road`], for other programs (SUMO's netconvert).
//!
//! Numbers are written with all their digits, so that reading them again gives the same map. Every
//! driven lane carries its speed limit in m/s, because netconvert reads no limit of road types.

use super::elements::elements;
use super::model::{Header, Lane, LaneOutline, LaneSection, Network, RoadRecord};
use super::xml_out::Xml;
use crate::cubics::Span;
use crate::{Cubics, LaneKind, Road};

impl Network {
    /// The network as OpenDRIVE. Records that are not read are not written.
    #[must_use]
    pub fn write_opendrive(&self) -> String {
        let mut out = Xml::new(&self.header);
        self.roads.iter().for_each(|road| out.road(road));
        self.junctions.iter().for_each(|junction| out.junction(junction));
        out.finish()
    }
}

impl Road {
    /// The road as OpenDRIVE: its lanes are the right lanes of road `1`, the leftmost is lane -1;
    /// spaces between lanes become lanes of type `none`. Where it lies on the earth is kept.
    #[must_use]
    pub fn write_opendrive(&self) -> String {
        let header = Header {
            rev_major: 1,
            rev_minor: 6,
            name: self.name().into(),
            geo_reference: self.geo_reference().cloned().unwrap_or_default(),
        };
        let mut out = Xml::new(&header);
        out.road(&record_of(self));
        out.finish()
    }
}

fn record_of(road: &Road) -> RoadRecord {
    let length_m = road.length_m();
    let mut ends: Vec<f64> = road.section_starts_m().skip(1).collect();
    ends.push(length_m);
    let mut offset: Vec<Span> = Vec::new();
    let mut sections: Vec<LaneSection> = Vec::new();
    let mut ids_before: Vec<(u16, i32)> = Vec::new();
    for (s_m, end_m) in road.section_starts_m().zip(ends) {
        let mut lanes: Vec<Lane> = Vec::new();
        let mut ids: Vec<(u16, i32)> = Vec::new();
        let tracks: Vec<u16> = road.lanes_at(0.5 * (s_m + end_m)).map(|l| l.id).collect();
        let spans = spans(road, &tracks, s_m, end_m);
        let mut inner: Option<u16> = None;
        for &track in tracks.iter().rev() {
            if let Some(left) = inner {
                let gap = width_spans(road, &spans, s_m, Some(left), track);
                if gap.iter().any(|g| g.2.0 > 0.01 || g.3.0 > 0.01) {
                    lanes.push(plain_lane(-(lanes.len() as i32) - 1, "none", &gap, end_m - s_m));
                }
            } else {
                offset.extend(spans.iter().map(|&(a, b)| {
                    let mid = 0.5 * (a + b);
                    (a, b, left_edge(road, track, a, mid), left_edge(road, track, b, mid))
                }));
            }
            let id = -(lanes.len() as i32) - 1;
            let track_of = &road.lanes()[usize::from(track)];
            let kind = match track_of.kind {
                LaneKind::Driving => "driving",
                LaneKind::Entry => "entry",
                LaneKind::Exit => "exit",
                LaneKind::Shoulder => "shoulder",
            };
            let mut lane =
                plain_lane(id, kind, &width_spans(road, &spans, s_m, None, track), end_m - s_m);
            let before = ids_before.iter().find(|b| b.0 == track).map(|b| b.1);
            lane.predecessors.extend(before);
            if let (Some(before), Some(section)) = (before, sections.last_mut()) {
                let same = section.lanes.iter_mut().find(|l: &&mut Lane| l.id == before);
                same.into_iter().for_each(|l| l.successors.push(id));
            }
            lane.speed_limits = limits(road, track, s_m, end_m);
            lanes.push(lane);
            ids.push((track, id));
            inner = Some(track);
        }
        sections.push(LaneSection { s_m, end_m, lanes });
        ids_before = ids;
    }
    RoadRecord {
        id: "1".into(),
        name: road.name().into(),
        file_line: 0,
        length_m,
        junction: None,
        left_hand: false,
        predecessor: None,
        successor: None,
        plan: elements(road.line()),
        line: road.line().clone(),
        lane_offset: Cubics::from_spans(&offset, length_m),
        sections,
        speed_limits: Vec::new(),
        types: vec![(0.0, "motorway".into())],
        objects: road.objects().to_vec(),
    }
}

/// Limits of a track within a section, from the section's start.
fn limits(road: &Road, track: u16, s_m: f64, end_m: f64) -> Vec<(f64, f64)> {
    let own = road.lanes()[usize::from(track)].speed_limits.iter();
    let mut changes: Vec<f64> = own.chain(road.speed_limits()).map(|l| l.0).collect();
    changes.push(s_m);
    changes.retain(|s| *s >= s_m && *s < end_m - 1e-6);
    changes.sort_by(f64::total_cmp);
    let mut out: Vec<(f64, f64)> = Vec::new();
    for s in changes {
        let limit = road.lane_speed_limit_m_s(track, s);
        if out.last().is_none_or(|l| l.1 != limit) {
            out.push((s - s_m, limit));
        }
    }
    out
}

/// Spans of a section between which all edges are cubic.
fn spans(road: &Road, tracks: &[u16], from_m: f64, to_m: f64) -> Vec<(f64, f64)> {
    let tracks = tracks.iter().map(|&t| &road.lanes()[usize::from(t)]);
    let mut breaks: Vec<f64> = tracks
        .flat_map(|t| t.center.starts_m().iter().chain(t.width.starts_m()).copied())
        .filter(|s| *s > from_m + 1e-6 && *s < to_m - 1e-6)
        .collect();
    breaks.extend([from_m, to_m]);
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|b, a| *b - *a < 1e-6);
    breaks.windows(2).map(|w| (w[0], w[1])).collect()
}

fn edge(road: &Road, track: u16, side: f64, s_m: f64, inside_m: f64) -> (f64, f64) {
    let t = &road.lanes()[usize::from(track)];
    let (c, dc) = t.center.at_with_slope_in(s_m, inside_m);
    let (w, dw) = t.width.at_with_slope_in(s_m, inside_m);
    (c + side * 0.5 * w, dc + side * 0.5 * dw)
}

fn left_edge(road: &Road, track: u16, s_m: f64, inside_m: f64) -> (f64, f64) {
    edge(road, track, 1.0, s_m, inside_m)
}

/// Width from the right edge of `left` (or the track's own left edge) to the right edge of `right`,
/// for `left` given: to the left edge of `right`. Stations from the section's start.
fn width_spans(
    road: &Road,
    spans: &[(f64, f64)],
    section_m: f64,
    left: Option<u16>,
    right: u16,
) -> Vec<Span> {
    let width = |s: f64, mid: f64| {
        let (high, low) = match left {
            Some(left) => (edge(road, left, -1.0, s, mid), edge(road, right, 1.0, s, mid)),
            None => (edge(road, right, 1.0, s, mid), edge(road, right, -1.0, s, mid)),
        };
        (high.0 - low.0, high.1 - low.1)
    };
    spans
        .iter()
        .map(|&(a, b)| {
            let mid = 0.5 * (a + b);
            (a - section_m, b - section_m, width(a, mid), width(b, mid))
        })
        .collect()
}

fn plain_lane(id: i32, kind: &str, width: &[Span], length_m: f64) -> Lane {
    Lane {
        id,
        kind: kind.into(),
        outline: LaneOutline::Width(Cubics::from_spans(width, length_m)),
        predecessors: Vec::new(),
        successors: Vec::new(),
        speed_limits: Vec::new(),
    }
}
