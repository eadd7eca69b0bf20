//! Vehicles that are no flow: those that stand, and emergency vehicles.
//!
//! One that stands is there from the start, or is put in at its time as soon as SUMO finds that
//! nobody has to brake hard for it. Emergency vehicles have SUMO's blue-light device, which lets
//! them pass where SUMO's drivers make way (a rescue lane in the sublane model).

use std::fmt::Write as _;

use road::Road;

use super::demand::{EGO_ROUTE, EMERGENCY};
use super::network::Network;
use crate::native::TrafficConfig;
use crate::schedule::IncidentKind;

/// Departures, with their times.
#[derive(Debug, Default)]
pub(super) struct Entries(Vec<(f64, String)>);

impl Entries {
    pub(super) fn push(&mut self, time_s: f64, text: String) {
        self.0.push((time_s, text));
    }

    /// All of them, the earliest first.
    pub(super) fn in_order(mut self) -> String {
        self.0.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.0.into_iter().flat_map(|(_, text)| [text, "\n".to_owned()]).collect()
    }
}

/// Nobody of the first fill is this close before and behind what is in the way, m.
const BEFORE_M: f64 = 120.0;
const BEHIND_M: f64 = 25.0;

/// A stretch of one of SUMO's lanes that nobody of the first fill is put on.
pub(super) struct Kept {
    lane: String,
    positions_m: std::ops::Range<f64>,
}

impl Kept {
    /// Whether this position (m) in a lane is one of it.
    pub(super) fn holds(&self, lane: &str, pos_m: f64) -> bool {
        self.lane == lane && self.positions_m.contains(&pos_m)
    }
}

/// The lanes that are closed from the start, and the way before them.
pub(super) fn closed_from_the_start(
    config: &TrafficConfig,
    network: &Network,
    road: &Road,
) -> Vec<Kept> {
    let closed = config
        .schedule
        .incidents
        .iter()
        .filter(|i| i.kind == IncidentKind::ClosedLane && i.from_s <= 0.0);
    let mut kept = Vec::new();
    for incident in closed {
        for lane in network.lanes.iter().filter(|lane| lane.is_of(incident.lane)) {
            let Some((from_m, to_m)) = lane.stretch_m(road) else { continue };
            let (first_m, last_m) = incident.stretch_m();
            if from_m < last_m && to_m > first_m - BEFORE_M {
                let positions_m = first_m - BEFORE_M - from_m..last_m - from_m;
                kept.push(Kept { lane: lane.id.clone(), positions_m });
            }
        }
    }
    kept
}

/// Writes the vehicles that stand; returns where those from the start keep others away.
pub(super) fn stopped_vehicles(
    entries: &mut Entries,
    config: &TrafficConfig,
    network: &Network,
    road: &Road,
    through: &[String],
) -> Vec<Kept> {
    let mut stands = Vec::new();
    for (k, incident) in config.schedule.incidents.iter().enumerate() {
        if incident.kind != IncidentKind::StoppedVehicle {
            continue;
        }
        let place = network.lanes.iter().find_map(|lane| {
            let (from_m, to_m) = lane.stretch_m(road)?;
            let is_here =
                lane.is_of(incident.lane) && from_m <= incident.s_m && incident.s_m < to_m;
            is_here.then_some((lane, incident.s_m - from_m))
        });
        let Some((lane, pos_m)) = place else { continue };
        let Some(at) = through.iter().position(|edge| *edge == lane.edge) else { continue };
        let pos_m = pos_m.clamp(config.car.length_m.min(lane.length_m), lane.length_m);
        let (id, index) = (&lane.id, lane.index);
        let edges = through.get(at..).unwrap_or_default().join(" ");
        let from_s = incident.from_s.max(0.0);
        let until = incident.to_s.unwrap_or(1e6);
        let checks = if from_s > 0.0 { "all" } else { "none" };
        if from_s <= 0.0 {
            let positions_m = pos_m - BEFORE_M..pos_m + BEHIND_M;
            stands.push(Kept { lane: lane.id.clone(), positions_m });
        }
        entries.push(
            from_s,
            format!(
                "<vehicle id=\"stopped{k}\" type=\"car\" depart=\"{from_s}\" \
                 departLane=\"{index}\" departPos=\"{pos_m:.2}\" departSpeed=\"0\" \
                 insertionChecks=\"{checks}\"><route edges=\"{edges}\"/>\
                 <stop lane=\"{id}\" endPos=\"{:.2}\" until=\"{until}\"/></vehicle>",
                (pos_m + 0.5).min(lane.length_m)
            ),
        );
    }
    stands
}

/// Writes the emergency vehicles: types into `out`, vehicles into `entries`.
pub(super) fn emergency_vehicles(
    out: &mut String,
    entries: &mut Entries,
    config: &TrafficConfig,
    network: &Network,
    through: &[String],
) {
    let Some(entry) = through.first() else { return };
    let leftmost = network.lanes_of(entry).map(|lane| lane.index).max().unwrap_or(0);
    for (k, vehicle) in config.schedule.emergency_vehicles.iter().enumerate() {
        let own = |lane: u16| network.lanes_of(entry).find(|l| l.is_of(lane)).map(|l| l.index);
        let index = vehicle.lane.and_then(own).unwrap_or(leftmost);
        let (speed, van) = (vehicle.speed_m_s, &config.van);
        let _ = writeln!(
            out,
            "<vType id=\"{EMERGENCY}{k}\" vClass=\"emergency\" carFollowModel=\"IDM\" \
             length=\"{}\" width=\"{}\" tau=\"1\" accel=\"2\" decel=\"3\" maxSpeed=\"{speed}\" \
             speedFactor=\"5\" speedDev=\"0\"><param key=\"has.bluelight.device\" value=\"true\"/></vType>",
            van.length_m, van.width_m
        );
        entries.push(
            vehicle.from_s,
            format!(
                "<vehicle id=\"{EMERGENCY}{k}\" type=\"{EMERGENCY}{k}\" route=\"{EGO_ROUTE}\" \
                 depart=\"{}\" departLane=\"{index}\" departSpeed=\"max\"/>",
                vehicle.from_s
            ),
        );
    }
}
