//! Which road leads to which, and the choice of a way.

use std::collections::{BTreeMap, BTreeSet};

use super::model::{Contact, LaneSection, Link, Network, RoadRecord};
use crate::RoadError;

/// Direction of travel on a road.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Heading {
    /// Along s.
    Forward,
    /// Against s.
    Backward,
}

/// Which way to take.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RouteChoice {
    /// Road and direction to begin with; without it the best chain of the whole map is taken.
    pub start: Option<(String, Heading)>,
    /// Roads to take where the way forks.
    pub via: Vec<String>,
}

/// A road driven in one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Node {
    pub(super) road: usize,
    pub(super) heading: Heading,
}

/// A way on: the next node, and which lane leads to which.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Edge {
    pub(super) to: Node,
    pub(super) lanes: Vec<(i32, i32)>,
}

impl Node {
    pub(super) const fn is_forward(self) -> bool {
        matches!(self.heading, Heading::Forward)
    }

    const fn index(self) -> usize {
        2 * self.road + (!self.is_forward()) as usize
    }

    const fn of_index(i: usize) -> Self {
        let heading = if i.is_multiple_of(2) { Heading::Forward } else { Heading::Backward };
        Self { road: i / 2, heading }
    }

    /// The sections in the order in which they are driven.
    pub(super) fn sections(self, road: &RoadRecord) -> Vec<usize> {
        let n = road.sections.len();
        if self.is_forward() { (0..n).collect() } else { (0..n).rev().collect() }
    }
}

/// A road beside a road of the way: it leads from the same road to the same road. Map makers give
/// each lane of a junction a connecting road of its own.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Companion {
    pub(super) node: Node,
    /// (lane of the road before, lane of this).
    pub(super) from: Vec<(i32, i32)>,
    /// (lane of this, lane of the road after).
    pub(super) to: Vec<(i32, i32)>,
}

/// Lanes of a section that are driven in a direction, from right to left as driven.
pub(super) fn driven_lanes(road: &RoadRecord, section: &LaneSection, node: Node) -> Vec<i32> {
    let mut ids: Vec<i32> = section
        .lanes
        .iter()
        .filter(|l| road.driven_forward(l.id) == node.is_forward())
        .map(|l| l.id)
        .collect();
    // Sorted from left to right as seen along s.
    if node.is_forward() {
        ids.reverse();
    }
    ids
}

/// The directed graph of drivable roads.
pub(super) struct Graph<'a> {
    network: &'a Network,
    by_id: BTreeMap<&'a str, usize>,
    edges: Vec<Vec<Edge>>,
}

impl<'a> Graph<'a> {
    pub(super) fn new(network: &'a Network) -> Self {
        let by_id = network.roads.iter().enumerate().map(|(i, r)| (r.id.as_str(), i)).collect();
        let mut out = Self { network, by_id, edges: Vec::new() };
        out.edges =
            (0..2 * network.roads.len()).map(|i| out.find_edges(Node::of_index(i))).collect();
        out
    }

    pub(super) fn edges(&self, node: Node) -> &[Edge] {
        &self.edges[node.index()]
    }

    /// The companions of `node` on the way from `before` to `after`.
    pub(super) fn companions(&self, before: Node, node: Node, after: Node) -> Vec<Companion> {
        let beside = self.edges(before).iter().filter(|e| e.to.road != node.road);
        beside
            .filter(|e| self.road(e.to).junction.is_some())
            .filter_map(|e| {
                let on = self.edges(e.to).iter().find(|on| on.to == after)?;
                Some(Companion { node: e.to, from: e.lanes.clone(), to: on.lanes.clone() })
            })
            .collect()
    }

