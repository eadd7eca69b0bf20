//! The report of `map check`: what is in a map and where it is not continuous.

use std::collections::BTreeMap;

use serde::Serialize;

use super::graph::{Graph, Heading, Node};
use super::model::{LaneSection, Link, Network, RoadRecord};
use super::tracks::SHORTEST_SECTION_M;
use crate::{Finding, Placed};

/// Jumps above these are reported.
const POSITION_M: f64 = 0.01;
const HEADING_RAD: f64 = 0.01;
const ELEVATION_M: f64 = 0.01;
const SLOPE: f64 = 0.02;
/// At most this many jumps are listed, the largest of each kind first.
const LISTED: usize = 100;
/// Spacing of the samples for grade, bank and curvature, m.
const SAMPLE_M: f64 = 2.0;

/// What jumps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JumpKind {
    /// Position in plan view, m.
    PositionM,
    /// Heading, rad.
    HeadingRad,
    /// Height, m.
    ElevationM,
    /// Slope dz/ds.
    Slope,
    /// Stated length of a road against the sum of its elements, m.
    LengthM,
}

/// A place where the map is not continuous.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Jump {
    /// What jumps.
    pub kind: JumpKind,
    /// Size of the jump in the kind's unit.
    pub size: f64,
    /// Road id.
    pub road: String,
    /// Station on that road, m.
    pub s_m: f64,
    /// The road on the other side of a join between roads.
    pub to_road: Option<String>,
}

/// How often an element occurs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RecordCount {
    /// How often.
    pub count: usize,
    /// Line of the first.
    pub first_line: u32,
}

/// What is in a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapReport {
    /// The file.
    pub file: String,
    /// OpenDRIVE revision.
    pub revision: String,
    /// Number of roads.
    pub roads: usize,
    /// Number of junctions.
    pub junctions: usize,
    /// Length of all roads, m.
    pub length_m: f64,
    /// Lane sections times lanes, by type.
    pub lanes: BTreeMap<String, usize>,
    /// Length of all drivable lanes, m.
    pub drivable_lane_m: f64,
    /// Length of the route that is taken by default, m.
    pub route_length_m: Option<f64>,
    /// Lane tracks of that route.
    pub route_lanes: Option<usize>,
    /// What is odd about that route; a refused finding keeps it from being driven.
    pub findings: Vec<Finding>,
    /// Smallest and largest grade along s, rise over run.
    pub grade_frac: [f64; 2],
    /// Smallest and largest height, m.
    pub elevation_m: [f64; 2],
    /// Smallest and largest bank, rad.
    pub bank_rad: [f64; 2],
    /// Tightest radius of a reference line, m; `None` if all are straight.
    pub min_radius_m: Option<f64>,
    /// Smallest and largest speed limit, m/s; `None` without any.
    pub speed_limit_m_s: Option<[f64; 2]>,
    /// Number of jumps of each kind.
    pub jump_counts: BTreeMap<JumpKind, usize>,
    /// Largest jump of each kind.
    pub largest_jump: BTreeMap<JumpKind, f64>,
    /// The jumps, largest first, at most 100.
    pub jumps: Vec<Jump>,
    /// Links to roads or junctions that are not in the file.
    pub broken_links: Vec<String>,
    /// Elements that would change the surface and are not read.
    pub unsupported: BTreeMap<String, RecordCount>,
    /// Other elements that are not read.
    pub ignored: BTreeMap<String, RecordCount>,
    /// Objects and signals by type.
    pub objects: BTreeMap<String, usize>,
}

