//! Lane sections, lanes, outlines and speed records.

use roxmltree::Node;

use super::model::{Lane, LaneOutline, LaneSection};
use super::read::cubics;
use super::xml::{Source, child, children};
use crate::{Cubics, RoadError};

/// More lanes in one section are taken for a mistake.
const MAX_LANES: usize = 200;

pub(super) fn sections(
    source: &Source<'_>,
    lanes: Node<'_, '_>,
    length_m: f64,
) -> Result<Vec<LaneSection>, RoadError> {
    let mut out: Vec<LaneSection> = Vec::new();
    for node in children(lanes, "laneSection") {
        let s_m = source.number(node, "s")?;
        if let Some(before) = out.last_mut() {
            if s_m < before.s_m {
                return Err(source.error(node, format!("s = {s_m} goes back")));
            }
            before.end_m = s_m;
        }
        out.push(LaneSection { s_m, end_m: length_m.max(s_m), lanes: section(source, node)? });
    }
    if out.is_empty() {
        return Err(source.error(lanes, "no <laneSection>"));
    }
    Ok(out)
}

fn section(source: &Source<'_>, node: Node<'_, '_>) -> Result<Vec<Lane>, RoadError> {
    let mut out: Vec<Lane> = Vec::new();
    for (side, sign) in [("left", 1), ("right", -1)] {
        for n in child(node, side).into_iter().flat_map(|g| children(g, "lane")) {
            let lane = lane(source, n)?;
            if lane.id.signum() != sign {
                return Err(source.error(n, format!("id = {} under <{side}>", lane.id)));
            }
            if out.iter().any(|l| l.id == lane.id) {
                return Err(source.error(n, format!("id = {} is used twice", lane.id)));
            }
            out.push(lane);
            if out.len() > MAX_LANES {
                return Err(source.error(node, format!("more than {MAX_LANES} lanes")));
            }
        }
    }
    out.sort_by_key(|l| -l.id);
    Ok(out)
}

fn lane(source: &Source<'_>, node: Node<'_, '_>) -> Result<Lane, RoadError> {
    let id = source.integer(node, "id")?;
    let kind = source.text(node, "type")?.to_string();
    // Where both are given, the width holds (OpenDRIVE 1.8, 11.6.3).
    let outline = if child(node, "width").is_some() {
        LaneOutline::Width(cubics(source, node, "width", "sOffset")?)
    } else if child(node, "border").is_some() {
        LaneOutline::Border(cubics(source, node, "border", "sOffset")?)
    } else {
        LaneOutline::Width(Cubics::constant(0.0))
    };
    let link = child(node, "link");
    let ids = |name: &'static str| {
        link.into_iter()
            .flat_map(|l| children(l, name))
            .map(|n| source.integer(n, "id"))
            .collect::<Result<Vec<i32>, _>>()
    };
    let mut speed_limits = Vec::new();
    for n in children(node, "speed") {
        speed_limits.push((source.length(n, "sOffset")?, speed_m_s(source, n)?));
    }
    speed_limits.sort_by(|a: &(f64, f64), b| a.0.total_cmp(&b.0));
    let (predecessors, successors) = (ids("predecessor")?, ids("successor")?);
    Ok(Lane { id, kind, outline, predecessors, successors, speed_limits })
}

/// A speed record in m/s; infinite for "no limit" and "undefined". Without a unit it is m/s
/// (OpenDRIVE 1.8, 10.4.1).
pub(super) fn speed_m_s(source: &Source<'_>, node: Node<'_, '_>) -> Result<f64, RoadError> {
    let text = source.text(node, "max")?.trim();
    if matches!(text, "no limit" | "undefined") {
        return Ok(f64::INFINITY);
    }
    let value = source.number(node, "max")?;
    let factor = match node.attribute("unit").map(str::trim) {
        Some("m/s") | None | Some("") => 1.0,
        Some("km/h") => 1.0 / 3.6,
        Some("mph") => 0.447_04,
        Some(other) => {
            return Err(source.error(node, format!("unit = {other:?}, m/s, mph or km/h is needed")));
        }
    };
    // Zero and below stand for "no limit" in older files.
    Ok(if value > 0.0 { value * factor } else { f64::INFINITY })
}
