//! Force balance in weak form: the change of speed over one second minus the integral of the
//! modelled acceleration, driven by measured torque, engine speed, gear, pressure and speed. No
//! measured signal is differentiated.

use std::sync::Arc;

use tractrix_core::{GRAVITY_M_S2, RPM_PER_RAD_S};

use super::prepared::{Prepared, at_index};
use super::profiles::Kind;
use crate::param::{P, Theta};
use crate::{Drive, Plant};

/// Samples that a speed at a window's end is averaged over (two 10 Hz messages).
pub(super) const EDGE: usize = 4;

/// Samples that are computed side by side.
pub(super) const BLOCK: usize = 128;

pub(super) fn residual(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let valid = &d.valid[super::Module::Force as usize];
    let model = Longitudinal::new(d, plant, t);
    let scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    let mut sum = d.profiles.scratch();
    sum.resize(d.balance.padded + 1, 0.0);
    let mut total = 0.0;
    for (at, sums) in (0..d.balance.padded).step_by(BLOCK).zip(sum[1..].chunks_exact_mut(BLOCK)) {
        let speed: [f64; BLOCK] = scaled(cut(&d.balance.speed, at), scale);
        for (a, s) in model.acceleration(at, &speed).iter().zip(sums) {
            total += a * Drive::STEP_S;
            *s = total;
        }
    }
    let lag = t[P::SpeedLag as usize] / Drive::STEP_S;
    let out = weak_form(valid, &d.speed, scale, &sum[..=d.n], lag);
    d.profiles.give_back(sum);
    out
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
    let left: Vec<f64> = (0..=valid.len())
        .map(|k| edge(speed, 20 * k, 0.0) * scale - edge(sum, 20 * k, lag))
        .collect();
    valid.iter().zip(left.windows(2)).map(|(ok, e)| if *ok { e[1] - e[0] } else { 0.0 }).collect()
}

/// What enters the balance and depends on no parameter, per sample, padded to whole blocks.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    padded: usize,
    speed: Vec<f64>,
    indicated_nm: Vec<f64>,
    friction_nm: Vec<f64>,
    auxiliary_nm: Vec<f64>,
    /// Torque per power at the crank, Nm/W.
    per_w: Vec<f64>,
    engine_brake_nm: Vec<f64>,
    /// Ratio engine to wheel over wheel radius, 1/m.
    ratio_1_m: Vec<f64>,
    rotating_kg: Vec<f64>,
    density: Vec<f64>,
    /// Weight's component into the road per mass, m/s².
    normal_m_s2: Vec<f64>,
    sin: Vec<f64>,
    cos: Vec<f64>,
    ambient: Vec<f64>,
    engine_brake_frac: Vec<f64>,
    xbr: Vec<f64>,
    /// 1 where the driver asks for nothing.
    coasts: Vec<f64>,
}

impl Inputs {
    pub(super) fn new(d: &Prepared, p: &Plant) -> Self {
        let r = p.wheel_radius_m;
        let per_gear: Vec<(f64, f64)> = core::iter::once(0.0)
            .chain(p.gear_ratios.iter().map(|g| g * p.final_drive_ratio))
            .map(|i| {
                let inertia = p.wheel_inertia_kg_m2 + p.engine_inertia_kg_m2 * i * i;
                (i / r, inertia / (r * r))
            })
            .collect();
        let gear = |i: usize| per_gear[if d.gear[i] < per_gear.len() { d.gear[i] } else { 0 }];
        let omega = |i: usize| (d.rpm[i] / RPM_PER_RAD_S).max(20.0);
        let padded = d.n.next_multiple_of(BLOCK);
        let of = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { pad((0..d.n).map(f), padded) };
        Self {
            padded,
            speed: of(&|i| d.speed[i]),
            indicated_nm: of(&|i| d.torque[i] * 0.01 * p.reference_torque_nm),
            friction_nm: of(&|i| p.friction_nm[0] + p.friction_nm[1] * d.rpm[i]),
            auxiliary_nm: of(&|i| p.auxiliary_power_w / omega(i)),
            per_w: of(&|i| 1.0 / omega(i)),
            engine_brake_nm: of(&|i| {
                d.engine_brake[i] * (p.engine_brake_nm[0] + p.engine_brake_nm[1] * d.rpm[i])
            }),
            ratio_1_m: of(&|i| gear(i).0),
            rotating_kg: of(&|i| gear(i).1),
            density: of(&|i| d.density[i]),
            normal_m_s2: of(&|i| GRAVITY_M_S2 * d.slope[i]),
            sin: of(&|i| d.course[i].0),
            cos: of(&|i| d.course[i].1),
            ambient: of(&|i| d.ambient[i]),
            engine_brake_frac: of(&|i| d.engine_brake[i]),
            xbr: of(&|i| d.xbr[i]),
            coasts: of(&|i| if d.pedal[i] < 0.01 { 1.0 } else { 0.0 }),
        }
    }
}

