//! Lanes of a way joined into continuous tracks.

use super::companions::{self, Part};
use super::graph::driven_lanes;
use super::model::{Lane, LaneSection, LaneUse, Link, Network};
use super::route::{Leg, spans};
use crate::cubics::Span;
use crate::{Cubics, LaneEnd, LaneKind, LaneSource, LaneTrack, Line};

/// A lane that is nowhere wider than this is left out, m.
const LEAST_WIDTH_M: f64 = 0.05;

/// Shorter sections only pass their lanes on, m.
pub(super) const SHORTEST_SECTION_M: f64 = 1e-3;

/// A track that is still growing.
struct Growing {
    start_m: f64,
    end_m: f64,
    center: Vec<Span>,
    width: Vec<Span>,
    /// Metres per kind: driving, entry, exit, shoulder.
    metres: [f64; 4],
    limits: Vec<(f64, f64)>,
    sources: Vec<LaneSource>,
    end: LaneEnd,
}

/// A lane of a road: (index of the road, lane id).
type Key = (usize, i32);

/// Tracks in the order of their start, right to left where they start together.
pub(super) fn build(network: &Network, legs: &[Leg<'_>], line: &Line) -> Vec<LaneTrack> {
    let mut done: Vec<Growing> = Vec::new();
    // Tracks that go on, by the lane that they are on.
    let mut open: Vec<(Key, Growing)> = Vec::new();
    for (i, leg) in legs.iter().enumerate() {
        let before = i.checked_sub(1).map(|j| &legs[j]);
        let order = leg.node.sections(leg.road);
        let mut beside: Vec<(Key, Growing)> = Vec::new();
        for (k, &section) in order.iter().enumerate() {
            let section = &leg.road.sections[section];
            let links = if k == 0 {
                before.map_or_else(Vec::new, |before| join_links(before, leg))
            } else {
                section_links(leg, &leg.road.sections[order[k - 1]])
            };
            let mut waiting = core::mem::take(&mut open);
            let mut grown = |key: Key| {
                let froms = links.iter().filter(|l| l.1 == key).map(|l| l.0);
                let found =
                    froms.filter_map(|from| waiting.iter().position(|w| w.0 == from)).next();
                found.map(|w| waiting.remove(w).1)
            };
            for id in driven_lanes(leg.road, section, leg.node) {
                let Some(lane) = section.lanes.iter().find(|l| l.id == id) else { continue };
                if lane.usage() == LaneUse::Other {
                    continue;
                }
                let key = (leg.node.road, id);
                let track = extend(leg, section, lane, grown(key), &mut done);
                open.extend(track.map(|t| (key, t)));
            }
            if k == 0 {
                for companion in &leg.companions {
                    for part in companions::parts(network, leg, companion, line) {
                        let key = (companion.node.road, part.lane);
                        let mut track = grown(key).unwrap_or_else(|| Growing::at(leg.start_m()));
                        track.append(part);
                        beside.push((key, track));
                    }
                }
            }
            let ended_on = if k == 0 { before } else { None };
            for ((_, id), mut track) in waiting {
                track.end = ending(ended_on.unwrap_or(leg), id, k == 0, &track);
                done.push(track);
            }
        }
        open.append(&mut beside);
    }
    done.extend(open.into_iter().map(|(_, mut t)| {
        t.end = LaneEnd::Continues;
        t
    }));
    finish(done, line.length_m())
}

/// Links from the lanes of one leg (and of the roads beside it) to those of the next.
fn join_links(before: &Leg<'_>, leg: &Leg<'_>) -> Vec<(Key, Key)> {
    let (from, to) = (before.node.road, leg.node.road);
    let mut out: Vec<(Key, Key)> =
        before.lanes.iter().map(|&(a, b)| ((from, a), (to, b))).collect();
    for c in &leg.companions {
        out.extend(c.from.iter().map(|&(a, b)| ((from, a), (c.node.road, b))));
    }
    for c in &before.companions {
        out.extend(c.to.iter().map(|&(a, b)| ((c.node.road, a), (to, b))));
    }
    out
}

/// Lane links between two sections of one road, in driven order; by number if none is written.
fn section_links(leg: &Leg<'_>, before: &LaneSection) -> Vec<(Key, Key)> {
    let to = |l: &Lane| {
        if leg.node.is_forward() { l.successors.clone() } else { l.predecessors.clone() }
    };
    let links: Vec<(i32, i32)> =
        before.lanes.iter().flat_map(|l| to(l).into_iter().map(|t| (l.id, t))).collect();
    let road = leg.node.road;
    if links.is_empty() {
        before.lanes.iter().map(|l| ((road, l.id), (road, l.id))).collect()
    } else {
        links.into_iter().map(|(a, b)| ((road, a), (road, b))).collect()
    }
}

/// What happens to a lane that has no successor on the way.
fn ending(leg: &Leg<'_>, lane: i32, at_road_end: bool, track: &Growing) -> LaneEnd {
    let link = if leg.node.is_forward() { &leg.road.successor } else { &leg.road.predecessor };
    let elsewhere = at_road_end
        && matches!(link, Some(Link::Junction { .. }))
        && !leg.lanes.iter().any(|l| l.0 == lane);
    if elsewhere || track.kind() == LaneKind::Exit { LaneEnd::Leaves } else { LaneEnd::Drops }
}

/// Appends one lane of one section to a track, or begins one. A lane without width ends it.
fn extend(
    leg: &Leg<'_>,
    section: &LaneSection,
    lane: &Lane,
    grown: Option<Growing>,
    done: &mut Vec<Growing>,
) -> Option<Growing> {
    let road_end = leg.road.line.length_m();
    let (from, to) = (section.s_m.clamp(0.0, road_end), section.end_m.clamp(0.0, road_end));
    if to - from < SHORTEST_SECTION_M {
        return grown;
    }
    let mut breaks = leg.road.breaks_in(section, from, to);
    breaks.extend(leg.joints_m());
    let (mut center, mut width): (Vec<Span>, Vec<Span>) = (Vec::new(), Vec::new());
    for (a, b) in spans(leg, from, to, breaks) {
        let mid = 0.5 * (a + b);
        let at = |s: f64| {
            let e = leg.road.edges_in(section, lane.id, s, mid)?;
            let per_m = 1.0 / leg.stretch(s, mid);
            let side = f64::from(lane.id.signum());
            let centre = 0.5 * (e.inner.0 + e.outer.0) - leg.offset_m;
            let slope = 0.5 * (e.inner.1 + e.outer.1);
            Some((
                (leg.sign() * centre, slope * per_m),
                (
                    side * (e.outer.0 - e.inner.0),
                    leg.sign() * side * (e.outer.1 - e.inner.1) * per_m,
                ),
            ))
        };
        let (Some((c0, w0)), Some((c1, w1))) = (at(a), at(b)) else { continue };
        let (s0, s1) = (leg.station_m(a), leg.station_m(b));
        center.push((s0, s1, c0, c1));
        width.push((s0, s1, w0, w1));
    }
    let (Some(first), Some(last)) = (center.first(), center.last()) else {
        done.extend(grown);
        return None;
    };
    let (start_m, end_m) = (first.0, last.1);
    let widest = width.iter().map(|w| w.2.0.max(w.3.0)).fold(0.0, f64::max);
    if widest < LEAST_WIDTH_M {
        done.extend(grown);
        return None;
    }
    let mut track = grown.unwrap_or_else(|| Growing::at(start_m));
    track.end_m = end_m;
    track.center.extend(center);
    track.width.extend(width);
    track.metres[kind_index(lane.usage())] += end_m - start_m;
    track.add_limits(leg, section, lane, from, to);
    track.sources.push(LaneSource {
        s_start_m: start_m,
        road: leg.road.id.clone(),
        lane: lane.id,
        road_s_m: if leg.node.is_forward() { from } else { to },
        reversed: !leg.node.is_forward(),
    });
    Some(track)
}

const fn kind_index(usage: LaneUse) -> usize {
    match usage {
        LaneUse::Driving | LaneUse::Other => 0,
        LaneUse::Entry => 1,
        LaneUse::Exit => 2,
        LaneUse::Shoulder => 3,
    }
}

impl Growing {
    const fn at(start_m: f64) -> Self {
        Self {
            start_m,
            end_m: start_m,
            center: Vec::new(),
            width: Vec::new(),
            metres: [0.0; 4],
            limits: Vec::new(),
            sources: Vec::new(),
            end: LaneEnd::Drops,
        }
    }

    fn append(&mut self, part: Part) {
        let end_m = part.center.last().map_or(self.end_m, |s| s.1);
        self.metres[kind_index(part.usage)] += end_m - part.source.s_start_m;
        self.end_m = end_m;
        self.center.extend(part.center);
        self.width.extend(part.width);
        if part.limit_m_s.is_some() || !self.limits.is_empty() {
            let limit = part.limit_m_s.unwrap_or(f64::INFINITY);
            if self.limits.last().is_none_or(|l| l.1 != limit) {
                self.limits.push((part.source.s_start_m, limit));
            }
        }
        self.sources.push(part.source);
    }

    /// What the track is for most of its length.
    fn kind(&self) -> LaneKind {
        let kinds = [LaneKind::Driving, LaneKind::Entry, LaneKind::Exit, LaneKind::Shoulder];
        let mut best = 0;
        for i in 1..4 {
            if self.metres[i] > self.metres[best] {
                best = i;
            }
        }
        kinds[best]
    }

    fn add_limits(
        &mut self,
        leg: &Leg<'_>,
        section: &LaneSection,
        lane: &Lane,
        from: f64,
        to: f64,
    ) {
        let own = lane.speed_limits.iter().map(|l| l.0 + section.s_m);
        let changes = own.chain(leg.road.speed_limits.iter().map(|l| l.0)).collect();
        for (a, b) in spans(leg, from, to, changes) {
            let limit = leg.road.lane_limit_m_s(section, lane, 0.5 * (a + b));
            let known = self.limits.last().map(|l| l.1);
            let limit = match (limit, known) {
                (None, None) => continue,
                (limit, _) => limit.unwrap_or(f64::INFINITY),
            };
            if known != Some(limit) {
                self.limits.push((leg.station_m(a), limit));
            }
        }
    }
}

fn finish(mut grown: Vec<Growing>, length_m: f64) -> Vec<LaneTrack> {
    let start_center = |t: &Growing| t.center.first().map_or(0.0, |c| c.2.0);
    grown.sort_by(|a, b| {
        a.start_m.total_cmp(&b.start_m).then(start_center(a).total_cmp(&start_center(b)))
    });
    grown.truncate(usize::from(u16::MAX));
    let numbered = (0_u16..).zip(grown);
    numbered
        .map(|(id, t)| LaneTrack {
            id,
            s_start_m: t.start_m,
            s_end_m: if t.end_m > length_m - 1e-6 { length_m } else { t.end_m },
            kind: t.kind(),
            end: t.end,
            center: Cubics::from_spans(&t.center, t.end_m),
            width: Cubics::from_spans(&t.width, t.end_m),
            speed_limits: t.limits,
            sources: t.sources,
        })
        .collect()
}
