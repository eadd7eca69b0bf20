//! Queries over the whole network: nearest lane, adjacency.

use super::model::{Lane, Network, RoadRecord};

/// A position in the network.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkPosition {
    /// Index in [`Network::roads`].
    pub road: usize,
    /// Index of the lane section.
    pub section: usize,
    /// Lane id.
    pub lane: i32,
    /// Station on that road, m.
    pub s_m: f64,
    /// Offset from its reference line, m, positive left.
    pub t_m: f64,
    /// Distance outside the lane's edges in plan view, m; 0 inside.
    pub outside_m: f64,
}

impl Network {
    /// A road by its id.
    #[must_use]
    pub fn road(&self, id: &str) -> Option<&RoadRecord> {
        self.roads.iter().find(|r| r.id == id)
    }

    /// The drivable lane nearest to a map point; inside several (in a junction), the one whose
    /// centre is nearest. `None` if no lane is within 200 m.
    #[must_use]
    pub fn nearest_lane(&self, x_m: f64, y_m: f64) -> Option<NetworkPosition> {
        let mut best: Option<((f64, f64), NetworkPosition)> = None;
        for (index, road) in self.roads.iter().enumerate() {
            let Some((s_m, across)) = road.line.project(x_m, y_m, None) else { continue };
            let k = road.line.at(s_m);
            let beyond = libm::hypot(x_m - k.x_m, y_m - k.y_m);
            let along = libm::sqrt((beyond * beyond - across * across).max(0.0));
            let t_m = across / libm::cos(k.bank_rad);
            let section = road.section_at(s_m);
            for lane in road.sections[section].lanes.iter().filter(|l| l.is_drivable()) {
                let Some((inner, outer)) = road.lane_edges_m(section, lane.id, s_m) else {
                    continue;
                };
                let (low, high) = (inner.min(outer), inner.max(outer));
                let beside = (low - t_m).max(t_m - high).max(0.0);
                let outside_m = libm::hypot(beside, along);
                let rank = (outside_m, (t_m - 0.5 * (low + high)).abs());
                if best.as_ref().is_none_or(|b| rank < b.0) {
                    let lane = lane.id;
                    let at = NetworkPosition { road: index, section, lane, s_m, t_m, outside_m };
                    best = Some((rank, at));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// The lanes next to a lane in its section: (left, right) as driven. Lanes driven the other way
    /// or not drivable are no neighbours.
    #[must_use]
    pub fn neighbours(&self, at: &NetworkPosition) -> (Option<i32>, Option<i32>) {
        let Some(road) = self.roads.get(at.road) else { return (None, None) };
        let Some(section) = road.sections.get(at.section) else { return (None, None) };
        let Some(i) = section.lanes.iter().position(|l| l.id == at.lane) else {
            return (None, None);
        };
        let same_way = |l: &&Lane| {
            l.is_drivable() && road.driven_forward(l.id) == road.driven_forward(at.lane)
        };
        let lane = |i: Option<usize>| i.and_then(|i| section.lanes.get(i)).filter(same_way);
        let (left, right) = (lane(i.checked_sub(1)).map(|l| l.id), lane(Some(i + 1)).map(|l| l.id));
        if road.driven_forward(at.lane) { (left, right) } else { (right, left) }
    }
}
