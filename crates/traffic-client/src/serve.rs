//! What a demand becomes on a level road: who passes, who waits, and how fast they are.
//!
//! A level road of two lanes without ramps begins empty of queues; after [`SETTLE_S`], vehicles that
//! pass a cross-section [`SECTION_M`] behind the start are counted for 15 minutes, the interval that
//! the Highway Capacity Manual (HCM, 6th ed., 2016, ch. 4) defines flow rate and capacity by.

use std::sync::Arc;

use road::builtin;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource};

use crate::TrafficError;
use crate::native::{NativeTraffic, TrafficConfig};

/// Length of the road and station of the cross-section, m.
const ROAD_M: f64 = 3000.0;
const SECTION_M: f64 = 2000.0;
/// Before anything is counted, and how long it is, s.
const SETTLE_S: i64 = 300;
const COUNT_S: i64 = 900;
/// The stretch behind the start in which a queue would stand, m.
const ENTRY_M: f64 = 200.0;

/// What was served.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Served {
    /// Vehicles that passed the cross-section, per hour and lane.
    pub flow_veh_h_lane: f64,
    /// Vehicles that wait before the road at the end.
    pub waiting: u64,
    /// Vehicles that came to the road since its start, waiting ones included.
    pub arrived: u64,
    /// Mean speed at the cross-section, m/s.
    pub speed_m_s: f64,
    /// Mean speed on the first 200 m, m/s.
    pub entry_speed_m_s: f64,
}

/// Drives this demand. Its limits are those of `max_speed_m_s`; the ego is not seen.
///
/// # Errors
/// [`TrafficError::Config`] for values out of range.
pub fn serve(config: &TrafficConfig) -> Result<Served, TrafficError> {
    let road = Arc::new(builtin::flat(ROAD_M));
    let config =
        TrafficConfig { sees_ego: false, scene_radius_m: ROAD_M, warm_up_s: 0.0, ..config.clone() };
    let lanes = road.lanes().len().max(1) as f64;
    let mut traffic = NativeTraffic::new(road, Geometry::default(), config)?;
    let ego = EgoState { s_m: 0.5 * ROAD_M, ..EgoState::default() };
    let mut before = std::collections::BTreeSet::new();
    let (mut passed, mut passing_m_s) = (0.0, 0.0);
    let (mut entry, mut entry_m_s) = (0.0, 0.0);
    for k in 0..=SETTLE_S + COUNT_S {
        let scene = traffic.advance(Time::from_seconds(k as f64), &ego)?;
        if k >= SETTLE_S {
            for n in scene.neighbours.iter().filter(|n| n.front_s_m < ENTRY_M) {
                (entry, entry_m_s) = (entry + 1.0, entry_m_s + n.speed_m_s);
            }
            for n in scene.neighbours.iter().filter(|n| n.front_s_m >= SECTION_M) {
                if before.contains(&n.id) {
                    (passed, passing_m_s) = (passed + 1.0, passing_m_s + n.speed_m_s);
                }
            }
        }
        before =
            scene.neighbours.iter().filter(|n| n.front_s_m < SECTION_M).map(|n| n.id).collect();
    }
    let counts = traffic.counts();
    Ok(Served {
        flow_veh_h_lane: 3600.0 * passed / (lanes * COUNT_S as f64),
        waiting: counts.waiting,
        arrived: counts.arrived,
        speed_m_s: passing_m_s / f64::max(passed, 1.0),
        entry_speed_m_s: entry_m_s / f64::max(entry, 1.0),
    })
}
