//! A way through the network as one [`Road`].
//!
//! The road's reference line is the map's reference line where roads follow each other. Where the
//! next road's reference line lies beside the end of this one (ramps, connecting roads), the road
//! continues on a parallel curve of the next reference line, so that station and offset stay
//! continuous: with `e` the offset of the parallel curve, `dS = (1 - κ e) ds` and
//! `κ_S = κ/(1 - κ e)`. Roads driven against their s are turned round.

use super::graph::{Companion, Edge, Graph, Node, RouteChoice};
use super::model::{Network, RoadRecord};
use super::tracks;
use crate::bake::Baker;
use crate::{Cubics, Jet, LaneKind, Road, RoadError, RoadObject};

/// Reference lines nearer to each other than this are taken for the same, m.
const SAME_LINE_M: f64 = 1e-3;
/// A parallel curve is used only where it keeps this share of its length.
const LEAST_SHARE: f64 = 0.2;

/// One road of the way, with its place on the result.
pub(super) struct Leg<'a> {
    pub(super) road: &'a RoadRecord,
    pub(super) node: Node,
    /// The result's reference line in the road's own t, m.
    pub(super) offset_m: f64,
    /// Links from this leg's lanes to the next leg's.
    pub(super) lanes: Vec<(i32, i32)>,
    /// Roads beside this one in a junction.
    pub(super) companions: Vec<Companion>,
    /// (station on the road, station on the result) at the joints, in driven order.
    stations: Vec<(f64, f64)>,
}

impl Leg<'_> {
    /// +1 if driven along s, else -1.
    pub(super) const fn sign(&self) -> f64 {
        if self.node.is_forward() { 1.0 } else { -1.0 }
    }

    /// Station on the result of a station on the road.
    pub(super) fn station_m(&self, s_m: f64) -> f64 {
        let driven = |s: f64| self.sign() * s;
        let i = self.stations.partition_point(|p| driven(p.0) <= driven(s_m)).max(1) - 1;
        let Some(&(a, start_m)) = self.stations.get(i) else { return 0.0 };
        let Some(&(b, end_m)) = self.stations.get(i + 1) else { return start_m };
        if self.offset_m == 0.0 {
            return start_m + driven(s_m - a);
        }
        let line = &self.road.line;
        let mid = 0.5 * (a + b);
        let turned = line.at_in(s_m, mid).heading_rad - line.at_in(a, mid).heading_rad;
        let exact = start_m + self.sign() * ((s_m - a) - self.offset_m * turned);
        exact.clamp(start_m, end_m)
    }

    /// Stations on the road between which everything on the result is cubic to the eye.
    pub(super) fn joints_m(&self) -> impl Iterator<Item = f64> + '_ {
        let parallel = self.offset_m != 0.0;
        self.stations.iter().map(|p| p.0).filter(move |_| parallel)
    }

    /// Metres of result per metre of road, by the piece that holds `inside_m`.
    pub(super) fn stretch(&self, s_m: f64, inside_m: f64) -> f64 {
        if self.offset_m == 0.0 {
            return 1.0;
        }
        1.0 - self.road.line.at_in(s_m, inside_m).curvature_1_m * self.offset_m
    }

    /// Station on the result at which the leg begins.
    pub(super) fn start_m(&self) -> f64 {
        self.stations.first().map_or(0.0, |p| p.1)
    }

    /// Station on the result at which the leg ends.
    pub(super) fn end_m(&self) -> f64 {
        self.stations.last().map_or(0.0, |p| p.1)
    }
}

impl Network {
    /// The best chain of the map: most lane metres, no road twice.
    ///
    /// # Errors
    /// [`RoadError::Invalid`] if nothing can be driven.
    pub fn longest_route(&self) -> Result<Road, RoadError> {
        self.route(&RouteChoice::default())
    }

