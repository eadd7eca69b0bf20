//! Force balance in weak form: the change of speed over one second minus the integral of the
//! modelled acceleration, driven by measured torque, engine speed, gear, pressure and speed. No
//! measured signal is differentiated.

use tractrix_core::{GRAVITY_M_S2, RPM_PER_RAD_S};

use super::prepared::{Prepared, at_index, running_sum};
use crate::param::{P, Theta};
use crate::{Drive, Plant};

/// Samples that a speed at a window's end is averaged over (two 10 Hz messages).
pub(super) const EDGE: usize = 4;

pub(super) fn residual(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let valid = &d.valid[super::Module::Force as usize];
    let acceleration = acceleration(d, plant, t, None);
    let sum = running_sum(acceleration.iter().map(|a| a * Drive::STEP_S));
    let lag = t[P::SpeedLag as usize] / Drive::STEP_S;
    let scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    weak_form(valid, &d.speed, scale, &sum, lag)
}

/// Measured change of the quantity over a second minus the change of `sum`.
pub(super) fn weak_form(
    valid: &[bool],
    speed: &[f64],
    scale: f64,
    sum: &[f64],
    lag: f64,
) -> Vec<f64> {
    let edge = |x: &[f64], i: usize, shift: f64| {
        (0..EDGE).map(|j| at_index(x, (i + j) as f64 - shift)).sum::<f64>() / EDGE as f64
    };
    valid
        .iter()
        .enumerate()
        .map(|(k, ok)| {
            if !ok {
                return 0.0;
            }
            let (a, b) = (k * 20, (k + 1) * 20);
            let measured = (edge(speed, b, 0.0) - edge(speed, a, 0.0)) * scale;
            measured - (edge(sum, b, lag) - edge(sum, a, lag))
        })
        .collect()
}

/// Modelled acceleration of every sample, m/s². With `only`, samples outside it are left at zero.
pub(crate) fn acceleration(
    d: &Prepared,
    plant: &Plant,
    t: &Theta,
    speed: Option<&[f64]>,
) -> Vec<f64> {
    let model = Longitudinal::new(d, plant, t);
    let mut slow = Slow::default();
    let scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    (0..d.n)
        .map(|i| {
            let v = speed.map_or(d.speed[i] * scale, |s| s[i]);
            model.acceleration(i, v, &mut slow)
        })
        .collect()
}

/// Longitudinal balance of one drive with its parameters unpacked.
pub(crate) struct Longitudinal<'a> {
    d: &'a Prepared,
    plant: &'a Plant,
    t: &'a Theta,
    mass: f64,
    per_gear: Vec<(f64, f64)>,
    cd_a: f64,
    rolling: f64,
    shift_m: f64,
    wind: [f64; 2],
    cold: f64,
    cooling: f64,
    hot_brakes: bool,
    pressure_lag: f64,
}

/// What the balance remembers from sample to sample.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Slow {
    /// Heating of the brakes above the air, K.
    brake_k: f64,
    /// How far the fan is on, 0 to 1.
    fan: f64,
    /// Extra rolling resistance of cold tyres, relative.
    cold: f64,
}

impl<'a> Longitudinal<'a> {
    pub(crate) fn new(d: &'a Prepared, plant: &'a Plant, t: &'a Theta) -> Self {
        let mass = d.mass_kg * (1.0 + t[P::Mass as usize]);
        let r = plant.wheel_radius_m;
        let per_gear = core::iter::once(0.0)
            .chain(plant.gear_ratios.iter().map(|g| g * plant.final_drive_ratio))
            .map(|i| {
                let inertia = plant.wheel_inertia_kg_m2 + plant.engine_inertia_kg_m2 * i * i;
                (i / r, mass + inertia / (r * r))
            })
            .collect();
        Self {
            mass,
            per_gear,
            cd_a: plant.cd_a_m2 * (1.0 + t[P::Drag as usize]),
            rolling: plant.rolling_coeff * (1.0 + t[P::Rolling as usize]),
            shift_m: t[P::MapShift as usize],
            wind: [t[P::WindX as usize], t[P::WindY as usize]],
            cold: if d.warm { 0.0 } else { t[P::WarmupAmp as usize] },
            cooling: (-Drive::STEP_S / (1800.0 * t[P::WarmupTau as usize].exp())).exp(),
            hot_brakes: t[P::Fade as usize] != 0.0,
            pressure_lag: t[P::PressureLag as usize] / Drive::STEP_S,
            d,
            plant,
            t,
        }
    }

