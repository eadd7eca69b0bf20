//! Lanes of the roads beside a leg (see [`Companion`]), in the coordinates of the way.
//!
//! Their centres are sampled, projected on the way's reference line, and joined by cubics with the
//! slope `tan(Δθ)(1 - κ d)`; the samples are close enough that the cubics stay within a millimetre
//! of a lane that turns with R = 10 m. Height and bank are those of the leg.

use super::graph::{Companion, driven_lanes};
use super::model::{LaneUse, Network};
use super::route::Leg;
use crate::cubics::Span;
use crate::{LaneSource, Line};

const SAMPLE_M: f64 = 2.0;
/// A lane that points farther away from the way than this does not run beside it, rad.
const LARGEST_ANGLE_RAD: f64 = 0.6;

/// A lane beside a leg, over the whole length of the leg.
pub(super) struct Part {
    pub(super) lane: i32,
    pub(super) usage: LaneUse,
    pub(super) center: Vec<Span>,
    pub(super) width: Vec<Span>,
    pub(super) limit_m_s: Option<f64>,
    pub(super) source: LaneSource,
}

/// The drivable lanes of a companion. Roads of several sections are left out: their lanes begin
/// and end within the junction.
pub(super) fn parts(
    network: &Network,
    leg: &Leg<'_>,
    companion: &Companion,
    line: &Line,
) -> Vec<Part> {
    let Some(road) = network.roads.get(companion.node.road) else { return Vec::new() };
    let [section] = road.sections.as_slice() else { return Vec::new() };
    let forward = companion.node.is_forward();
    let length = road.line.length_m();
    let steps = (libm::ceil(length / SAMPLE_M) as usize).max(1);
    let mut out = Vec::new();
    for id in driven_lanes(road, section, companion.node) {
        let Some(lane) = section.lanes.iter().find(|l| l.id == id && l.is_drivable()) else {
            continue;
        };
        let sample = |i: usize| -> Option<(f64, (f64, f64), f64)> {
            let driven = length * i as f64 / steps as f64;
            let s = if forward { driven } else { length - driven };
            let e = road.edges_in(section, id, s, s)?;
            let (t, dt) = (0.5 * (e.inner.0 + e.outer.0), 0.5 * (e.inner.1 + e.outer.1));
            let k = road.line.at(s);
            let (sin, cos) = libm::sincos(k.heading_rad);
            let flat = t * libm::cos(k.bank_rad);
            let hint = leg.start_m() + driven.min(leg.end_m() - leg.start_m());
            let (station, d) = line.project(k.x_m - flat * sin, k.y_m + flat * cos, Some(hint))?;
            let at = line.at(station);
            let along = k.heading_rad + libm::atan(dt / (1.0 - k.curvature_1_m * t));
            let turned = if forward { 0.0 } else { core::f64::consts::PI };
            let angle = libm::remainder(along + turned - at.heading_rad, core::f64::consts::TAU);
            let slope = libm::tan(angle) * (1.0 - at.curvature_1_m * d);
            let beside = libm::fabs(angle) < LARGEST_ANGLE_RAD;
            beside.then_some((station, (d, slope), libm::fabs(e.outer.0 - e.inner.0)))
        };
        let samples: Option<Vec<_>> = (0..=steps).map(sample).collect();
        let Some(mut samples) = samples else { continue };
        if let Some(first) = samples.first_mut() {
            first.0 = leg.start_m();
        }
        if let Some(last) = samples.last_mut() {
            last.0 = leg.end_m();
        }
        if samples.windows(2).any(|w| w[1].0 <= w[0].0) {
            continue;
        }
        let center = samples.windows(2).map(|w| (w[0].0, w[1].0, w[0].1, w[1].1)).collect();
        let width = samples
            .windows(2)
            .map(|w| {
                let rate = (w[1].2 - w[0].2) / (w[1].0 - w[0].0);
                (w[0].0, w[1].0, (w[0].2, rate), (w[1].2, rate))
            })
            .collect();
        out.push(Part {
            lane: id,
            usage: lane.usage(),
            center,
            width,
            limit_m_s: road.lane_limit_m_s(section, lane, 0.5 * length),
            source: LaneSource {
                s_start_m: leg.start_m(),
                road: road.id.clone(),
                lane: id,
                road_s_m: if forward { 0.0 } else { length },
                reversed: !forward,
            },
        });
    }
    out
}
