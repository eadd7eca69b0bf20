//! What SUMO is told: the start of an episode, and each step with the ego, its ghost and the eye.
//!
//! SUMO's drivers do not see an externally moved truck before its centre crosses a lane line. While
//! the ego reaches into a neighbour lane, a *ghost* of its size drives in that lane.

use tractrix_core::{EgoState, Time};

use super::codec::Value;
use super::demand::{EGO, EGO_ROUTE, GHOST, route_file};
use super::error::SumoError;
use super::link::Link;
use super::network::file_error;
use super::session::{id, var};
use super::source::SumoTraffic;
use crate::schedule::{Incident, IncidentKind, Stage};

/// Id of the point of interest that the context subscription hangs on.
const EYE: &str = "eye";

impl SumoTraffic {
    /// Writes the demand with a free stretch at the ego, starts or reloads SUMO, caps the speeds.
    pub(super) fn start(&mut self, ego: &EgoState) -> Result<(), SumoError> {
        let clearance = self.config.traffic.ego_clearance_m + self.geometry.length_m();
        let free = if self.config.traffic.sees_ego {
            ego.s_m - clearance..ego.s_m + clearance
        } else {
            0.0..0.0
        };
        let write = |name: &str, text: &str| {
            let path = self.folder.join(name);
            std::fs::write(&path, text).map_err(|e| file_error(&path, &e))
        };
        let demand = route_file(&self.config, &self.network, &self.road, &self.geometry, free);
        write("demand.rou.xml", &demand)?;
        write(
            "eye.add.xml",
            &format!(
                "<additional><poi id=\"{EYE}\" x=\"0\" y=\"0\" color=\"0,0,0\"/></additional>\n"
            ),
        )?;
        let options = self.options();
        match &mut self.link {
            Some(link) => link.load(&options)?,
            None => {
                self.link = Some(Link::start(&self.programs, &options, self.config.timeouts)?);
            }
        }
        (self.ego_inside, self.ghost) = (false, false);
        (self.stage, self.limit_m_s) = (Stage::default(), f64::INFINITY);
        self.bodies.clear();
        let speed_m_s = self.config.traffic.max_speed_m_s;
        let radius_m = self.config.traffic.scene_radius_m;
        let Some(link) = self.link.as_mut() else { return Ok(()) };
        let request = link.session.request();
        for lane in self.network.lanes.iter().filter(|lane| lane.speed_m_s > speed_m_s) {
            request.set(id::LANE, var::MAX_SPEED, &lane.id, &Value::Double(speed_m_s));
        }
        request.move_poi(EYE, ego.x_m, ego.y_m).subscribe_context(id::POI, EYE, radius_m);
        link.command("start", EYE)
    }

    /// One step to a time: the ego as it will be at its end, if it is to be seen, and what changes.
    pub(super) fn step(&mut self, ego: &EgoState, to: Time) -> Result<(), SumoError> {
        let orders = self.orders(ego, to.seconds());
        let yaw = ego.yaw_rad;
        let (sin, cos) = (libm::sin(yaw), libm::cos(yaw));
        let front = (ego.x_m + self.geometry.front_m * cos, ego.y_m + self.geometry.front_m * sin);
        let sees_ego = self.config.traffic.sees_ego;
        let ghost = if sees_ego { self.ghost_place(ego) } else { None };
        let Some(link) = self.link.as_mut() else { return Ok(()) };
        let request = link.session.request();
        for (lane, variable, value) in &orders {
            request.set(id::LANE, *variable, lane, value);
        }
        if sees_ego {
            if !self.ego_inside {
                request.set(id::VEHICLE, var::ADD, EGO, &add_ego(ego.speed_m_s));
            }
            request.move_to_xy(EGO, front.0, front.1, sumo_angle_deg(yaw));
            if !self.ego_inside {
                for variable in [var::SPEED_MODE, var::LANE_CHANGE_MODE] {
                    request.set(id::VEHICLE, variable, EGO, &Value::Int(0));
                }
            }
            match (ghost, self.ghost) {
                (Some((x, y, heading)), was) => {
                    if !was {
                        request.set(id::VEHICLE, var::ADD, GHOST, &add_ego(ego.speed_m_s));
                    }
                    request.move_to_xy(GHOST, x, y, sumo_angle_deg(heading));
                }
                (None, true) => {
                    request.set(id::VEHICLE, var::REMOVE, GHOST, &Value::Byte(3));
                }
                (None, false) => {}
            }
        }
        request.move_poi(EYE, ego.x_m, ego.y_m).step();
        link.exchange("step")?;
        link.time_s += 0.1;
        if let Some(SumoError::Refused { text, .. }) = link.session.refusal(EGO)
            && !self.ego_inside
        {
            return Err(SumoError::EgoNotInserted { why: text });
        }
        (self.ego_inside, self.ghost) = (sees_ego, ghost.is_some());
        Ok(())
    }