impl Network {
    /// Checks the map: contents, ranges, continuity.
    #[must_use]
    pub fn check(&self) -> MapReport {
        let mut jumps: Vec<Jump> = self.roads.iter().flat_map(jumps_inside).collect();
        jumps.extend(self.jumps_at_joins());
        let (mut jump_counts, mut largest_jump) = (BTreeMap::new(), BTreeMap::new());
        for j in &jumps {
            *jump_counts.entry(j.kind).or_insert(0) += 1;
            let largest = largest_jump.entry(j.kind).or_insert(0.0_f64);
            *largest = largest.max(j.size);
        }
        jumps.sort_by(|a, b| b.size.total_cmp(&a.size));
        jumps.truncate(LISTED);
        let ranges = Ranges::of(&self.roads);
        let route = self.longest_route().ok();
        let counts = |m: &BTreeMap<String, (usize, u32)>| {
            m.iter()
                .map(|(k, &(count, first_line))| (k.clone(), RecordCount { count, first_line }))
                .collect()
        };
        let (lanes, drivable_lane_m) = self.lane_totals();
        MapReport {
            file: self.name.clone(),
            revision: format!("{}.{}", self.header.rev_major, self.header.rev_minor),
            roads: self.roads.len(),
            junctions: self.junctions.len(),
            length_m: self.roads.iter().map(|r| r.length_m).sum(),
            lanes,
            drivable_lane_m,
            route_length_m: route.as_ref().map(crate::Road::length_m),
            route_lanes: route.as_ref().map(|r| r.lanes().len()),
            findings: route.as_ref().map(crate::Road::findings).unwrap_or_default(),
            grade_frac: ranges.grade,
            elevation_m: ranges.elevation,
            bank_rad: ranges.bank,
            min_radius_m: (ranges.curvature > 1e-9).then(|| 1.0 / ranges.curvature),
            speed_limit_m_s: self.speed_limit_range(),
            jump_counts,
            largest_jump,
            jumps,
            broken_links: self.broken_links(),
            unsupported: counts(&self.unsupported),
            ignored: counts(&self.ignored),
            objects: self.objects.clone(),
        }
    }

    fn lane_totals(&self) -> (BTreeMap<String, usize>, f64) {
        let (mut by_type, mut metres) = (BTreeMap::new(), 0.0);
        for section in self.roads.iter().flat_map(|r| &r.sections) {
            for lane in &section.lanes {
                *by_type.entry(lane.kind.clone()).or_insert(0) += 1;
                if lane.is_drivable() {
                    metres += (section.end_m - section.s_m).max(0.0);
                }
            }
        }
        (by_type, metres)
    }

    fn speed_limit_range(&self) -> Option<[f64; 2]> {
        let lanes = self.roads.iter().flat_map(|r| &r.sections).flat_map(|s| &s.lanes);
        let of_lanes = lanes.flat_map(|l| l.speed_limits.iter().map(|x| x.1));
        let of_roads = self.roads.iter().flat_map(|r| r.speed_limits.iter().map(|x| x.1));
        of_lanes.chain(of_roads).filter(|v| v.is_finite()).fold(None, |range, v| {
            let [low, high] = range.unwrap_or([v, v]);
            Some([f64::min(low, v), f64::max(high, v)])
        })
    }

    fn broken_links(&self) -> Vec<String> {
        let mut out = Vec::new();
        for r in &self.roads {
            for link in [&r.predecessor, &r.successor].into_iter().flatten() {
                let (what, id, known) = match link {
                    Link::Road { id, .. } => ("road", id, self.road(id).is_some()),
                    Link::Junction { id } => {
                        ("junction", id, self.junctions.iter().any(|j| j.id == *id))
                    }
                };
                if !known {
                    out.push(format!("road {} (line {}): no {what} {id}", r.id, r.file_line));
                }
            }
        }
        for j in &self.junctions {
            let named = j.connections.iter().flat_map(|c| [&c.incoming_road, &c.connecting_road]);
            for id in named.filter(|id| self.road(id).is_none()) {
                out.push(format!("junction {} (line {}): no road {id}", j.id, j.file_line));
            }
        }
        out
    }

    /// Compares the centres of linked lanes on both sides of every join.
    fn jumps_at_joins(&self) -> Vec<Jump> {
        let graph = Graph::new(self);
        let mut out = Vec::new();
        for road in 0..self.roads.len() {
            for heading in [Heading::Forward, Heading::Backward] {
                let from = Node { road, heading };
                for edge in graph.edges(from) {
                    for &(a, b) in &edge.lanes {
                        let ends = (self.lane_end(from, a, true), self.lane_end(edge.to, b, false));
                        if let (Some(p), Some(q)) = ends {
                            let to = Some(self.roads[edge.to.road].id.clone());
                            compare(&p, &q, &self.roads[road].id, to, &mut out);
                        }
                    }
                }
            }
        }
        out
    }

