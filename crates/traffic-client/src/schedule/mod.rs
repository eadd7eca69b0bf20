//! What changes while traffic runs: demand, limits, incidents, emergency vehicles.
//!
//! Times are those of the run, s; the run begins at 0, and what holds at 0 holds before it, too.
//! Lanes are lane tracks of the road (`map check` lists them). [`detectors`] makes demand of counts.

pub mod detectors;
mod stage;

use serde::{Deserialize, Serialize};

use crate::TrafficError;

pub use stage::Stage;
pub(crate) use stage::has_room;

/// Demand from an instant on. A key that is left out goes on as it was; before the first step that
/// has it, the configuration's own value holds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemandStep {
    /// Holds from this time on, s.
    pub from_s: f64,
    /// The entry lane that it is for; none: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lane: Option<u16>,
    /// Vehicles per hour that come to each lane at the start of the road.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow_veh_h_lane: Option<f64>,
    /// Vehicles per hour that come to each on-ramp.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ramp_flow_veh_h: Option<f64>,
    /// Share of trucks among those who come.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truck_share_frac: Option<f64>,
    /// Speed at which they come in, m/s, where it is below the one they wish.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inflow_speed_m_s: Option<f64>,
    /// Speed limit of the whole road, m/s, where it is below the road's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_limit_m_s: Option<f64>,
}

/// What stands in the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IncidentKind {
    /// A vehicle that stops in its lane and stays.
    StoppedVehicle,
    /// A lane that is closed with barriers.
    ClosedLane,
}

/// Something in the way for a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Incident {
    /// What it is.
    pub kind: IncidentKind,
    /// Station of the stopped vehicle's front, or of the first barrier, m.
    pub s_m: f64,
    /// Length of the closed stretch, m; of no meaning for a vehicle.
    #[serde(default = "closed_m")]
    pub length_m: f64,
    /// Lane track.
    pub lane: u16,
    /// It begins, s: as soon after this as nobody has to brake hard for it.
    pub from_s: f64,
    /// It ends, s; none: it stays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
}

/// Length of a closed stretch where none is given, m.
fn closed_m() -> f64 {
    300.0
}

/// A vehicle with right of way: faster than the limit, and others make way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmergencyVehicle {
    /// It comes to the start of the road at this time, s.
    pub from_s: f64,
    /// Desired speed, m/s, whatever the limit.
    #[serde(default = "emergency_m_s")]
    pub speed_m_s: f64,
    /// Lane track that it comes in; none: the leftmost at the start of the road.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lane: Option<u16>,
}

/// 130 km/h.
fn emergency_m_s() -> f64 {
    36.1
}

/// All that changes in a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Schedule {
    /// Demand, in order of its times.
    pub demand: Vec<DemandStep>,
    /// Incidents.
    pub incidents: Vec<Incident>,
    /// Emergency vehicles.
    pub emergency_vehicles: Vec<EmergencyVehicle>,
}

impl Incident {
    /// Whether it should be there at a time, s.
    #[must_use]
    pub fn is_due(&self, time_s: f64) -> bool {
        (time_s >= self.from_s || self.from_s <= 0.0) && self.to_s.is_none_or(|to_s| time_s < to_s)
    }

    /// The stretch that it takes up, m.
    #[must_use]
    pub fn stretch_m(&self) -> (f64, f64) {
        match self.kind {
            IncidentKind::StoppedVehicle => (self.s_m - 5.0, self.s_m),
            IncidentKind::ClosedLane => (self.s_m, self.s_m + self.length_m),
        }
    }
}