    /// Acceleration at sample `i` at speed `v`, m/s; `slow` is carried from sample to sample.
    #[inline]
    pub(crate) fn acceleration(&self, i: usize, v: f64, slow: &mut Slow) -> f64 {
        let (d, p, t) = (self.d, self.plant, self.t);
        let gear = if d.gear[i] < self.per_gear.len() { d.gear[i] } else { 0 };
        let (per_m, inertia) = self.per_gear[gear];
        let n = d.rpm[i];
        let omega = (n / RPM_PER_RAD_S).max(20.0);
        let indicated =
            d.torque[i] * 0.01 * p.reference_torque_nm * (1.0 + t[P::TorqueScale as usize]);
        let friction = (p.friction_nm[0] + p.friction_nm[1] * n) * (1.0 + t[P::Friction as usize]);
        let mut auxiliary_w = p.auxiliary_power_w;
        if t[P::FanPower as usize] != 0.0 {
            // Play between the two thresholds: on above the start, off below it by the width.
            let start = 97.0 + t[P::FanStart as usize];
            let over = d.coolant[i] - start;
            let (low, high) = (step(over, 0.7), step(over + t[P::FanWidth as usize], 0.7));
            slow.fan = slow.fan.clamp(low, high);
            auxiliary_w += 1e3 * t[P::FanPower as usize] * slow.fan;
        }
        let brake = d.engine_brake[i]
            * (p.engine_brake_nm[0] + p.engine_brake_nm[1] * n)
            * (1.0 + t[P::EngineBrakeScale as usize]);
        let net = indicated - friction - auxiliary_w / omega - brake;
        let eta = p.efficiency_frac * (1.0 - t[P::DrivelineLoss as usize]);
        let drive = net * per_m * if net > 0.0 { eta } else { 1.0 / eta };
        let grade = self.grade(i);
        // The cosine changes by less than 1e-3 of a grade error: the map's counts.
        let slope = d.slope[i];
        let mut rolling = self.rolling;
        if self.cold != 0.0 {
            slow.cold = if i == 0 { self.cold } else { slow.cold * self.cooling };
            rolling *= 1.0 + slow.cold;
        }
        let resistance = self.mass * GRAVITY_M_S2 * slope * (rolling + grade);
        let service = self.service_brake(i, v, &mut slow.brake_k);
        let per_prop = p.final_drive_ratio / p.wheel_radius_m;
        let coasting = d.pedal[i] < 0.01 && v > 8.0;
        let retarder = (t[P::RetarderStage as usize] * d.engine_brake[i]
            + if coasting { t[P::RetarderCoast as usize] } else { 0.0 })
            * per_prop
            + t[P::RetarderBrake as usize] * d.xbr[i];
        let force =
            drive - self.air(i, v) - resistance - service - retarder - t[P::DragBrake as usize];
        force / inertia
    }

    #[inline]
    fn grade(&self, i: usize) -> f64 {
        let bias = self.t[P::GradeBias as usize];
        if self.shift_m == 0.0 {
            self.d.grade[i] + bias
        } else {
            self.d.grade_by_s.at(self.d.s_map[i] + self.shift_m) + bias
        }
    }

    #[inline]
    fn air(&self, i: usize, v: f64) -> f64 {
        let (along, across) = air_speed(self.d, self.t, self.wind, i, v);
        if across == 0.0 {
            return 0.5 * self.d.density[i] * self.cd_a * along.abs() * along;
        }
        let speed2 = along * along + across * across;
        let yaw = (across / along.abs().max(1.0)).atan().to_degrees();
        0.5 * self.d.density[i]
            * self.cd_a
            * (1.0 + self.plant.drag_yaw_frac_per_deg * yaw.abs())
            * speed2.sqrt()
            * along
    }

    #[inline]
    fn service_brake(&self, i: usize, v: f64, brake_k: &mut f64) -> f64 {
        let p = self.plant;
        let pressure = at_index(&self.d.fine_pressure, i as f64 + self.pressure_lag);
        let mut force = p.brake_gain_n_kpa * pressure * (1.0 + self.t[P::BrakeGain as usize]);
        if self.hot_brakes {
            let start = 150.0 + self.t[P::FadeStart as usize];
            let temperature = *brake_k + self.d.ambient[i];
            let loss = self.t[P::Fade as usize] * 0.01 * (temperature - start).max(0.0);
            force *= (1.0 - loss).max(0.1);
            *brake_k += Drive::STEP_S
                * (p.brake_gain_n_kpa * pressure * v / p.brake_heat_capacity_j_k
                    - *brake_k / p.brake_cooling_s);
        }
        force
    }
}

/// Air speed relative to the truck: against the direction of travel, and to the left, m/s.
#[inline]
pub(super) fn air_speed(d: &Prepared, t: &Theta, wind: [f64; 2], i: usize, v: f64) -> (f64, f64) {
    let mut along = v + t[P::Headwind as usize];
    let mut across = t[P::Crosswind as usize];
    if wind != [0.0, 0.0] {
        let (sin, cos) = d.course[i];
        along -= wind[0] * cos + wind[1] * sin;
        across += wind[1] * cos - wind[0] * sin;
    }
    (along, across)
}

/// A step smoothed over `width`.
#[inline]
pub(super) fn step(x: f64, width: f64) -> f64 {
    1.0 / (1.0 + (-x / width).clamp(-40.0, 40.0).exp())
}
