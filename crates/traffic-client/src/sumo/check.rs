//! Does SUMO's copy of the road lie where ours does? Every lane is sampled at every shape point.

use road::{LaneKind, Road};

use super::error::SumoError;
use super::network::Network;

/// Largest offset between a SUMO lane and ours that is accepted away from tapers, m.
pub const TOLERANCE_M: f64 = 0.1;
/// A lane whose centre or width changes by more than this per metre is tapering.
const TAPER: f64 = 1e-3;
/// Distance from the ends of a lane within which its shape is cut by the junction, m.
const CUT_M: f64 = 15.0;

/// Result of the check.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImportCheck {
    /// SUMO lanes that lie on our road.
    pub lanes: usize,
    /// SUMO lanes elsewhere (other carriageways, shoulders).
    pub elsewhere: usize,
    /// Points compared away from tapers.
    pub points: usize,
    /// Largest offset away from tapers, m.
    pub worst_m: f64,
    /// Lane and station of it.
    pub worst_at: Option<(String, f64)>,
    /// Largest offset in tapers, m: netconvert turns a taper into steps.
    pub worst_taper_m: f64,
}

/// Compares all lanes.
///
/// # Errors
/// [`SumoError::Map`] if no lane lies on the road, or one is off by more than [`TOLERANCE_M`].
pub fn check(network: &Network, road: &Road) -> Result<ImportCheck, SumoError> {
    let mut result = ImportCheck::default();
    for lane in &network.lanes {
        let mut hint = None;
        let mut on_road = 0usize;
        for &[x, y] in &lane.shape_m {
            let Some(at) = road.project(x, y, hint) else { continue };
            hint = Some(at.s_m);
            // The nearest lane centre; the SUMO lane is ours if it is within half a lane of one.
            let nearest = road
                .lanes_at(at.s_m)
                .filter(|track| track.kind != LaneKind::Shoulder)
                .map(|track| ((at.d_m - track.center_d_m(at.s_m)).abs(), track))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((offset_m, track)) = nearest else { continue };
            if offset_m > 0.5 * track.width_m(at.s_m) {
                continue;
            }
            on_road += 1;
            let change =
                |f: &dyn Fn(f64) -> f64| (f(at.s_m + 15.0) - f(at.s_m - 15.0)).abs() / 30.0;
            let taper = change(&|s| track.center_d_m(s)) > TAPER
                || change(&|s| track.width_m(s)) > TAPER
                || at.s_m < track.s_start_m + CUT_M
                || at.s_m > track.s_end_m - CUT_M;
            if taper {
                result.worst_taper_m = result.worst_taper_m.max(offset_m);
                continue;
            }
            result.points += 1;
            if offset_m > result.worst_m {
                result.worst_m = offset_m;
                result.worst_at = Some((lane.id.clone(), at.s_m));
            }
        }
        if 2 * on_road > lane.shape_m.len() {
            result.lanes += 1;
        } else {
            result.elsewhere += 1;
        }
    }
    if result.lanes == 0 {
        let why = format!("none of SUMO's {} lanes lies on `{}`", network.lanes.len(), road.name());
        return Err(SumoError::Map { why });
    }
    if result.worst_m > TOLERANCE_M {
        let (lane, s_m) = result.worst_at.clone().unwrap_or_default();
        let why = format!(
            "SUMO lane `{lane}` is {:.3} m beside ours at station {s_m:.0} m; at most {TOLERANCE_M} m",
            result.worst_m
        );
        return Err(SumoError::Map { why });
    }
    Ok(result)
}