    /// The way that `choice` describes, as a road.
    ///
    /// # Errors
    /// [`RoadError::Invalid`] if the start is unknown or cannot be driven.
    pub fn route(&self, choice: &RouteChoice) -> Result<Road, RoadError> {
        let graph = Graph::new(self);
        let way = graph.way(choice)?;
        let mut baker = Baker::default();
        let mut legs: Vec<Leg<'_>> = Vec::with_capacity(way.len());
        for (i, Edge { to: node, lanes }) in way.iter().enumerate() {
            let (node, lanes) = (*node, lanes.clone());
            let around = i.checked_sub(1).and_then(|j| Some((way.get(j)?.to, way.get(i + 1)?.to)));
            let companions = around.map_or_else(Vec::new, |(a, b)| graph.companions(a, node, b));
            let road = &self.roads[node.road];
            let offset_m = baker.end_point().map_or(0.0, |p| parallel_offset(road, node, p));
            let mut leg = Leg { road, node, offset_m, lanes, companions, stations: Vec::new() };
            push_leg(&mut baker, &mut leg);
            legs.push(leg);
        }
        let (elevation, bank) = heights(&legs, baker.length_m());
        let line = baker.finish(elevation, bank);
        let tracks = tracks::build(self, &legs, &line);
        if tracks.is_empty() {
            let why = "the way has no lane".into();
            return Err(RoadError::Invalid { name: self.name.clone(), why });
        }
        let limits = limits(&tracks, line.length_m());
        let objects = legs.iter().flat_map(objects).collect();
        let road = Road::new(&self.name, line, tracks, limits)?.with_objects(objects);
        Ok(road.with_geo_reference(&self.header.geo_reference))
    }
}

/// t of a point at the beginning of a road as driven; 0 where the parallel curve would degenerate.
fn parallel_offset(road: &RoadRecord, node: Node, [x, y]: [f64; 2]) -> f64 {
    let k = road.line.at(if node.is_forward() { 0.0 } else { road.line.length_m() });
    let (sin, cos) = libm::sincos(k.heading_rad);
    let t = (y - k.y_m) * cos - (x - k.x_m) * sin;
    let tightest = road.line.joints_m().map(|s| road.line.at(s).curvature_1_m * t);
    let share = 1.0 - tightest.fold(0.0, f64::max);
    if t.abs() < SAME_LINE_M || share < LEAST_SHARE { 0.0 } else { t }
}

/// Appends the road's reference line, offset and turned as driven.
fn push_leg(baker: &mut Baker, leg: &mut Leg<'_>) {
    let (e, sign) = (leg.offset_m, leg.sign());
    let mut cells = leg.road.line.cells_with_jets();
    if sign < 0.0 {
        cells.reverse();
    }
    let moved = |jet: &Jet| {
        let kappa = jet.curvature_1_m();
        let speed = libm::hypot(jet.first[0], jet.first[1]);
        let normal = [-jet.first[1] / speed, jet.first[0] / speed];
        let share = if e == 0.0 { 1.0 } else { 1.0 - kappa * e };
        let bend = kappa * speed * speed / share;
        let along = (jet.second[0] * jet.first[0] + jet.second[1] * jet.first[1]) / (speed * speed);
        Jet {
            point: [jet.point[0] + e * normal[0], jet.point[1] + e * normal[1]],
            first: [sign * jet.first[0], sign * jet.first[1]],
            second: [
                bend * normal[0] + along * jet.first[0],
                bend * normal[1] + along * jet.first[1],
            ],
        }
    };
    for (a, b, start, end) in cells {
        let turned = if e == 0.0 {
            0.0
        } else {
            libm::remainder(end.heading_rad() - start.heading_rad(), core::f64::consts::TAU)
        };
        let length = ((b - a) - e * turned).max(1e-6);
        let (from, to) = if sign > 0.0 { (start, end) } else { (end, start) };
        let (from_s, to_s) = if sign > 0.0 { (a, b) } else { (b, a) };
        if leg.stations.is_empty() {
            leg.stations.push((from_s, baker.length_m()));
        }
        baker.push_between(length, &moved(&from), &moved(&to));
        leg.stations.push((to_s, baker.length_m()));
    }
}