/// A signal with its last value held up to `padded` samples.
fn pad(x: impl Iterator<Item = f64>, padded: usize) -> Vec<f64> {
    let mut x: Vec<f64> = x.collect();
    x.resize(padded, x.last().copied().unwrap_or(0.0));
    x
}

#[inline(always)]
fn cut<const L: usize>(x: &[f64], at: usize) -> &[f64; L] {
    x.get(at..).and_then(<[f64]>::first_chunk).unwrap_or(&[0.0; L])
}

/// One value per sample of a block; a loop, which the compiler makes wide.
#[inline(always)]
fn lanes<const L: usize>(f: impl Fn(usize) -> f64) -> [f64; L] {
    let mut out = [0.0; L];
    for (j, x) in out.iter_mut().enumerate() {
        *x = f(j);
    }
    out
}

#[inline(always)]
fn scaled<const L: usize>(x: &[f64; L], factor: f64) -> [f64; L] {
    lanes(|j| x[j] * factor)
}

/// Longitudinal balance of one drive with its parameters unpacked.
pub(crate) struct Longitudinal<'a> {
    d: &'a Inputs,
    mass_kg: f64,
    torque: f64,
    friction: f64,
    engine_brake: f64,
    fan_w: f64,
    efficiency: f64,
    cd_a_m2: f64,
    drag_yaw_1_rad: f64,
    wind: Wind,
    rolling: f64,
    cold: f64,
    grade_bias: f64,
    brake_n_kpa: f64,
    fade_1_k: f64,
    fade_start_c: f64,
    retarder: [f64; 3],
    parasitic_n: f64,
    grade: Arc<[f64]>,
    pressure: Arc<[f64]>,
    heat: Option<Arc<[f64]>>,
    fan: Option<Arc<[f64]>>,
    cold_left: Option<Arc<[f64]>>,
}

impl<'a> Longitudinal<'a> {
    pub(crate) fn new(d: &'a Prepared, plant: &Plant, t: &Theta) -> Self {
        let at = |p: P| t[p as usize];
        let per_prop = plant.final_drive_ratio / plant.wheel_radius_m;
        Self {
            d: &d.balance,
            mass_kg: d.mass_kg * (1.0 + at(P::Mass)),
            torque: 1.0 + at(P::TorqueScale),
            friction: 1.0 + at(P::Friction),
            engine_brake: 1.0 + at(P::EngineBrakeScale),
            fan_w: 1e3 * at(P::FanPower),
            efficiency: plant.efficiency_frac * (1.0 - at(P::DrivelineLoss)),
            cd_a_m2: plant.cd_a_m2 * (1.0 + at(P::Drag)),
            drag_yaw_1_rad: plant.drag_yaw_frac_per_deg.to_degrees(),
            wind: Wind::new(t),
            rolling: plant.rolling_coeff * (1.0 + at(P::Rolling)),
            cold: at(P::WarmupAmp),
            grade_bias: at(P::GradeBias),
            brake_n_kpa: plant.brake_gain_n_kpa * (1.0 + at(P::BrakeGain)),
            fade_1_k: 0.01 * at(P::Fade),
            fade_start_c: 150.0 + at(P::FadeStart),
            retarder: [
                at(P::RetarderStage) * per_prop,
                at(P::RetarderCoast) * per_prop,
                at(P::RetarderBrake),
            ],
            parasitic_n: at(P::DragBrake),
            grade: d.grade_shifted(at(P::MapShift)),
            pressure: pressure(d, at(P::PressureLag)),
            heat: (at(P::Fade) != 0.0).then(|| brake_heat(d, plant, t)),
            fan: (at(P::FanPower) != 0.0).then(|| fan(d, t)),
            cold_left: (at(P::WarmupAmp) != 0.0 && !d.warm).then(|| cold_left(d, t)),
        }
    }

