//! Service brakes with discs that heat by the force they really make, and a retarder that nobody
//! told the truck file about.

use super::super::effects::Shape;
use super::super::sheet::{AXLE, Figures, RADIUS_M};

use super::colour::{knee, towards};
use super::faults::{Faults, Moment};

/// Heat that the discs hold, J/K.
const DISCS_J_K: f64 = 190e3;

/// Brakes of one drive.
pub(crate) struct Brakes {
    pub(crate) pressure_kpa: f64,
    /// Discs over the air, K.
    disc_k: f64,
    /// Linings over the air, K.
    lining_k: f64,
    late: f64,
    filled: f64,
    oil_k: f64,
    coasting_s: f64,
    gain: Option<(f64, Shape)>,
    fade: Option<(f64, Shape)>,
    delay: Option<(f64, Shape)>,
    retarder: Option<(f64, Shape)>,
}

impl Brakes {
    pub(crate) fn new(faults: &Faults) -> Self {
        Self {
            pressure_kpa: 0.0,
            disc_k: 0.0,
            lining_k: 0.0,
            late: 0.0,
            filled: 0.0,
            oil_k: 0.0,
            coasting_s: 0.0,
            gain: faults.get("brake_gain"),
            fade: faults.get("brake_fade"),
            delay: faults.get("brake_delay"),
            retarder: faults.get("hidden_retarder"),
        }
    }

    /// Dead time of the demand, s: a part of the hidden delay is a filter.
    pub(crate) fn dead_s(&self, f: &Figures) -> f64 {
        f.brake_delay_s + self.delay.map_or(0.0, |(x, shape)| x * shape.at(0, 0.5, 1.0))
    }

    /// Builds up pressure for `xbr` m/s² of a dead time ago, `pressure` is a factor on it; returns
    /// the force of the brakes, `friction` a factor on theirs, N.
    pub(crate) fn act(
        &mut self,
        f: &Figures,
        (xbr, sheet_kg): (f64, f64),
        (pressure, friction): (f64, f64),
        now: &Moment,
        dt: f64,
    ) -> f64 {
        let tau = self.delay.map_or(0.0, |(x, shape)| x * (1.0 - shape.at(0, 0.5, 1.0)));
        towards(&mut self.late, xbr, dt, tau);
        let asked = self.late * sheet_kg / 400.0 * pressure;
        let step = (asked - self.pressure_kpa) * (1.0 - (-dt / 0.15_f64).exp());
        self.pressure_kpa = (self.pressure_kpa + step.clamp(-1000.0 * dt, 500.0 * dt)).max(0.0);
        let mut force = 400.0 * self.pressure_kpa * f.brake_scale * friction;
        if let Some((x, shape)) = self.gain {
            // One axle's brakes, which take their part from a pressure on.
            let share =
                shape.at(0, -0.25, 0.25) * ((self.pressure_kpa - 60.0) / 60.0).clamp(-1.0, 1.0);
            force *= 1.0 + x * (1.0 + share);
        }
        if let Some((x, shape)) = self.fade {
            // Friction that falls exponentially beyond a knee of the lining's temperature.
            let over = knee(
                now.air_degc + self.lining_k - shape.at(0, 95.0, 190.0),
                shape.at(1, 3.0, 25.0),
            );
            force *= (-0.01 * x * over).exp();
        }
        // The heat is that of the force which the faded linings make; air over the discs cools.
        let cooling = (0.45 + 0.55 * now.speed / 20.0) / 620.0;
        self.disc_k += dt * (force * now.speed / DISCS_J_K - self.disc_k * cooling);
        let disc = self.disc_k;
        towards(&mut self.lining_k, disc, dt, self.fade.map_or(20.0, |s| s.1.at(2, 2.0, 40.0)));
        force
    }

    /// Force of the hidden retarder, N: the torque that it states at 15 m/s with cold oil.
    pub(crate) fn retard(&mut self, now: &Moment, dt: f64) -> f64 {
        let Some((x, shape)) = self.retarder else { return 0.0 };
        let free = now.pedal < 0.01 && now.stage <= 0.0 && now.xbr <= 0.0;
        self.coasting_s = if now.pedal < 0.01 { self.coasting_s + dt } else { 0.0 };
        let goal = match shape.choice(0, 4) {
            // With the engine brake's lever, in its own four stages.
            0 => (4.0 * now.stage).ceil() / 4.0,
            // Holds the truck on slopes once the foot has been away for a while.
            1 => {
                f64::from(u8::from(self.coasting_s > 1.5 && now.grade < -0.008 && now.speed > 7.0))
            }
            // Blends in before the service brakes.
            2 => (now.xbr / shape.at(1, 0.4, 1.0)).min(1.0).powf(0.7),
            // Whenever the foot is away, driven by the road or braked.
            _ => f64::from(u8::from(
                now.pedal < 0.01 && (now.speed > shape.at(1, 4.0, 9.0) || !free),
            )),
        };
        // Oil fills and drains.
        let tau = if goal > self.filled { 0.6 } else { 0.3 };
        towards(&mut self.filled, goal, dt, tau);
        // The hydrodynamic rise at low speed, the limit of power at high speed.
        let rise = (now.speed / 6.0).min(1.0).powi(2);
        let fall = (shape.at(2, 17.0, 24.0) / now.speed.max(1.0)).min(1.0);
        let hot = 1.0 - 0.15 * (self.oil_k / 60.0).min(1.0);
        let force = self.filled * x * AXLE / RADIUS_M * rise * fall * hot;
        self.oil_k += dt * (force * now.speed / 900e3 - self.oil_k / 240.0);
        force
    }
}
