//! Force balance in weak form: the change of speed over one second minus the integral of the
//! modelled acceleration, driven by measured torque, engine speed, gear, pressure and speed. No
//! measured signal is differentiated.

use std::sync::Arc;

use dynamics::effects::brake::{BrakeParameters, friction_left_frac};
use dynamics::effects::driveline::{from_speed_frac, with_losses_n, with_mesh_loss};
use dynamics::effects::resistance::{area_at_yaw_m2, cold_factor, drag_n, grade_n, rolling_n};
use tractrix_core::ZERO_DEGC_K;

use super::air::{Wind, arctangents};
use super::brake::PA_PER_KPA;
use super::inputs::{BLOCK, Inputs, cut, lanes, pad, scaled};
use super::prepared::{Prepared, at_index};
use super::profiles::Kind;
use super::retarder::{blended_m_s2, downhill, retarder_n};
use crate::causes::param::{P, Theta};
use crate::{Drive, Plant};

/// Samples that a speed at a window's end is averaged over (two 10 Hz messages).
pub(super) const EDGE: usize = 4;

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

/// Longitudinal balance of one drive with its parameters unpacked.
pub(crate) struct Longitudinal<'a> {
    d: &'a Inputs,
    mass_kg: f64,
    torque: f64,
    friction: f64,
    engine_brake: f64,
    engine_brake_nm: Arc<[f64]>,
    fan_w: f64,
    /// In a direct gear, and what gears whose teeth carry the power lose on top.
    efficiency: f64,
    mesh_loss: f64,
    cd_a_m2: f64,
    drag_yaw_1_rad: f64,
    wind: Wind,
    rolling_coeff: f64,
    cold: f64,
    grade_bias: f64,
    brake: f64,
    /// Loss of force per kelvin, and where it begins, K.
    fade: (f64, f64),
    /// Force of the retarders of a released accelerator, N, and per brake demand, kg.
    on_coast_n: f64,
    on_brake_kg: f64,
    /// Speed from which the retarder of a released accelerator acts, m/s.
    coast_from_m_s: f64,
    parasitic_n: f64,
    grade: Arc<[f64]>,
    service_n: Arc<[f64]>,
    heat: Option<Arc<[f64]>>,
    fan: Option<Arc<[f64]>>,
    retarder_n: Option<Arc<[f64]>>,
    blended_m_s2: Option<Arc<[f64]>>,
    on_slope_n: f64,
    downhill: Option<Arc<[f64]>>,
    cold_left: Option<Arc<[f64]>>,
}

impl<'a> Longitudinal<'a> {
    pub(crate) fn new(d: &'a Prepared, plant: &Plant, t: &Theta) -> Self {
        let at = |p: P| t[p as usize];
        let (driveline, resistance) = (&plant.truck.driveline, &plant.truck.resistance);
        let per_prop = driveline.shaft_force_n(1.0);
        let brake = &plant.truck.brake;
        let fade = (brake.fade_1_k + 0.01 * at(P::Fade), brake.fade_from_k + at(P::FadeStart));
        let fan_w = plant.truck.engine.fan_power_w + 1e3 * at(P::FanPower);
        let cold = resistance.cold_tyre_extra_frac + at(P::WarmupAmp);
        let on_slope_nm = driveline.hidden_retarder_downhill_nm + at(P::RetarderSlope);
        let steep_frac = driveline.hidden_retarder_from_descent_frac + at(P::RetarderSteep);
        let on_coast_nm = driveline.hidden_retarder_torque_nm + at(P::RetarderCoast);
        Self {
            d: &d.balance,
            mass_kg: d.mass_kg * (1.0 + at(P::Mass)),
            torque: 1.0 + at(P::TorqueScale),
            friction: 1.0 + at(P::Friction),
            engine_brake: 1.0 + at(P::EngineBrakeScale),
            engine_brake_nm: engine_brake_nm(d, at(P::StageLag)),
            fan_w,
            efficiency: driveline.direct_efficiency_frac() * (1.0 - at(P::DrivelineLoss)),
            mesh_loss: driveline.mesh_loss_frac + at(P::MeshLoss),
            cd_a_m2: resistance.drag_area_m2 * (1.0 + at(P::Drag)),
            drag_yaw_1_rad: resistance.drag_yaw_1_rad,
            wind: Wind::new(plant, t),
            rolling_coeff: resistance.rolling_coeff * (1.0 + at(P::Rolling)),
            cold,
            grade_bias: at(P::GradeBias),
            brake: 1.0 + at(P::BrakeGain),
            fade,
            on_coast_n: on_coast_nm * per_prop,
            on_brake_kg: at(P::RetarderBrake),
            coast_from_m_s: driveline.hidden_retarder_from_m_s + at(P::RetarderFrom),
            parasitic_n: resistance.parasitic_force_n + at(P::DragBrake),
            grade: d.grade_shifted(at(P::MapShift)),
            service_n: service_n(d, plant, at(P::PressureLag)),
            heat: (fade.0 != 0.0).then(|| lining_heat(d, plant, t, fade)),
            fan: (fan_w != 0.0).then(|| fan(d, plant, t)),
            retarder_n: retarder_n(d, plant, at(P::RetarderStage)),
            blended_m_s2: (at(P::RetarderBrake) != 0.0)
                .then(|| blended_m_s2(d, at(P::RetarderSaturation))),
            on_slope_n: on_slope_nm * per_prop,
            downhill: (on_slope_nm != 0.0).then(|| downhill(d, steep_frac)),
            cold_left: (cold != 0.0 && !d.warm).then(|| cold_left(d, plant, t)),
        }
    }

