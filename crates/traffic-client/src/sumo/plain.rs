//! Our road as netconvert's plain input: nodes, edges with explicit lanes, connections.
//!
//! netconvert's own OpenDRIVE import was tried first and given up: it reads a step of `laneOffset`
//! at a lane section as a slope over one sample (lanes up to 1.7 m off for some metres), it loses
//! connections where a lane's speed limit changes, refuses direct junctions and ignores the limits
//! of road types. Here every OpenDRIVE road that we read gets into SUMO with the lanes where we have
//! them.
//!
//! The road is cut where a lane begins, ends, meets or leaves its neighbours or changes its limit,
//! and at least every [`LONGEST_M`] (SUMO walks polylines linearly). In each stretch, lanes that
//! touch make one edge. Lanes are named by the parameter `origId`, the index of our lane track.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use road::{LaneKind, Road};

/// Longest edge, m.
const LONGEST_M: f64 = 1000.0;
/// Spacing at which neighbourhood is looked at, m.
const LOOK_M: f64 = 10.0;
/// Spacing of the points of a lane, m.
const POINT_M: f64 = 10.0;
/// Cuts closer than this are one, m.
const SAME_M: f64 = 15.0;
/// Speed where there is no limit, m/s.
const NO_LIMIT_M_S: f64 = 70.0;

/// The three files.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Plain {
    pub(crate) nodes: String,
    pub(crate) edges: String,
    pub(crate) connections: String,
}

/// Lanes that touch, over one stretch: one edge.
struct Group {
    from_m: f64,
    to_m: f64,
    /// Tracks from right to left.
    tracks: Vec<u16>,
}

/// Writes the road, with further cuts at these stations, m.
pub(crate) fn plain(road: &Road, further_m: &[f64]) -> Plain {
    let cuts = cuts(road, further_m);
    let stretches: Vec<Vec<Group>> =
        cuts.windows(2).map(|w| groups(road, w.first(), w.last())).collect();
    let mut out = Plain {
        nodes: "<nodes>\n".to_owned(),
        edges: "<edges>\n".to_owned(),
        connections: "<connections>\n".to_owned(),
    };
    // Node at the start of each group of the stretch at hand; filled from the groups before.
    let mut starts: Vec<Option<String>> = Vec::new();
    for (k, groups) in stretches.iter().enumerate() {
        let next = stretches.get(k + 1).map(Vec::as_slice).unwrap_or_default();
        let mut next_starts: Vec<Option<String>> = vec![None; next.len()];
        for (g, group) in groups.iter().enumerate() {
            let start = match starts.get(g).cloned().flatten() {
                Some(node) => node,
                None => out.node(road, &format!("n{k}_{g}"), group, group.from_m),
            };
            // Groups that the tracks go on in share one node with all that lead there.
            let heirs: Vec<usize> = (0..next.len())
                .filter(|&h| {
                    next.get(h).is_some_and(|n| n.tracks.iter().any(|t| group.tracks.contains(t)))
                })
                .collect();
            let known = heirs.iter().find_map(|&h| next_starts.get(h).cloned().flatten());
            let end = known
                .unwrap_or_else(|| out.node(road, &format!("n{}_{g}", k + 1), group, group.to_m));
            for &h in &heirs {
                if let Some(slot) = next_starts.get_mut(h) {
                    *slot = Some(end.clone());
                }
            }
            out.edge(road, &edge_name(k, g), &start, &end, group);
            for (index, track) in group.tracks.iter().enumerate() {
                for &h in &heirs {
                    let tracks = next.get(h).map(|n| n.tracks.as_slice()).unwrap_or_default();
                    if let Some(to) = tracks.iter().position(|t| t == track) {
                        let (from, into) = (edge_name(k, g), edge_name(k + 1, h));
                        let _ = writeln!(
                            out.connections,
                            "<connection from=\"{from}\" to=\"{into}\" fromLane=\"{index}\" toLane=\"{to}\"/>"
                        );
                    }
                }
            }
        }
        starts = next_starts;
    }
    out.nodes.push_str("</nodes>\n");
    out.edges.push_str("</edges>\n");
    out.connections.push_str("</connections>\n");
    out
}

fn edge_name(stretch: usize, group: usize) -> String {
    format!("e{stretch}_{group}")
}

impl Plain {
    fn node(&mut self, road: &Road, id: &str, group: &Group, s_m: f64) -> String {
        let inside = s_m.clamp(group.from_m + 0.01, group.to_m - 0.01);
        let centers = || group.tracks.iter().filter_map(|&t| road.lanes().get(usize::from(t)));
        let d =
            centers().map(|l| l.center_d_m(inside)).sum::<f64>() / centers().count().max(1) as f64;
        let at = road.at(s_m, d);
        let _ = writeln!(
            self.nodes,
            "<node id=\"{id}\" x=\"{:.4}\" y=\"{:.4}\" z=\"{:.4}\" type=\"priority\"/>",
            at.x_m, at.y_m, at.z_m
        );
        id.to_owned()
    }