    /// Pose of a lane's centre at the end (or beginning) of a road as driven.
    fn lane_end(&self, node: Node, lane: i32, at_end: bool) -> Option<Pose> {
        let road = &self.roads[node.road];
        let last = node.is_forward() == at_end;
        let long = |x: &&LaneSection| x.end_m - x.s_m > SHORTEST_SECTION_M;
        let section = if last {
            road.sections.iter().rfind(long)?
        } else {
            road.sections.iter().find(long)?
        };
        let s = if last { road.line.length_m() } else { 0.0 };
        let inside = if last { s - SHORTEST_SECTION_M } else { SHORTEST_SECTION_M };
        let e = road.edges_in(section, lane, s, inside)?;
        let (t, dt) = (0.5 * (e.inner.0 + e.outer.0), 0.5 * (e.inner.1 + e.outer.1));
        let k = road.line.at(s);
        let turned = if node.is_forward() { 0.0 } else { core::f64::consts::PI };
        let (sin, cos) = libm::sincos(k.heading_rad);
        let (sin_bank, cos_bank) = libm::sincos(k.bank_rad);
        Some(Pose {
            s_m: s,
            x_m: k.x_m - t * cos_bank * sin,
            y_m: k.y_m + t * cos_bank * cos,
            z_m: k.z_m + t * sin_bank,
            heading_rad: k.heading_rad + libm::atan(dt) + turned,
            slope: if node.is_forward() { k.slope } else { -k.slope },
        })
    }
}

struct Pose {
    s_m: f64,
    x_m: f64,
    y_m: f64,
    z_m: f64,
    heading_rad: f64,
    slope: f64,
}

fn compare(p: &Pose, q: &Pose, road: &str, to_road: Option<String>, out: &mut Vec<Jump>) {
    let turn = libm::remainder(p.heading_rad - q.heading_rad, core::f64::consts::TAU);
    let sizes = [
        (JumpKind::PositionM, libm::hypot(p.x_m - q.x_m, p.y_m - q.y_m), POSITION_M),
        (JumpKind::HeadingRad, turn.abs(), HEADING_RAD),
        (JumpKind::ElevationM, (p.z_m - q.z_m).abs(), ELEVATION_M),
        (JumpKind::Slope, (p.slope - q.slope).abs(), SLOPE),
    ];
    for (kind, size, limit) in sizes {
        if size > limit {
            out.push(Jump { kind, size, road: road.into(), s_m: p.s_m, to_road: to_road.clone() });
        }
    }
}

/// Jumps between the elements and records of one road.
fn jumps_inside(road: &RoadRecord) -> Vec<Jump> {
    let mut out = Vec::new();
    let flat = |e: &Placed, ds: f64| {
        let jet = e.at(ds);
        let [x_m, y_m] = jet.point;
        Pose { s_m: e.s_m + ds, x_m, y_m, z_m: 0.0, heading_rad: jet.heading_rad(), slope: 0.0 }
    };
    for w in road.plan.windows(2) {
        compare(&flat(&w[0], w[0].length_m), &flat(&w[1], 0.0), &road.id, None, &mut out);
    }
    let stated: f64 = road.plan.iter().map(|e| e.length_m).sum();
    if (stated - road.length_m).abs() > POSITION_M {
        let (kind, size) = (JumpKind::LengthM, (stated - road.length_m).abs());
        out.push(Jump { kind, size, road: road.id.clone(), s_m: stated, to_road: None });
    }
    let height = |s: f64, inside: f64| {
        let (z_m, slope) = road.line.elevation().at_with_slope_in(s, inside);
        Pose { s_m: s, x_m: 0.0, y_m: 0.0, z_m, heading_rad: 0.0, slope }
    };
    for &s in road.line.elevation().starts_m().iter().skip(1).filter(|s| **s < road.length_m) {
        compare(&height(s, s - 1e-6), &height(s, s + 1e-6), &road.id, None, &mut out);
    }
    out
}

/// Ranges over all reference lines.
struct Ranges {
    grade: [f64; 2],
    elevation: [f64; 2],
    bank: [f64; 2],
    curvature: f64,
}

impl Ranges {
    fn of(roads: &[RoadRecord]) -> Self {
        let none = [f64::MAX, f64::MIN];
        let mut out = Self { grade: none, elevation: none, bank: none, curvature: 0.0 };
        let widen = |r: &mut [f64; 2], v: f64| *r = [r[0].min(v), r[1].max(v)];
        for line in roads.iter().map(|r| &r.line) {
            let steps = libm::ceil(line.length_m() / SAMPLE_M) as usize;
            for i in 0..=steps {
                let k = line.at(i as f64 * SAMPLE_M);
                widen(&mut out.grade, k.slope);
                widen(&mut out.elevation, k.z_m);
                widen(&mut out.bank, k.bank_rad);
                out.curvature = out.curvature.max(k.curvature_1_m.abs());
            }
        }
        out
    }
}