    /// Acceleration of the samples from `at` on at speeds `v`, m/s.
    #[inline(always)]
    pub(crate) fn acceleration<const L: usize>(&self, at: usize, v: &[f64; L]) -> [f64; L] {
        let d = self.d;
        let (indicated, friction) = (cut::<L>(&d.indicated_nm, at), cut::<L>(&d.friction_nm, at));
        let (auxiliary, brake) = (cut::<L>(&d.auxiliary_nm, at), cut::<L>(&d.engine_brake_nm, at));
        let ratio = cut::<L>(&d.ratio_1_m, at);
        let mut net: [f64; L] = lanes(|j| {
            indicated[j] * self.torque
                - friction[j] * self.friction
                - auxiliary[j]
                - brake[j] * self.engine_brake
        });
        if let Some(fan) = &self.fan {
            let (fan, per_w) = (cut::<L>(fan, at), cut::<L>(&d.per_w, at));
            for j in 0..L {
                net[j] -= self.fan_w * fan[j] * per_w[j];
            }
        }
        let (eta, back) = (self.efficiency, 1.0 / self.efficiency);
        let mut force: [f64; L] =
            lanes(|j| net[j] * ratio[j] * if net[j] > 0.0 { eta } else { back });
        let air = self.air(at, v);
        let mut rolling = [self.rolling; L];
        if let Some(cold) = &self.cold_left {
            let cold = cut::<L>(cold, at);
            for j in 0..L {
                rolling[j] *= 1.0 + self.cold * cold[j];
            }
        }
        let (normal, grade) = (cut::<L>(&d.normal_m_s2, at), cut::<L>(&self.grade, at));
        for j in 0..L {
            // The cosine changes by less than 1e-3 of a grade error: the map's counts.
            let resistance = self.mass_kg * normal[j] * (rolling[j] + (grade[j] + self.grade_bias));
            force[j] -= air[j] + resistance;
        }
        let pressure = cut::<L>(&self.pressure, at);
        let mut service: [f64; L] = lanes(|j| self.brake_n_kpa * pressure[j]);
        if let Some(heat) = &self.heat {
            let (heat, ambient) = (cut::<L>(heat, at), cut::<L>(&d.ambient, at));
            for j in 0..L {
                let over = (heat[j] + ambient[j] - self.fade_start_c).max(0.0);
                service[j] *= (1.0 - self.fade_1_k * over).max(0.1);
            }
        }
        let (stage, xbr) = (cut::<L>(&d.engine_brake_frac, at), cut::<L>(&d.xbr, at));
        let (coasts, rotating) = (cut::<L>(&d.coasts, at), cut::<L>(&d.rotating_kg, at));
        let [on_stage, on_coast, on_brake] = self.retarder;
        lanes(|j| {
            let coasting = on_coast * coasts[j] * if v[j] > 8.0 { 1.0 } else { 0.0 };
            let retarder = on_stage * stage[j] + coasting + on_brake * xbr[j];
            (force[j] - service[j] - retarder - self.parasitic_n) / (self.mass_kg + rotating[j])
        })
    }

    #[inline(always)]
    fn air<const L: usize>(&self, at: usize, v: &[f64; L]) -> [f64; L] {
        let density = cut::<L>(&self.d.density, at);
        let (along, across) = self.wind.over(self.d, at, v);
        if self.wind.still() {
            return lanes(|j| 0.5 * density[j] * self.cd_a_m2 * along[j].abs() * along[j]);
        }
        let tan: [f64; L] = lanes(|j| across[j].abs() / along[j].abs().max(1.0));
        let yaw = arctangents(tan);
        lanes(|j| {
            0.5 * density[j]
                * self.cd_a_m2
                * (1.0 + self.drag_yaw_1_rad * yaw[j])
                * (along[j] * along[j] + across[j] * across[j]).sqrt()
                * along[j]
        })
    }
}

/// Wind as the parameters have it, m/s: along and across the truck, and over the map.
struct Wind {
    head: f64,
    to_left: f64,
    to: [f64; 2],
}

impl Wind {
    fn new(t: &Theta) -> Self {
        Self {
            head: t[P::Headwind as usize],
            to_left: t[P::Crosswind as usize],
            to: [t[P::WindX as usize], t[P::WindY as usize]],
        }
    }

    /// Nothing blows across.
    fn still(&self) -> bool {
        self.to == [0.0, 0.0] && self.to_left == 0.0
    }

    /// Air speed relative to the truck: against the direction of travel, and to the left, m/s.
    #[inline(always)]
    fn over<const L: usize>(&self, d: &Inputs, at: usize, v: &[f64; L]) -> ([f64; L], [f64; L]) {
        let mut along: [f64; L] = lanes(|j| v[j] + self.head);
        let mut across = [self.to_left; L];
        if self.to != [0.0, 0.0] {
            let (sin, cos) = (cut::<L>(&d.sin, at), cut::<L>(&d.cos, at));
            let [x, y] = self.to;
            for j in 0..L {
                along[j] -= x * cos[j] + y * sin[j];
                across[j] += y * cos[j] - x * sin[j];
            }
        }
        (along, across)
    }
}

/// Side force of the wind on the whole truck at the measured speed.
pub(super) struct SideForce<'a> {
    d: &'a Inputs,
    wind: Wind,
    area_m2_rad: f64,
    speed_scale: f64,
}

