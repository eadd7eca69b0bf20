//! One vehicle ahead that drives a given speed over time: a jam, a cut-in's aftermath, a recorded
//! lead. It takes no notice of the truck.

use road::Road;
use tractrix_core::{EgoState, Neighbour, Scene, Time, TrafficSource, VehicleClass};

/// Length and width of the vehicle, m.
const BODY_M: (f64, f64) = (4.8, 1.9);

/// The vehicle, as a source of traffic.
#[derive(Debug, Clone)]
pub struct LeadVehicle {
    speeds_m_s: Vec<f64>,
    step_s: f64,
    lane: u16,
    d_m: f64,
    now: Time,
    rear_s_m: f64,
    scene: Scene,
}

impl LeadVehicle {
    /// A vehicle with its rear bumper at `rear_s_m` in the middle of a lane, whose speed goes
    /// linearly through `speeds_m_s`, `step_s` apart, and stays at the last one. Speeds below zero
    /// and non-finite ones count as zero; a lane that does not exist is the reference line.
    #[must_use]
    pub fn new(road: &Road, lane: u16, rear_s_m: f64, step_s: f64, speeds_m_s: &[f64]) -> Self {
        let d_m = road.lanes().get(usize::from(lane)).map_or(0.0, |l| l.center_d_m(rear_s_m));
        Self {
            speeds_m_s: speeds_m_s
                .iter()
                .map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 })
                .collect(),
            step_s: step_s.max(1e-3),
            lane,
            d_m,
            now: Time::ZERO,
            rear_s_m,
            scene: Scene { neighbours: vec![Neighbour::default()], ..Scene::default() },
        }
    }

    /// Speed, m/s, and acceleration, m/s², at a time.
    #[must_use]
    pub fn at(&self, time_s: f64) -> (f64, f64) {
        let last = self.speeds_m_s.last().copied().unwrap_or(0.0);
        let x = (time_s / self.step_s).max(0.0);
        let i = x as usize;
        match (self.speeds_m_s.get(i), self.speeds_m_s.get(i + 1)) {
            (Some(a), Some(b)) => (a + (x - i as f64) * (b - a), (b - a) / self.step_s),
            _ => (last, 0.0),
        }
    }
}

impl TrafficSource for LeadVehicle {
    type Error = core::convert::Infallible;

    fn advance(&mut self, now: Time, _ego: &EgoState) -> Result<&Scene, Self::Error> {
        let (before, _) = self.at(self.now.seconds());
        let (speed_m_s, accel_m_s2) = self.at(now.seconds());
        self.rear_s_m += 0.5 * (before + speed_m_s) * now.seconds_since(self.now);
        self.now = now;
        self.scene.time = now;
        if let Some(n) = self.scene.neighbours.first_mut() {
            *n = Neighbour {
                id: 1,
                class: VehicleClass::Car,
                front_s_m: self.rear_s_m + BODY_M.0,
                rear_s_m: self.rear_s_m,
                d_m: self.d_m,
                width_m: BODY_M.1,
                speed_m_s,
                accel_m_s2,
                lane: self.lane,
                ..Neighbour::default()
            };
        }
        Ok(&self.scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_drives_the_area_under_its_speeds_and_goes_on_at_the_last_one() {
        let road = road::builtin::flat(1_000.0);
        let mut lead = LeadVehicle::new(&road, 0, 100.0, 2.0, &[10.0, 0.0, 4.0]);
        let ego = EgoState::default();
        let rear = |t: f64, lead: &mut LeadVehicle| {
            lead.advance(Time::from_seconds(t), &ego).unwrap().neighbours[0]
        };
        for i in 1..=400 {
            rear(f64::from(i) * 0.01, &mut lead);
        }
        let n = rear(4.0, &mut lead);
        assert!((n.rear_s_m - 114.0).abs() < 1e-6, "{}", n.rear_s_m);
        let n = rear(5.0, &mut lead);
        assert!((n.rear_s_m - 118.0).abs() < 1e-6 && n.speed_m_s == 4.0 && n.accel_m_s2 == 0.0);
    }
}