impl Schedule {
    /// Whether nothing changes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.demand.is_empty() && self.incidents.is_empty() && self.emergency_vehicles.is_empty()
    }

    /// The value of a key at a time (s) and lane: that of the last step which has it.
    pub(crate) fn at(
        &self,
        time_s: f64,
        lane: Option<u16>,
        key: impl Fn(&DemandStep) -> Option<f64>,
    ) -> Option<f64> {
        let time_s = time_s.max(0.0);
        let past = self.demand.partition_point(|step| step.from_s.max(0.0) <= time_s);
        let mut past = self.demand.iter().take(past).rev();
        past.find_map(|step| key(step).filter(|_| step.lane.is_none() || step.lane == lane))
    }

    /// The speed limit of the whole road at a time (s), m/s, if there is one beside the road's own.
    #[must_use]
    pub fn limit_m_s(&self, time_s: f64) -> Option<f64> {
        self.at(time_s, None, |step| step.speed_limit_m_s)
    }

    /// Checks every number, against the lanes of the road where it is known.
    ///
    /// # Errors
    /// [`TrafficError::Config`] lists every key that is out of its range, with the value.
    pub fn validate(&self, road: Option<&road::Road>) -> Result<(), TrafficError> {
        let mut bad = Vec::new();
        let mut check = |key: String, value: f64, low: f64, high: f64| {
            if !(value >= low && value <= high) {
                bad.push(format!("{key} = {value} is outside [{low}, {high}]"));
            }
        };
        let mut last_s = f64::NEG_INFINITY;
        for (k, step) in self.demand.iter().enumerate() {
            let key = |name: &str| format!("demand[{k}].{name}");
            check(key("from_s"), step.from_s, last_s.max(-1e6), 1e7);
            last_s = step.from_s;
            for (name, value, low, high) in [
                ("flow_veh_h_lane", step.flow_veh_h_lane, 0.0, 20_000.0),
                ("ramp_flow_veh_h", step.ramp_flow_veh_h, 0.0, 20_000.0),
                ("truck_share_frac", step.truck_share_frac, 0.0, 1.0),
                ("inflow_speed_m_s", step.inflow_speed_m_s, 0.0, 70.0),
                ("speed_limit_m_s", step.speed_limit_m_s, 1.0, 70.0),
            ] {
                check(key(name), value.unwrap_or(low), low, high);
            }
        }
        let length_m = road.map_or(1e7, road::Road::length_m);
        for (k, incident) in self.incidents.iter().enumerate() {
            let key = |name: &str| format!("incident[{k}].{name}");
            check(key("s_m"), incident.s_m, 0.0, length_m);
            check(key("length_m"), incident.length_m, 1.0, 1e5);
            check(key("from_s"), incident.from_s, -1e6, 1e7);
            check(key("to_s"), incident.to_s.unwrap_or(1e7), incident.from_s, 1e7);
        }
        for (k, vehicle) in self.emergency_vehicles.iter().enumerate() {
            let key = |name: &str| format!("emergency_vehicle[{k}].{name}");
            check(key("from_s"), vehicle.from_s, 0.0, 1e7);
            check(key("speed_m_s"), vehicle.speed_m_s, 1.0, 70.0);
        }
        if let Some(road) = road {
            let at = |s_m: f64, lane: u16| road.lanes_at(s_m).any(|track| track.id == lane);
            let lanes = |s_m: f64| {
                let ids: Vec<String> =
                    road.lanes_at(s_m).map(|track| track.id.to_string()).collect();
                ids.join(", ")
            };
            for (k, i) in self.incidents.iter().enumerate() {
                if !at(i.s_m, i.lane) {
                    let (lane, s_m) = (i.lane, i.s_m);
                    bad.push(format!(
                        "incident[{k}].lane = {lane}: at {s_m} m there are {}",
                        lanes(s_m)
                    ));
                }
            }
            let entries = self.demand.iter().map(|step| ("demand", step.lane));
            let entries = entries
                .chain(self.emergency_vehicles.iter().map(|v| ("emergency_vehicle", v.lane)));
            for (name, lane) in entries.filter_map(|(name, lane)| Some((name, lane?))) {
                if !at(0.0, lane) {
                    bad.push(format!("{name}.lane = {lane}: the road begins with {}", lanes(0.0)));
                }
            }
        }
        if bad.is_empty() { Ok(()) } else { Err(TrafficError::Config { why: bad.join("; ") }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flow(from_s: f64, lane: Option<u16>, flow_veh_h_lane: f64) -> DemandStep {
        DemandStep { from_s, lane, flow_veh_h_lane: Some(flow_veh_h_lane), ..DemandStep::default() }
    }

    #[test]
    fn the_last_step_that_has_a_key_and_is_for_the_lane_holds() {
        let limit =
            DemandStep { from_s: 50.0, speed_limit_m_s: Some(20.0), ..DemandStep::default() };
        let demand = vec![flow(0.0, None, 900.0), limit, flow(100.0, Some(1), 300.0)];
        let schedule = Schedule { demand, ..Schedule::default() };
        let at = |t, lane| schedule.at(t, Some(lane), |step| step.flow_veh_h_lane);
        assert_eq!((at(-30.0, 0), at(99.0, 1)), (Some(900.0), Some(900.0)));
        assert_eq!((at(100.0, 0), at(100.0, 1)), (Some(900.0), Some(300.0)));
        assert_eq!((schedule.limit_m_s(49.9), schedule.limit_m_s(1e5)), (None, Some(20.0)));
    }

    #[test]
    fn every_bad_value_is_named_at_once_with_the_lanes_that_there_are() {
        let road = road::builtin::flat(1000.0);
        let incident = Incident {
            kind: IncidentKind::ClosedLane,
            s_m: 500.0,
            length_m: 0.0,
            lane: 7,
            from_s: 10.0,
            to_s: Some(5.0),
        };
        let schedule = Schedule {
            demand: vec![flow(20.0, None, f64::NAN), flow(10.0, None, 1.0)],
            incidents: vec![incident],
            ..Schedule::default()
        };
        let e = schedule.validate(Some(&road)).unwrap_err().to_string();
        for part in [
            "demand[0].flow_veh_h_lane = NaN",
            "demand[1].from_s = 10",
            "incident[0].length_m = 0",
            "incident[0].to_s = 5",
            "incident[0].lane = 7: at 500 m there are 0, 1",
        ] {
            assert!(e.contains(part), "{part}: {e}");
        }
        assert!(Schedule::default().validate(Some(&road)).is_ok());
    }

    #[test]
    fn an_incident_at_the_start_is_there_before_it_and_ends_in_time() {
        let toml = "kind = \"stopped_vehicle\"\ns_m = 10.0\nlane = 0\nfrom_s = 0.0\nto_s = 60.0";
        let i: Incident = toml::from_str(toml).unwrap();
        assert!(i.is_due(-30.0) && i.is_due(59.9) && !i.is_due(60.0));
        let later = Incident { from_s: 5.0, to_s: None, ..i };
        assert!(!later.is_due(4.9) && later.is_due(1e6));
    }
}