    /// Lanes that close or open now, and limits that change: lane, variable, value.
    fn orders(&mut self, ego: &EgoState, time_s: f64) -> Vec<(String, u8, Value)> {
        let traffic = &self.config.traffic;
        let schedule = &traffic.schedule;
        let mut orders = Vec::new();
        if schedule.is_empty() {
            return orders;
        }
        if traffic.sees_ego {
            let heading = self.road.at(ego.s_m, ego.d_m).heading_rad;
            self.spans.update(ego, &self.geometry, &self.map, heading, 0.0);
        }
        if self.stage.update(schedule, time_s, &self.spans) {
            for lane in &self.network.lanes {
                let Some((from_m, to_m)) = lane.stretch_m(&self.road) else { continue };
                let middle_m = 0.5 * (from_m + to_m);
                let of_lane =
                    |i: &&Incident| i.kind == IncidentKind::ClosedLane && lane.is_of(i.lane);
                if !schedule.incidents.iter().any(|i| of_lane(&i)) {
                    continue;
                }
                let is_closed = self.stage.closures(schedule).any(|(_, track, from_m, to_m)| {
                    lane.is_of(track) && from_m < middle_m && middle_m < to_m
                });
                let closed_to = if is_closed { vec!["all".to_owned()] } else { Vec::new() };
                orders.push((lane.id.clone(), var::DISALLOWED, Value::Texts(closed_to)));
            }
        }
        let limit_m_s = schedule.limit_m_s(time_s).unwrap_or(f64::INFINITY);
        if limit_m_s != self.limit_m_s {
            self.limit_m_s = limit_m_s;
            let limit_m_s = limit_m_s.min(traffic.max_speed_m_s);
            for lane in &self.network.lanes {
                let value = Value::Double(lane.speed_m_s.min(limit_m_s));
                orders.push((lane.id.clone(), var::MAX_SPEED, value));
            }
        }
        orders
    }

    /// Front bumper and heading of the ghost, if the ego reaches into a second lane.
    fn ghost_place(&mut self, ego: &EgoState) -> Option<(f64, f64, f64)> {
        let heading = self.road.at(ego.s_m, ego.d_m).heading_rad;
        self.spans.update(ego, &self.geometry, &self.map, heading, 0.0);
        let front = self.geometry.front_m;
        let d_front = ego.d_m + front * libm::sin(ego.yaw_rad - heading);
        let own = self.road.lane_at(ego.s_m + front, d_front);
        let span = self.spans.spans().iter().find(|span| Some(span.lane) != own)?;
        let d = self.road.lanes().get(usize::from(span.lane))?.center_d_m(span.front_m);
        let at = self.road.at(span.front_m, d);
        Some((at.x_m, at.y_m, at.heading_rad))
    }
}

/// Yaw (rad, counter-clockwise from x) as SUMO's angle (degrees, clockwise from north).
fn sumo_angle_deg(yaw_rad: f64) -> f64 {
    let turn = 90.0 - yaw_rad.to_degrees();
    turn - 360.0 * libm::floor(turn / 360.0)
}

/// The value of an `add` for the ego and its ghost: they are moved in the same message. With
/// another speed they would have that one for their first step, and who is behind them would brake
/// for it.
fn add_ego(speed_m_s: f64) -> Value {
    let speed = format!("{:.3}", speed_m_s.max(0.0));
    let texts =
        [EGO_ROUTE, EGO, "now", "first", "base", &speed, "current", "max", "current", "", "", ""];
    let mut list: Vec<Value> = texts.iter().map(|t| Value::Text((*t).to_owned())).collect();
    list.extend([Value::Int(0), Value::Int(0)]);
    Value::Compound(list)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_becomes_degrees_clockwise_from_north() {
        for (yaw_rad, degrees) in
            [(0.0, 90.0), (core::f64::consts::FRAC_PI_2, 0.0), (core::f64::consts::PI, 270.0)]
        {
            assert!((sumo_angle_deg(yaw_rad) - degrees).abs() < 1e-9, "{yaw_rad}");
        }
    }
}