    fn edge(&mut self, road: &Road, id: &str, from: &str, to: &str, group: &Group) {
        let middle = 0.5 * (group.from_m + group.to_m);
        let _ = writeln!(
            self.edges,
            "<edge id=\"{id}\" from=\"{from}\" to=\"{to}\" numLanes=\"{}\" spreadType=\"center\">",
            group.tracks.len()
        );
        for (index, &track) in group.tracks.iter().enumerate() {
            let Some(lane) = road.lanes().get(usize::from(track)) else { continue };
            let points = libm::ceil((group.to_m - group.from_m) / POINT_M).max(1.0);
            let mut shape = String::new();
            for p in 0..=points as usize {
                let s = group.from_m + (group.to_m - group.from_m) * p as f64 / points;
                let at = road.at(s, lane.center_d_m(s));
                let _ = write!(shape, "{:.4},{:.4},{:.4} ", at.x_m, at.y_m, at.z_m);
            }
            let _ = writeln!(
                self.edges,
                "<lane index=\"{index}\" speed=\"{:.4}\" width=\"{:.3}\" shape=\"{}\">\
                 <param key=\"origId\" value=\"{track}\"/></lane>",
                road.lane_speed_limit_m_s(track, middle).min(NO_LIMIT_M_S),
                lane.width_m(middle),
                shape.trim_end()
            );
        }
        self.edges.push_str("</edge>\n");
    }
}

/// Stations at which the road is cut, both ends included.
fn cuts(road: &Road, further_m: &[f64]) -> Vec<f64> {
    let length_m = road.length_m();
    let mut wanted: Vec<f64> = road.section_starts_m().collect();
    wanted.extend(further_m);
    wanted.extend(road.speed_limits().iter().map(|limit| limit.0));
    wanted.extend(road.lanes().iter().flat_map(|l| l.speed_limits.iter().map(|limit| limit.0)));
    let neighbours = |s: f64| -> Vec<(u16, Option<u16>)> {
        road.lanes_at(s).map(|l| (l.id, road.left_of(l.id, s))).collect()
    };
    let mut before = neighbours(0.0);
    for k in 1..=(length_m / LOOK_M) as usize {
        let s = k as f64 * LOOK_M;
        let now = neighbours(s);
        if now != before {
            wanted.push(s);
        }
        before = now;
    }
    wanted.retain(|s| *s > SAME_M && *s < length_m - SAME_M);
    wanted.sort_by(f64::total_cmp);
    wanted.dedup_by(|b, a| *b - *a < SAME_M);
    wanted.push(length_m);
    let mut cuts = vec![0.0];
    for to in wanted {
        let from = cuts.last().copied().unwrap_or(0.0);
        let parts = libm::ceil((to - from) / LONGEST_M).max(1.0);
        cuts.extend((1..=parts as usize).map(|p| from + (to - from) * p as f64 / parts));
    }
    cuts
}

/// Lanes that touch between two stations, from right to left.
fn groups(road: &Road, from: Option<&f64>, to: Option<&f64>) -> Vec<Group> {
    let (Some(&from_m), Some(&to_m)) = (from, to) else { return Vec::new() };
    let middle = 0.5 * (from_m + to_m);
    let mut offsets: BTreeMap<u16, f64> = BTreeMap::new();
    for lane in road.lanes_at(middle).filter(|lane| lane.kind != LaneKind::Shoulder) {
        offsets.insert(lane.id, lane.center_d_m(middle));
    }
    let mut tracks: Vec<u16> = offsets.keys().copied().collect();
    let offset = |t: u16| offsets.get(&t).copied().unwrap_or_default();
    tracks.sort_by(|&a, &b| offset(a).total_cmp(&offset(b)));
    tracks
        .chunk_by(|&right, &left| road.left_of(right, middle) == Some(left))
        .map(|tracks| Group { from_m, to_m, tracks: tracks.to_vec() })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highway_becomes_edges_whose_lanes_lead_on_into_the_same_track() {
        let road = road::builtin::highway();
        let text = plain(&road, &[]);
        let document = roxmltree::Document::parse(&text.edges).unwrap();
        let mut track = BTreeMap::new();
        for edge in document.root_element().children().filter(|n| n.has_tag_name("edge")) {
            for lane in edge.children().filter(|n| n.has_tag_name("lane")) {
                let value = lane.first_element_child().unwrap().attribute("value").unwrap();
                let key = (edge.attribute("id").unwrap(), lane.attribute("index").unwrap());
                track.insert(key, value);
            }
        }
        let used: std::collections::BTreeSet<_> = track.values().collect();
        assert_eq!(used.len(), road.lanes().len());
        let document = roxmltree::Document::parse(&text.connections).unwrap();
        let mut links = 0;
        for c in document.root_element().children().filter(|n| n.has_tag_name("connection")) {
            let get = |name: &str| c.attribute(name).unwrap();
            assert_eq!(track[&(get("from"), get("fromLane"))], track[&(get("to"), get("toLane"))]);
            links += 1;
        }
        // Lanes of all edges but the last ones of the five tracks lead on.
        assert_eq!(links, track.len() - 5);
    }
}
