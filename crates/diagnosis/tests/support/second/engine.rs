//! Engine: torque that builds up with the exhaust's energy, what takes power from it, how hot it
//! gets, and what it drinks.

use rand_chacha::ChaCha8Rng;

use super::super::effects::Shape;
use super::super::sheet::{Figures, RPM, engine_brake, friction, full_load};

use super::colour::{Colour, knee, towards};
use super::faults::{Faults, Moment};

/// Slow errors of the torque that the engine reports: part of it, and Nm.
const DRIFT: [f64; 2] = [0.004, 4.0];

/// Engine of one drive.
pub(crate) struct Engine {
    /// Indicated torque, Nm.
    pub(crate) torque_nm: f64,
    pub(crate) coolant_degc: f64,
    oil_degc: f64,
    charge_degc: f64,
    thermostat: f64,
    fan: f64,
    held: f64,
    drift: [Colour; 2],
    lag: Option<(f64, Shape)>,
    fan_load: Option<(f64, Shape)>,
    friction: Option<(f64, Shape)>,
    altitude: Option<(f64, Shape)>,
    heat: Option<(f64, Shape)>,
    fuel: Option<(f64, Shape)>,
    brake: Option<(f64, Shape)>,
}

impl Engine {
    pub(crate) fn new(faults: &Faults, rng: &mut ChaCha8Rng) -> Self {
        Self {
            torque_nm: 0.0,
            coolant_degc: 78.0,
            oil_degc: 70.0,
            charge_degc: 0.0,
            thermostat: 0.1,
            fan: 0.0,
            held: 0.0,
            drift: [Colour::new(180.0, rng), Colour::new(45.0, rng)],
            lag: faults.get("turbo_lag"),
            fan_load: faults.get("fan_load"),
            friction: faults.get("engine_friction"),
            altitude: faults.get("altitude_derate"),
            heat: faults.get("heat_derate"),
            fuel: faults.get("fuel_map_low_load"),
            brake: faults.get("engine_brake_torque"),
        }
    }

    /// Builds up towards what the pedal demands; `demand` is a factor on that.
    pub(crate) fn burn(
        &mut self,
        f: &Figures,
        pedal: f64,
        closed: f64,
        demand: f64,
        now: &Moment,
        dt: f64,
    ) {
        let mut full = full_load(now.rpm);
        if let Some((x, shape)) = self.altitude {
            // The turbocharger runs out of speed: softly, and more at high engine speed.
            let over = knee(now.altitude_m - shape.at(0, 800.0, 1600.0), shape.at(1, 60.0, 250.0));
            let fast = 1.0 + shape.at(2, 0.0, 0.4) * (now.rpm / 1250.0 - 1.0);
            full *= (1.0 - x * 1e-3 * over * fast).max(0.4);
        }
        if let Some((x, shape)) = self.heat {
            // By the air, softly; or by the coolant, slowly.
            let over = if shape.choice(0, 2) == 0 {
                knee(now.air_degc - shape.at(1, 23.0, 31.0), shape.at(2, 0.5, 2.5))
            } else {
                knee(self.coolant_degc - shape.at(1, 93.0, 99.0), 0.7)
            };
            towards(&mut self.charge_degc, over, dt, shape.at(3, 5.0, 60.0));
            full *= (1.0 - 0.1 * x * self.charge_degc).max(0.4);
        }
        let wanted = pedal * (full + friction(now.rpm)) * demand * closed;
        let tau = if wanted > self.torque_nm {
            let boosted = if self.torque_nm > f.boost_from * full { f.boost_lag_s } else { 0.15 };
            // Little exhaust at low engine speed: it takes longer there.
            let more = self.lag.map_or(0.0, |(x, shape)| {
                let part = self.torque_nm / full.max(100.0) - shape.at(0, 0.27, 0.43);
                let gate = 1.0 / (1.0 + (-part / shape.at(1, 0.01, 0.06)).exp());
                x * gate * (1250.0 / now.rpm).powf(shape.at(2, 0.0, 1.0))
            });
            boosted + more
        } else {
            0.15
        };
        towards(&mut self.torque_nm, wanted, dt, tau.max(0.02));
    }