    /// Force of the engine and its brake at the wheels from `at` on, N.
    #[inline(always)]
    pub(super) fn drive_n<const L: usize>(&self, at: usize) -> [f64; L] {
        let d = self.d;
        let (indicated, friction) = (cut::<L>(&d.indicated_nm, at), cut::<L>(&d.friction_nm, at));
        let auxiliary = cut::<L>(&d.auxiliary_nm, at);
        let brake = cut::<L>(&self.engine_brake_nm, at);
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
        let meshes = cut::<L>(&d.meshes, at);
        lanes(|j| {
            let efficiency = with_mesh_loss(self.efficiency, self.mesh_loss, meshes[j]);
            with_losses_n(net[j] * ratio[j], efficiency)
        })
    }

    /// Force of the service brakes while cold from `at` on, N.
    #[inline(always)]
    pub(super) fn service_n<const L: usize>(&self, at: usize) -> [f64; L] {
        let service_n = cut::<L>(&self.service_n, at);
        lanes(|j| self.brake * service_n[j])
    }

    /// Acceleration of the samples from `at` on at speeds `v`, m/s.
    #[inline(always)]
    pub(crate) fn acceleration<const L: usize>(&self, at: usize, v: &[f64; L]) -> [f64; L] {
        let d = self.d;
        let mut force: [f64; L] = self.drive_n(at);
        let air = self.air(at, v);
        let mut cold = [1.0; L];
        if let Some(left) = &self.cold_left {
            let left = cut::<L>(left, at);
            cold = lanes(|j| cold_factor(self.cold, left[j]));
        }
        let (cos, grade) = (cut::<L>(&d.cos, at), cut::<L>(&self.grade, at));
        let by_speed = cut::<L>(&d.rolling_by_speed, at);
        for j in 0..L {
            // The cosine changes by less than 1e-3 of a grade error: the map's counts.
            force[j] -= air[j]
                + rolling_n(self.mass_kg, cos[j], self.rolling_coeff + by_speed[j], cold[j])
                + grade_n(self.mass_kg, cos[j] * (grade[j] + self.grade_bias));
        }
        let mut service: [f64; L] = self.service_n(at);
        if let Some(heat) = &self.heat {
            let (heat, air_k) = (cut::<L>(heat, at), cut::<L>(&d.air_k, at));
            let (loss, from) = self.fade;
            for j in 0..L {
                service[j] *= friction_left_frac(loss, heat[j] + air_k[j], from);
            }
        }
        let (holding, table) = (cut::<L>(&d.holding_n, at), cut::<L>(&d.table_m_s2, at));
        let blended: [f64; L] = self.blended_m_s2.as_ref().map_or([0.0; L], |x| *cut::<L>(x, at));
        let slope: [f64; L] = self.downhill.as_ref().map_or([0.0; L], |x| *cut::<L>(x, at));
        let stage: [f64; L] = self.retarder_n.as_ref().map_or([0.0; L], |n| *cut::<L>(n, at));
        let (coasts, rotating) = (cut::<L>(&d.coasts, at), cut::<L>(&d.rotating_kg, at));
        lanes(|j| {
            let coasting = self.on_coast_n * coasts[j] * from_speed_frac(v[j], self.coast_from_m_s);
            let on_slope = self.on_slope_n * slope[j];
            let retarder = stage[j] + coasting + on_slope + self.on_brake_kg * blended[j];
            let held = service[j] + retarder + holding[j] + self.parasitic_n;
            (force[j] - held) / (self.mass_kg + rotating[j]) + table[j]
        })
    }

    #[inline(always)]
    fn air<const L: usize>(&self, at: usize, v: &[f64; L]) -> [f64; L] {
        let density = cut::<L>(&self.d.density, at);
        let (along, across) = self.wind.over(self.d, at, v);
        if self.wind.still() {
            let squared = |j: usize| along[j] * along[j];
            return lanes(|j| drag_n(density[j], self.cd_a_m2, squared(j), along[j].signum()));
        }
        let tan: [f64; L] = lanes(|j| across[j].abs() / along[j].abs().max(1.0));
        let yaw = arctangents(tan);
        lanes(|j| {
            let squared = along[j] * along[j] + across[j] * across[j];
            let area_m2 = area_at_yaw_m2(self.cd_a_m2, self.drag_yaw_1_rad, yaw[j]);
            drag_n(density[j], area_m2, squared, along[j] / squared.sqrt().max(1e-9))
        })
    }
}

