//! What SUMO shows: the vehicles around the eye, brought onto our road.
//!
//! SUMO gives the middle of the front bumper in the map, an angle and a speed; length, width and
//! type are asked for once per vehicle. Heights and lanes come from our road.

use road::Road;
use tractrix_core::{Neighbour, VehicleClass};

use super::codec::Value;
use super::demand::{EGO, GHOST, class_of};
use super::error::SumoError;
use super::session::{Answer, Seen, id, var};
use super::source::SumoTraffic;

/// What does not change about a vehicle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Body {
    known: bool,
    hidden: bool,
    class: VehicleClass,
    length_m: f64,
    width_m: f64,
    /// Last station, m: where to look next.
    hint_s_m: Option<f64>,
}

impl SumoTraffic {
    /// Learns the bodies of vehicles that were not seen before.
    pub(super) fn learn(&mut self) -> Result<(), SumoError> {
        let Some(link) = self.link.as_mut() else { return Ok(()) };
        let mut new = Vec::new();
        for seen in &link.session.seen {
            let k = seen.handle as usize;
            if self.bodies.len() <= k {
                self.bodies.resize(k + 1, Body::default());
            }
            if self.bodies.get(k).is_some_and(|body| !body.known) {
                new.push(seen.handle);
            }
        }
        if new.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = new.iter().map(|&h| link.session.name(h).to_owned()).collect();
        let kept = std::mem::take(&mut link.session.seen);
        let request = link.session.request();
        for name in &names {
            for variable in [var::LENGTH, var::WIDTH, var::TYPE] {
                request.get(id::VEHICLE, variable, name);
            }
        }
        let result = link.exchange("bodies");
        link.session.seen = kept;
        result?;
        for (k, (&handle, name)) in new.iter().zip(&names).enumerate() {
            let answers = link.session.answers.get(3 * k..3 * k + 3).unwrap_or_default();
            let [
                Answer::Value(Value::Double(length_m)),
                Answer::Value(Value::Double(width_m)),
                Answer::Value(Value::Text(type_id)),
            ] = answers
            else {
                continue;
            };
            if let Some(body) = self.bodies.get_mut(handle as usize) {
                *body = Body {
                    known: true,
                    hidden: name == EGO || name == GHOST,
                    class: class_of(type_id, *length_m),
                    length_m: *length_m,
                    width_m: *width_m,
                    hint_s_m: None,
                };
            }
        }
        Ok(())
    }

    /// Brings what SUMO shows onto our road.
    pub(super) fn take_over(&mut self) {
        self.at_step.clear();
        let Some(link) = &self.link else { return };
        for seen in &link.session.seen {
            let Some(body) = self.bodies.get_mut(seen.handle as usize) else { continue };
            if body.known
                && !body.hidden
                && let Some(neighbour) = neighbour(seen, body, &self.road)
            {
                self.at_step.push(neighbour);
            }
        }
    }
}

/// A vehicle as SUMO shows it, on our road; `None` if it is on another one.
fn neighbour(seen: &Seen, body: &mut Body, road: &Road) -> Option<Neighbour> {
    let yaw_rad = core::f64::consts::FRAC_PI_2 - seen.angle_deg.to_radians();
    let (sin, cos) = (libm::sin(yaw_rad), libm::cos(yaw_rad));
    let half = 0.5 * body.length_m;
    let (x_m, y_m) = (seen.x_m - half * cos, seen.y_m - half * sin);
    let at = road.project(x_m, y_m, body.hint_s_m)?;
    let heading = road.at(at.s_m, at.d_m).heading_rad;
    let lane = road.lane_at(at.s_m, at.d_m);
    if libm::cos(yaw_rad - heading) < 0.5 {
        body.hint_s_m = None;
        return None;
    }
    let Some(lane) = lane else {
        body.hint_s_m = None;
        return None;
    };
    body.hint_s_m = Some(at.s_m);
    let centre = road.lanes().get(usize::from(lane))?.center_d_m(at.s_m);
    let lateral = seen.lateral_speed_m_s;
    let target_lane = match (lateral, at.d_m - centre) {
        (v, off) if v > 0.05 && off > 0.0 => road.left_of(lane, at.s_m),
        (v, off) if v < -0.05 && off < 0.0 => road.right_of(lane, at.s_m),
        _ => None,
    };
    Some(Neighbour {
        id: u64::from(seen.handle),
        class: body.class,
        front_s_m: at.s_m + half,
        rear_s_m: at.s_m - half,
        d_m: at.d_m,
        width_m: body.width_m,
        speed_m_s: seen.speed_m_s,
        lateral_speed_m_s: lateral,
        accel_m_s2: seen.accel_m_s2,
        lane,
        target_lane,
        x_m,
        y_m,
        yaw_rad,
    })
}
