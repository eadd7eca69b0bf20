//! Automated gearbox: shifts by the acceleration that the next gear leaves, phases of the sheet.

use rand_chacha::ChaCha8Rng;

use super::super::effects::Shape;
use super::super::random::{between, normal};
use super::super::sheet::{AXLE, GEARS, RADIUS_M, RPM};

use super::colour::towards;
use super::faults::{Faults, Moment};

/// Torque down, open, torque up, s.
const PHASES_S: [f64; 3] = [0.25, 0.45, 0.30];

/// Gear, engine speed and the present shift.
pub(crate) struct Gearbox {
    pub(crate) gear: usize,
    pub(crate) rpm: f64,
    goal: usize,
    phase_s: Option<f64>,
    phases_s: [f64; 3],
    rest_s: f64,
    eco_rpm: f64,
    slow: Option<(f64, Shape)>,
}

impl Gearbox {
    pub(crate) fn new(faults: &Faults, rng: &mut ChaCha8Rng) -> Self {
        Self {
            gear: 1,
            rpm: 600.0,
            goal: 1,
            phase_s: None,
            phases_s: PHASES_S,
            rest_s: 0.0,
            eco_rpm: between(rng, 1090.0, 1190.0),
            slow: faults.get("shift_duration"),
        }
    }

    pub(crate) fn shifting(&self) -> bool {
        self.phase_s.is_some()
    }

    /// Crank angle per way, rad/m.
    pub(crate) fn per_m(&self) -> f64 {
        GEARS[self.gear - 1] * AXLE / RADIUS_M
    }

    /// Part of the torque that passes.
    pub(crate) fn closed(&self) -> f64 {
        let [down, open, up] = self.phases_s;
        self.phase_s.map_or(1.0, |t| {
            if t < down { 1.0 - t / down } else { ((t - down - open) / up).clamp(0.0, 1.0) }
        })
    }

    fn rpm_in(gear: usize, v: f64) -> f64 {
        v * GEARS[gear - 1] * AXLE / RADIUS_M * RPM
    }

    /// Goes on by `dt`; `extra_s` lengthens a shift that begins now.
    pub(crate) fn turn(&mut self, now: &Moment, extra_s: f64, rng: &mut ChaCha8Rng, dt: f64) {
        self.rest_s += dt;
        match self.phase_s {
            Some(t) => {
                if t + dt >= self.phases_s[0] {
                    self.gear = self.goal;
                }
                self.phase_s = (t + dt < self.phases_s.iter().sum()).then_some(t + dt);
                if self.phase_s.is_none() {
                    self.rest_s = 0.0;
                }
            }
            None => {
                let goal = self.wish(now);
                if goal != self.gear && self.rest_s > 1.2 {
                    self.begin(goal, extra_s, rng);
                }
            }
        }
        let turning = Self::rpm_in(self.gear, now.speed).max(600.0);
        if self.closed() > 0.0 {
            self.rpm = turning;
        } else {
            towards(&mut self.rpm, turning, dt, 0.1);
        }
    }

    fn begin(&mut self, goal: usize, extra_s: f64, rng: &mut ChaCha8Rng) {
        let spread = (1.0 + 0.05 * normal(rng)).max(0.5);
        let mut extra = extra_s;
        if let Some((x, shape)) = self.slow {
            // Worn synchronisation: longer on the way down, and never twice the same.
            let way = shape.at(0, 0.0, 0.25) * if goal < self.gear { 1.0 } else { -1.0 };
            extra += x * (1.0 + way) * (1.0 + 0.15 * normal(rng)).max(0.2);
        }
        let open = self.slow.map_or(0.5, |s| s.1.at(1, 0.4, 1.0));
        self.phases_s = PHASES_S.map(|p| p * spread);
        self.phases_s[0] = (self.phases_s[0] + 0.5 * (1.0 - open) * extra).max(0.05);
        self.phases_s[1] = (self.phases_s[1] + open * extra).max(0.05);
        self.phases_s[2] = (self.phases_s[2] + 0.5 * (1.0 - open) * extra).max(0.05);
        self.goal = goal;
        self.phase_s = Some(0.0);
    }

    /// The gear that is wanted: near the economic speed, higher under load, high when braking.
    fn wish(&self, now: &Moment) -> usize {
        let slowing = now.stage > 0.0 || now.xbr > 0.0;
        let aim = self.eco_rpm + 260.0 * now.pedal + if slowing { 330.0 } else { 0.0 };
        let (low, high) = (aim - 140.0, aim + 230.0);
        let mut gear = self.gear;
        if self.rpm > high {
            while gear < 12
                && gear < self.gear + 2
                && Self::rpm_in(gear + 1, now.speed) > low + 40.0
            {
                gear += 1;
            }
        } else if self.rpm < low {
            while gear > 1 && Self::rpm_in(gear, now.speed) < low {
                gear -= 1;
            }
        }
        gear
    }
}