/// Height and bank along the whole way.
fn heights(legs: &[Leg<'_>], length_m: f64) -> (Cubics, Cubics) {
    let (mut z, mut bank) = (Vec::new(), Vec::new());
    for leg in legs {
        let line = &leg.road.line;
        let sign = leg.sign();
        let records = line.elevation().starts_m().iter().chain(line.bank().starts_m()).copied();
        for (a, b) in spans(leg, 0.0, line.length_m(), records.chain(leg.joints_m()).collect()) {
            let mid = 0.5 * (a + b);
            let at = |s: f64| {
                let (z, dz) = line.elevation().at_with_slope_in(s, mid);
                let (bank, dbank) = line.bank().at_with_slope_in(s, mid);
                let (sin, cos) = libm::sincos(bank);
                let per_m = sign / leg.stretch(s, mid);
                let height = (z + leg.offset_m * sin, (dz + leg.offset_m * cos * dbank) * per_m);
                (height, (sign * bank, sign * dbank * per_m))
            };
            let ((z0, bank0), (z1, bank1)) = (at(a), at(b));
            let (s0, s1) = (leg.station_m(a), leg.station_m(b));
            z.push((s0, s1, z0, z1));
            bank.push((s0, s1, bank0, bank1));
        }
    }
    (Cubics::from_spans(&z, length_m), Cubics::from_spans(&bank, length_m))
}

/// The spans between breakpoints of a stretch of road, in driven order.
pub(super) fn spans(
    leg: &Leg<'_>,
    from_m: f64,
    to_m: f64,
    mut breaks: Vec<f64>,
) -> Vec<(f64, f64)> {
    breaks.retain(|s| *s > from_m + 1e-6 && *s < to_m - 1e-6);
    breaks.extend([from_m, to_m]);
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|b, a| *b - *a < 1e-6);
    let mut out: Vec<(f64, f64)> = breaks.windows(2).map(|w| (w[0], w[1])).collect();
    if leg.sign() < 0.0 {
        out = out.into_iter().rev().map(|(a, b)| (b, a)).collect();
    }
    out
}

/// The road's limit: the highest that a through lane allows (any drivable lane without one).
fn limits(tracks: &[crate::LaneTrack], length_m: f64) -> Vec<(f64, f64)> {
    let mut changes: Vec<f64> = tracks
        .iter()
        .flat_map(|t| t.speed_limits.iter().map(|l| l.0).chain([t.s_start_m, t.s_end_m]))
        .filter(|s| *s < length_m - 1e-6)
        .collect();
    changes.push(0.0);
    changes.sort_by(f64::total_cmp);
    changes.dedup_by(|b, a| *b - *a < 1e-6);
    let mut out: Vec<(f64, f64)> = Vec::new();
    for s in changes {
        let at = s + 1e-5;
        let highest = |through: bool| {
            tracks
                .iter()
                .filter(|t| t.exists_at(at) && t.kind != LaneKind::Shoulder)
                .filter(|t| !through || t.kind == LaneKind::Driving)
                .filter_map(|t| t.own_speed_limit_m_s(at))
                .reduce(f64::max)
        };
        let limit = highest(true).or_else(|| highest(false)).unwrap_or(f64::INFINITY);
        if out.last().is_none_or(|l| l.1 != limit) {
            out.push((s, limit));
        }
    }
    out
}

fn objects<'a>(leg: &'a Leg<'a>) -> impl Iterator<Item = RoadObject> + 'a {
    let length = leg.road.line.length_m();
    leg.road.objects.iter().map(move |o| {
        let at = |s: f64| leg.station_m(s.clamp(0.0, length));
        let (a, b) = (at(o.s_start_m), at(o.s_end_m));
        RoadObject { s_start_m: a.min(b), s_end_m: a.max(b), ..o.clone() }
    })
}