    fn road(&self, node: Node) -> &'a RoadRecord {
        &self.network.roads[node.road]
    }

    /// Every section has a drivable lane in this direction.
    fn is_drivable(&self, node: Node) -> bool {
        let road = self.road(node);
        road.sections.iter().all(|s| {
            s.lanes
                .iter()
                .any(|l| l.is_drivable() && road.driven_forward(l.id) == node.is_forward())
        })
    }

    fn find_edges(&self, node: Node) -> Vec<Edge> {
        if !self.is_drivable(node) {
            return Vec::new();
        }
        let road = self.road(node);
        let link = if node.is_forward() { &road.successor } else { &road.predecessor };
        let mut out = Vec::new();
        match link {
            None => {}
            Some(Link::Road { id, contact }) => {
                let lanes = self.linked_lanes(node);
                self.add(&mut out, node, id, *contact, &lanes);
            }
            Some(Link::Junction { id }) => {
                let junctions = self.network.junctions.iter().filter(|j| j.id == *id);
                let connections = junctions.flat_map(|j| &j.connections);
                for c in connections.filter(|c| c.incoming_road == road.id) {
                    self.add(&mut out, node, &c.connecting_road, c.contact, &c.lane_links);
                }
            }
        }
        out
    }

    /// Lane links at the end of a road, as its lanes state them.
    fn linked_lanes(&self, node: Node) -> Vec<(i32, i32)> {
        let road = self.road(node);
        let last = if node.is_forward() { road.sections.last() } else { road.sections.first() };
        last.into_iter()
            .flat_map(|s| &s.lanes)
            .flat_map(|l| {
                let to = if node.is_forward() { &l.successors } else { &l.predecessors };
                to.iter().map(|&to| (l.id, to))
            })
            .collect()
    }

    /// Adds the way to road `id`, if a drivable lane leads there. Without lane links, lanes of the
    /// same number are linked (OpenDRIVE 1.8, 12.3).
    fn add(
        &self,
        out: &mut Vec<Edge>,
        from: Node,
        id: &str,
        contact: Contact,
        links: &[(i32, i32)],
    ) {
        let Some(&road) = self.by_id.get(id) else { return };
        let heading = if contact == Contact::Start { Heading::Forward } else { Heading::Backward };
        let to = Node { road, heading };
        if !self.is_drivable(to) {
            return;
        }
        let (here, there) = (self.road(from), self.road(to));
        let exit = if from.is_forward() { here.sections.last() } else { here.sections.first() };
        let entry = if to.is_forward() { there.sections.first() } else { there.sections.last() };
        let (Some(exit), Some(entry)) = (exit, entry) else { return };
        let (out_lanes, in_lanes) =
            (driven_lanes(here, exit, from), driven_lanes(there, entry, to));
        let same: Vec<(i32, i32)>;
        let links = if links.is_empty() {
            let turn = if from.heading == to.heading { 1 } else { -1 };
            same = out_lanes.iter().map(|&l| (l, turn * l)).collect();
            &same
        } else {
            links
        };
        let drivable =
            |s: &LaneSection, id: i32| s.lanes.iter().any(|l| l.id == id && l.is_drivable());
        let lanes: Vec<(i32, i32)> = links
            .iter()
            .copied()
            .filter(|(a, b)| out_lanes.contains(a) && in_lanes.contains(b))
            .collect();
        if lanes.iter().any(|&(a, b)| drivable(exit, a) && drivable(entry, b)) {
            match out.iter_mut().find(|e| e.to == to) {
                Some(known) => known.lanes.extend(lanes),
                None => out.push(Edge { to, lanes }),
            }
        }
    }

    /// Length times through lanes: what makes a way the main one, lane metres.
    fn worth(&self, node: Node) -> f64 {
        let road = self.road(node);
        let lanes = |s: &LaneSection| {
            driven_lanes(road, s, node)
                .into_iter()
                .filter(|id| s.lanes.iter().any(|l| l.id == *id && l.is_drivable()))
                .count()
        };
        road.sections.iter().map(|s| (s.end_m - s.s_m).max(0.0) * lanes(s) as f64).sum()
    }

    /// Lane metres that can be driven from each node on; a way back into itself ends there.
    fn worth_ahead(&self) -> Vec<f64> {
        let n = self.edges.len();
        let mut ahead = vec![f64::NAN; n];
        let mut entered = vec![false; n];
        for root in 0..n {
            let mut stack = vec![root];
            while let Some(&i) = stack.last() {
                if !entered[i] {
                    entered[i] = true;
                    let next = self.edges[i].iter().map(|e| e.to.index()).filter(|&j| !entered[j]);
                    stack.extend(next);
                    continue;
                }
                stack.pop();
                if ahead[i].is_nan() {
                    let best = self.edges[i]
                        .iter()
                        .map(|e| ahead[e.to.index()])
                        .fold(0.0, |a: f64, b| if b > a { b } else { a });
                    ahead[i] = best + self.worth(Node::of_index(i));
                }
            }
        }
        ahead
    }

    /// The way: nodes in order, each with the lane links to the next.
    pub(super) fn way(&self, choice: &RouteChoice) -> Result<Vec<Edge>, RoadError> {
        let invalid = |why: String| RoadError::Invalid { name: self.network.name.clone(), why };
        let ahead = self.worth_ahead();
        if let Some((id, heading)) = &choice.start {
            let road = *self
                .by_id
                .get(id.as_str())
                .ok_or_else(|| invalid(format!("no road has the id {id:?}")))?;
            let start = Node { road, heading: *heading };
            if !self.is_drivable(start) {
                return Err(invalid(format!("road {id:?} has no lane driven {heading:?}")));
            }
            return Ok(self.follow(start, choice, &ahead));
        }
        let mut starts: Vec<usize> =
            (0..ahead.len()).filter(|&i| self.is_drivable(Node::of_index(i))).collect();
        starts.sort_by(|&a, &b| ahead[b].total_cmp(&ahead[a]));
        let ways =
            starts.into_iter().take(64).map(|i| self.follow(Node::of_index(i), choice, &ahead));
        let worth = |way: &Vec<Edge>| way.iter().map(|e| self.worth(e.to)).sum::<f64>();
        let mut best: Option<(f64, Vec<Edge>)> = None;
        for way in ways {
            let worth = worth(&way);
            if best.as_ref().is_none_or(|b| worth > b.0) {
                best = Some((worth, way));
            }
        }
        best.map(|b| b.1)
            .ok_or_else(|| invalid("no road can be driven along its whole length".into()))
    }

    /// Follows the most worthy way, no road twice. `lanes` of an edge lead to the *next* one.
    fn follow(&self, start: Node, choice: &RouteChoice, ahead: &[f64]) -> Vec<Edge> {
        let mut seen = BTreeSet::from([start.road]);
        let mut way = vec![Edge { to: start, lanes: Vec::new() }];
        let mut here = start;
        loop {
            let rank = |e: &&Edge| {
                let wanted = choice.via.contains(&self.road(e.to).id);
                (wanted, ahead[e.to.index()])
            };
            let next =
                self.edges(here).iter().filter(|e| !seen.contains(&e.to.road)).max_by(|a, b| {
                    let (a, b) = (rank(a), rank(b));
                    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
                });
            let Some(next) = next else { return way };
            if let Some(last) = way.last_mut() {
                last.lanes.clone_from(&next.lanes);
            }
            seen.insert(next.to.road);
            here = next.to;
            way.push(Edge { to: here, lanes: Vec::new() });
        }
    }
}
