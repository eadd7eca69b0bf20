//! Which lanes are closed right now, and the barriers that say so.
//!
//! A closure begins as soon after its time as the ego is not on its stretch and could stop before
//! it. Barriers stand every [`SPACING_M`]; one is left out while a vehicle that was there before
//! drives through its place.

use road::Road;
use tractrix_core::{Neighbour, Scene, VehicleClass};

use super::{IncidentKind, Schedule};
use crate::native::{EgoSpans, stopping_gap_m};

/// Spacing, length and width of barriers, m.
const SPACING_M: f64 = 20.0;
const LENGTH_M: f64 = 2.0;
const WIDTH_M: f64 = 1.8;
/// Numbers of barriers begin here; vehicles stay below.
const FIRST_ID: u64 = 1 << 48;

/// The closures in force.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stage {
    /// Indices of incidents.
    closed: Vec<usize>,
}

impl Stage {
    /// The lanes that are closed: incident, lane, from and to, m.
    pub(crate) fn closures<'a>(
        &'a self,
        schedule: &'a Schedule,
    ) -> impl Iterator<Item = (usize, u16, f64, f64)> + 'a {
        let incidents = self.closed.iter().filter_map(|&k| Some((k, schedule.incidents.get(k)?)));
        incidents.map(|(k, i)| (k, i.lane, i.s_m, i.s_m + i.length_m))
    }

    /// Begins and ends closures; whether anything changed.
    pub(crate) fn update(&mut self, schedule: &Schedule, time_s: f64, ego: &EgoSpans) -> bool {
        let mut changed = false;
        for (k, incident) in schedule.incidents.iter().enumerate() {
            if incident.kind != IncidentKind::ClosedLane {
                continue;
            }
            let is_closed = self.closed.contains(&k);
            if is_closed && !incident.is_due(time_s) {
                self.closed.retain(|&other| other != k);
                changed = true;
            } else if !is_closed && incident.is_due(time_s) && has_room(schedule, k, ego) {
                self.closed.push(k);
                changed = true;
            }
        }
        changed
    }

    /// Adds the barriers within a radius (m) around a station (m) to a scene, and sorts it.
    pub(crate) fn show(
        &self,
        schedule: &Schedule,
        road: &Road,
        around_s_m: f64,
        radius_m: f64,
        scene: &mut Scene,
    ) {
        if self.closed.is_empty() {
            return;
        }
        let vehicles = scene.neighbours.len();
        for (incident, lane, from_m, to_m) in self.closures(schedule) {
            let Some(track) = road.lanes().get(usize::from(lane)) else { continue };
            for k in 0..=((to_m - from_m) / SPACING_M) as u64 {
                let rear_s_m = from_m + k as f64 * SPACING_M;
                let middle_m = rear_s_m + 0.5 * LENGTH_M;
                if (middle_m - around_s_m).abs() > radius_m {
                    continue;
                }
                let d_m = track.center_d_m(middle_m);
                let vehicles = scene.neighbours.iter().take(vehicles);
                let is_taken = vehicles.into_iter().any(|n| {
                    n.rear_s_m < rear_s_m + LENGTH_M
                        && n.front_s_m > rear_s_m
                        && (n.d_m - d_m).abs() < 0.5 * (n.width_m + WIDTH_M)
                });
                if is_taken {
                    continue;
                }
                let at = road.at(middle_m, d_m);
                scene.neighbours.push(Neighbour {
                    id: FIRST_ID + ((incident as u64) << 32) + k,
                    class: VehicleClass::Barrier,
                    front_s_m: rear_s_m + LENGTH_M,
                    rear_s_m,
                    d_m,
                    width_m: WIDTH_M,
                    lane,
                    x_m: at.x_m,
                    y_m: at.y_m,
                    yaw_rad: at.heading_rad,
                    ..Neighbour::default()
                });
            }
        }
        scene
            .neighbours
            .sort_unstable_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m).then(a.id.cmp(&b.id)));
    }
}

/// Whether the ego is off the stretch of an incident and could stop before it.
pub(crate) fn has_room(schedule: &Schedule, incident: usize, ego: &EgoSpans) -> bool {
    let Some(incident) = schedule.incidents.get(incident) else { return false };
    let (from_m, to_m) = incident.stretch_m();
    ego.in_lane(incident.lane).is_none_or(|span| {
        span.rear_m > to_m || from_m - span.front_m > stopping_gap_m(ego.speed_m_s, 0.0)
    })
}
