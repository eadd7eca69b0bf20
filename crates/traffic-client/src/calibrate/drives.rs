//! Drives of native traffic that are looked at: free, and between the measured rims of a recording.

use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};

use crate::TrafficError;
use crate::native::{Boundary, NativeTraffic, TrafficConfig};
use crate::stats::{Observer, Samples};

/// Between two looks of the observer, ticks.
const LOOK_TICKS: u64 = 5;

/// Native traffic alone on a road for a while after its warm-up, looked at twice a second.
///
/// # Errors
/// [`TrafficError`] for a configuration or road that cannot be used.
pub fn drive(
    road: &Arc<Road>,
    config: TrafficConfig,
    duration_s: f64,
) -> Result<Samples, TrafficError> {
    let config = TrafficConfig { sees_ego: false, scene_radius_m: 1e5, ..config };
    let mut traffic = NativeTraffic::new(Arc::clone(road), Geometry::default(), config)?;
    observe(&mut traffic, road, duration_s)
}

/// Native traffic between the measured start, arrivals and end of a recording, for as long as the
/// recording, `drives` times with seeds of their own; the samples of all drives.
///
/// # Errors
/// As [`drive`].
pub fn drive_bounded(
    road: &Arc<Road>,
    config: &TrafficConfig,
    boundary: &Arc<Boundary>,
    drives: u64,
) -> Result<Samples, TrafficError> {
    let one = |k: u64| {
        let seed = config.seed.wrapping_add(k);
        let config = TrafficConfig { sees_ego: false, scene_radius_m: 1e5, seed, ..config.clone() };
        let (road, geometry) = (Arc::clone(road), Geometry::default());
        let mut traffic =
            NativeTraffic::bounded(Arc::clone(&road), geometry, config, Arc::clone(boundary))?;
        observe(&mut traffic, &road, boundary.duration_s())
    };
    let each = (0..drives).map(one).collect::<Result<Vec<_>, TrafficError>>()?;
    Ok(Samples::pooled(&each))
}

fn observe(
    traffic: &mut NativeTraffic,
    road: &Road,
    duration_s: f64,
) -> Result<Samples, TrafficError> {
    let ego = EgoState { s_m: 0.5 * road.length_m(), ..EgoState::default() };
    let mut observer = Observer::default();
    for k in 0..=(duration_s * 10.0) as u64 / LOOK_TICKS {
        let now = Time((k * LOOK_TICKS * 100_000_000) as i64);
        observer.look(traffic.advance(now, &ego)?, road);
    }
    Ok(observer.samples)
}

/// Metres of driving lanes of a road.
#[must_use]
pub fn lanes_m(road: &Road) -> f64 {
    let driven = road.lanes().iter().filter(|lane| lane.kind == road::LaneKind::Driving);
    driven.map(|lane| lane.s_end_m - lane.s_start_m).sum()
}