/// Torque of the engine brake as its stage is logged, later by the lag, Nm.
fn engine_brake_nm(d: &Prepared, lag_s: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::EngineBrake, [lag_s], || {
        let (nm, lag) = (&d.balance.engine_brake_nm, lag_s / Drive::STEP_S);
        (0..nm.len()).map(|i| at_index(nm, i as f64 - lag)).collect()
    })
}

/// Force of cold brakes at the pressure that brakes, later by the lag, N.
fn service_n(d: &Prepared, plant: &Plant, lag_s: f64) -> Arc<[f64]> {
    d.profiles.get(Kind::Service, [lag_s], || {
        let lag = lag_s / Drive::STEP_S;
        let pressure_pa = |i: usize| PA_PER_KPA * at_index(&d.fine_pressure, i as f64 + lag);
        let force_n = (0..d.n).map(|i| plant.truck.brake.cold_force_n(1.0, pressure_pa(i)));
        pad(force_n, d.balance.padded)
    })
}

/// Heating of the linings above the air at the measured speed, K: behind that of the discs, which is
/// by the force that they have; faded brakes heat less.
fn lining_heat(
    d: &Prepared,
    plant: &Plant,
    t: &Theta,
    (loss_1_k, from_k): (f64, f64),
) -> Arc<[f64]> {
    let [lag, speed, gain] = [P::PressureLag, P::SpeedScale, P::BrakeGain].map(|p| t[p as usize]);
    let service_n = service_n(d, plant, lag);
    let behind_s = plant.truck.brake.lining_lag_s + t[P::LiningLag as usize];
    let key = [lag, speed, gain, loss_1_k, from_k, behind_s];
    d.profiles.get(Kind::BrakeHeat, key, || {
        let brake = &plant.truck.brake;
        let (mut disc_k, mut lining_k) = (0.0, 0.0);
        let steps =
            d.speed.iter().zip(&d.ambient).zip(service_n.iter()).map(|((v, air), force_n)| {
                let before = lining_k;
                let left = friction_left_frac(loss_1_k, lining_k + air + ZERO_DEGC_K, from_k);
                let power_w = (1.0 + gain) * force_n * left * v / (1.0 + speed);
                disc_k = brake.temperature_step_k(disc_k, power_w, 1.0, 0.0, Drive::STEP_S);
                lining_k =
                    BrakeParameters::lining_step_k(lining_k, disc_k, behind_s, Drive::STEP_S);
                before
            });
        pad(steps, d.balance.padded)
    })
}

/// How far the fan is on: play between two ramps, coming over the band from the start on, going by
/// the width below it. What switches comes over what a sensor resolves.
fn fan(d: &Prepared, plant: &Plant, t: &Theta) -> Arc<[f64]> {
    let engine = &plant.truck.engine;
    let start = engine.fan_on_k - ZERO_DEGC_K + t[P::FanStart as usize];
    let width = engine.fan_hysteresis_k + t[P::FanWidth as usize];
    let band = engine.fan_band_k + t[P::FanBand as usize];
    d.profiles.get(Kind::Fan, [start, width, band], || {
        let mut on = 0.0_f64;
        let steps = d.coolant.iter().map(|coolant| {
            let over = coolant - start - 0.5 * band;
            let (low, high) = (step(over, 0.7 + 0.5 * band), step(over + width, 0.7 + 0.5 * band));
            on = on.clamp(low, high);
            on
        });
        pad(steps, d.balance.padded)
    })
}

/// Share of the cold tyres' extra resistance that is left.
fn cold_left(d: &Prepared, plant: &Plant, t: &Theta) -> Arc<[f64]> {
    let tau = t[P::WarmupTau as usize];
    d.profiles.get(Kind::Cold, [tau], || {
        let cooling = (-Drive::STEP_S / (plant.truck.resistance.tyre_warmup_s * tau.exp())).exp();
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
        self.profiles.get(Kind::Grade, [shift_m], || {
            let at = |i: usize| match shift_m {
                0.0 => self.grade[i],
                _ => self.grade_by_s.at(self.s_map[i] + shift_m),
            };
            pad((0..self.n).map(at), self.balance.padded)
        })
    }
}

/// A step that rises evenly from `-width` to `width`: wholly on beyond, as a clutch is.
#[inline]
fn step(x: f64, width: f64) -> f64 {
    (0.5 + 0.5 * x / width).clamp(0.0, 1.0)
}