    /// Torque on the crank of everything but combustion, Nm.
    pub(crate) fn losses(&mut self, f: &Figures, now: &Moment, dt: f64) -> f64 {
        let turning = now.rpm / RPM;
        let mut rubbing = friction(now.rpm) * f.friction_scale;
        if let Some((x, shape)) = self.friction {
            let cold = shape.at(0, 0.0, 0.02) * (88.0 - self.oil_degc);
            let fast = (now.rpm / 1200.0).powf(shape.at(1, -0.5, 0.5));
            rubbing += friction(now.rpm) * x * fast * (1.0 + cold);
        }
        let mut fan_nm = 0.0;
        if let Some((x, shape)) = self.fan_load {
            // Viscous clutch: oil fills slowly, between two temperatures; the fan's power grows
            // with engine speed about x kW at 1300 rpm.
            let from = shape.at(0, 90.0, 96.0);
            let goal = ((self.coolant_degc - from) / shape.at(1, 2.0, 6.0)).clamp(0.0, 1.0);
            let tau = if goal > self.fan { 6.0 } else { shape.at(2, 8.0, 25.0) };
            towards(&mut self.fan, goal, dt, tau);
            let power_kw = x * self.fan * (now.rpm / 1300.0).powf(shape.at(3, 0.0, 1.5));
            fan_nm = 1e3 * power_kw / turning.max(50.0);
        }
        // The engine brake's charge builds up.
        let scale = self
            .brake
            .map_or(1.0, |(x, shape)| 1.0 + x * (1.0 + shape.at(0, -0.4, 0.4) * (now.stage - 0.5)));
        towards(
            &mut self.held,
            now.stage * scale,
            dt,
            self.brake.map_or(1e-3, |b| b.1.at(1, 0.05, 0.4)),
        );
        let held = self.held * engine_brake(now.rpm) * f.engine_brake_scale;
        rubbing + fan_nm + held + f.auxiliary_w / turning.max(50.0)
    }

    /// Heats and cools.
    pub(crate) fn warm(&mut self, now: &Moment, dt: f64) {
        let heat_w = 7e3 + 0.40 * self.torque_nm * now.rpm / RPM;
        let goal = ((self.coolant_degc - 83.0) / 11.0).clamp(0.04, 1.0);
        towards(&mut self.thermostat, goal, dt, 12.0);
        let away_w =
            self.thermostat * (1250.0 + 38.0 * now.speed) * (self.coolant_degc - now.air_degc);
        self.coolant_degc += dt * (heat_w - away_w) / 260e3;
        let oil = self.coolant_degc + 6.0;
        towards(&mut self.oil_degc, oil, dt, 400.0);
    }

    /// Fuel rate, g/s.
    pub(crate) fn fuel(&self, f: &Figures, rpm: f64) -> f64 {
        let island = self.fuel.map_or(0.0, |(x, shape)| {
            // An island of the map: below a torque, more at some engine speeds than at others.
            let load = self.torque_nm / shape.at(0, 500.0, 1100.0);
            let z = (rpm - shape.at(1, 950.0, 1450.0)) / 450.0;
            x * (-load.powf(shape.at(2, 1.2, 3.0))).exp()
                * (1.0 - shape.at(3, 0.0, 0.3) * z * z).max(0.3)
        });
        let sheet = 0.05 + 0.000_12 * rpm + 0.0505 * self.torque_nm * rpm / 9549.3;
        sheet * f.fuel_scale * (1.0 + island)
    }

    /// What the engine reports, percent of 2700 Nm; advances the drift.
    pub(crate) fn reported(&mut self, rng: &mut ChaCha8Rng, dt: f64) -> f64 {
        let scale = 1.0 + DRIFT[0] * self.drift[0].step(dt, rng);
        let more = DRIFT[1] * self.drift[1].step(dt, rng);
        // Without fuel there is nothing to be wrong about.
        let burning = (self.torque_nm / 100.0).min(1.0);
        (self.torque_nm * scale + burning * more) / 27.0
    }
}