impl<'a> SideForce<'a> {
    pub(super) fn new(d: &'a Prepared, plant: &Plant, t: &Theta) -> Self {
        Self {
            d: &d.balance,
            wind: Wind::new(t),
            area_m2_rad: plant.side_area_m2_per_deg.to_degrees(),
            speed_scale: 1.0 / (1.0 + t[P::SpeedScale as usize]),
        }
    }

    /// Force at the samples from `at` on, N, positive to the left.
    #[inline(always)]
    pub(super) fn block(&self, at: usize) -> [f64; BLOCK] {
        if self.wind.still() {
            return [0.0; BLOCK];
        }
        let v: [f64; BLOCK] = scaled(cut(&self.d.speed, at), self.speed_scale);
        let (along, across) = self.wind.over(self.d, at, &v);
        let tan: [f64; BLOCK] = lanes(|j| across[j].abs() / along[j].max(1.0));
        let yaw = arctangents(tan);
        let density = cut::<BLOCK>(&self.d.density, at);
        lanes(|j| {
            let squared = along[j] * along[j] + across[j] * across[j];
            (0.5 * density[j] * squared * self.area_m2_rad * yaw[j]).copysign(across[j])
        })
    }
}

/// Arctangents of positive numbers; by their series where all are small, as those of air yaw are.
#[inline(always)]
fn arctangents<const L: usize>(x: [f64; L]) -> [f64; L] {
    if x.iter().fold(0.0, |a: f64, b| a.max(*b)) > 0.1 {
        return lanes(|j| x[j].atan());
    }
    lanes(|j| {
        let x = x[j];
        let y = x * x;
        // the next term is below 1e-16 of the first
        let mut sum = 1.0 / 15.0;
        for n in [13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
            sum = 1.0 / n - y * sum;
        }
        x * sum
    })
}

/// Pressure that brakes, later by the lag, kPa.
fn pressure(d: &Prepared, lag_s: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::Pressure, [lag_s, 0.0], || {
        let lag = lag_s / Drive::STEP_S;
        let at = (0..d.n).map(|i| at_index(&d.fine_pressure, i as f64 + lag));
        pad(at, d.balance.padded)
    })
}

/// Heating of the brakes above the air at the measured speed, K.
fn brake_heat(d: &Prepared, p: &Plant, t: &Theta) -> Arc<[f64]> {
    let (lag, speed) = (t[P::PressureLag as usize], t[P::SpeedScale as usize]);
    let pressure = pressure(d, lag);
    d.profiles.get(Kind::BrakeHeat, [lag, speed], || {
        let mut heat_k = 0.0;
        let steps = d.speed.iter().zip(pressure.iter()).map(|(v, pressure)| {
            let before = heat_k;
            let power_w = p.brake_gain_n_kpa * pressure * v / (1.0 + speed);
            heat_k +=
                Drive::STEP_S * (power_w / p.brake_heat_capacity_j_k - heat_k / p.brake_cooling_s);
            before
        });
        pad(steps, d.balance.padded)
    })
}

/// How far the fan is on: play between two thresholds, on above the start, off below it by the
/// width.
fn fan(d: &Prepared, t: &Theta) -> Arc<[f64]> {
    let (start, width) = (t[P::FanStart as usize], t[P::FanWidth as usize]);
    d.profiles.get(Kind::Fan, [start, width], || {
        let mut on = 0.0_f64;
        let steps = d.coolant.iter().map(|coolant| {
            let over = coolant - 97.0 - start;
            let (low, high) = (step(over, 0.7), step(over + width, 0.7));
            on = on.clamp(low, high);
            on
        });
        pad(steps, d.balance.padded)
    })
}

/// Share of the cold tyres' extra resistance that is left.
fn cold_left(d: &Prepared, t: &Theta) -> Arc<[f64]> {
    let tau = t[P::WarmupTau as usize];
    d.profiles.get(Kind::Cold, [tau, 0.0], || {
        let cooling = (-Drive::STEP_S / (1800.0 * tau.exp())).exp();
        let mut left = 1.0;
        let steps = (0..d.n).map(|_| {
            let now = left;
            left *= cooling;
            now
        });
        pad(steps, d.balance.padded)
    })
}

impl Prepared {
    /// Grade of a map that is off by `shift_m`, padded to whole blocks.
    pub(super) fn grade_shifted(&self, shift_m: f64) -> Arc<[f64]> {
        self.profiles.get(Kind::Grade, [shift_m, 0.0], || {
            let at = |i: usize| match shift_m {
                0.0 => self.grade[i],
                _ => self.grade_by_s.at(self.s_map[i] + shift_m),
            };
            pad((0..self.n).map(at), self.balance.padded)
        })
    }
}

/// A step smoothed over `width`.
#[inline]
fn step(x: f64, width: f64) -> f64 {
    1.0 / (1.0 + (-x / width).clamp(-40.0, 40.0).exp())
}
