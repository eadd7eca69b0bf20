//! Tractor yaw rate, trailer yaw rate and lateral acceleration from hand wheel and speed, with the
//! linear tractor-semitrailer model of `dynamics::lateral` at the measured speed.

use dynamics::lateral::{LateralParameters, StateSpace, YawSideslip};
use tractrix_core::GRAVITY_M_S2;

use super::Module as M;
use super::force::air_speed;
use super::prepared::{Prepared, at_index};
use crate::param::{P, Theta};
use crate::{Drive, Plant};

/// Below this speed the linear model is stiff; rows there are masked.
const MIN_SPEED_M_S: f64 = 4.0;

/// Parameters of the drive's loading state, off by `t`.
pub(crate) fn loaded(d: &Prepared, plant: &Plant, t: &Theta) -> LateralParameters {
    let mut p = plant.lateral;
    let mass = d.mass_kg * (1.0 + t[P::Mass as usize]);
    p.payload.mass_kg = (mass - p.tractor.mass_kg - p.trailer.mass_kg).max(0.0);
    p.payload.cg_behind_hitch_m += t[P::PayloadX as usize];
    p
}

/// Axle stiffness, N/rad, at the loads of the load sheet; with `StiffnessFollows` = 1 at the loads
/// of a payload that lies elsewhere.
fn stiffness(d: &Prepared, plant: &Plant, t: &Theta) -> [f64; dynamics::lateral::AXLES] {
    let mut sheet = *t;
    sheet[P::Mass as usize] = 0.0;
    sheet[P::PayloadX as usize] *= t[P::StiffnessFollows as usize];
    let p = loaded(d, plant, &sheet);
    p.tyres.stiffness_n_rad(&p.static_axle_load_n())
}

/// `A(v) = constant + inverse / v + linear v`, exactly.
struct BySpeed {
    constant: [[f64; 4]; 4],
    inverse: [[f64; 4]; 4],
    linear: [[f64; 4]; 4],
    steer: [f64; 4],
    tractor: [f64; 4],
    trailer: [f64; 4],
}

impl BySpeed {
    fn new(model: &YawSideslip) -> Self {
        let at = |v: f64| -> StateSpace { model.state_space(v) };
        let (x, y, z) = (at(1.0), at(2.0), at(4.0));
        let mut out = Self {
            constant: [[0.0; 4]; 4],
            inverse: [[0.0; 4]; 4],
            linear: [[0.0; 4]; 4],
            steer: x.b_steer,
            tractor: x.b_tractor_force,
            trailer: x.b_trailer_force,
        };
        for i in 0..4 {
            for j in 0..4 {
                // a = c + i + l, b = c + i/2 + 2 l, e = c + i/4 + 4 l
                let (a, b, e) = (x.a[i][j], y.a[i][j], z.a[i][j]);
                let inverse = (8.0 * a - 12.0 * b + 4.0 * e) / 3.0;
                let linear = b - a + 0.5 * inverse;
                out.inverse[i][j] = inverse;
                out.linear[i][j] = linear;
                out.constant[i][j] = a - inverse - linear;
            }
        }
        out
    }

    fn at(&self, v: f64) -> [[f64; 4]; 4] {
        let w = 1.0 / v;
        core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                self.constant[i][j] + self.inverse[i][j] * w + self.linear[i][j] * v
            })
        })
    }
}

/// Residuals of tractor yaw rate, trailer yaw rate and lateral acceleration, mean of two samples.
pub(super) fn residuals(d: &Prepared, plant: &Plant, t: &Theta) -> [Vec<f64>; 3] {
    let p = loaded(d, plant, t);
    let mut model = YawSideslip::new(&p);
    model.stiffness_n_rad = stiffness(d, plant, t);
    let scale = [t[P::CFront as usize], t[P::CDrive as usize], t[P::CTrailer as usize]];
    for (axle, c) in model.stiffness_n_rad.iter_mut().enumerate() {
        *c *= 1.0 + scale[[0, 1, 1, 2, 2, 2][axle]];
    }
    let system = BySpeed::new(&model);
    let (tractor_kg, trailer_kg) = (model.tractor_mass_kg, model.trailer_mass_kg);
    let road_wheel = road_wheel(d, plant, t);
    let wind = [t[P::WindX as usize], t[P::WindY as usize]];
    let blows = wind != [0.0, 0.0] || t[P::Crosswind as usize] != 0.0;
    let bank = t[P::Bank as usize];
    let speed_scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    let dt = Drive::STEP_S;
    let rows = (d.n / 2).saturating_sub(2);
    let mut out = [vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]];
    let mut s = [0.0_f64; 4];
    for i in 0..2 * rows {
        let v = (d.speed[i] * speed_scale).max(MIN_SPEED_M_S);
        let a = system.at(v);
        let (mut side_tractor, mut side_trailer) =
            (-tractor_kg * GRAVITY_M_S2 * bank, -trailer_kg * GRAVITY_M_S2 * bank);
        if blows {
            let (along, across) = air_speed(d, t, wind, i, v);
            let yaw_deg = (across / along.max(1.0)).atan().to_degrees();
            let force = 0.5
                * d.density[i]
                * (along * along + across * across)
                * plant.side_area_m2_per_deg
                * yaw_deg;
            side_tractor += plant.side_force_tractor_frac * force;
            side_trailer += (1.0 - plant.side_force_tractor_frac) * force;
        }
        let input = |delta: f64| -> [f64; 4] {
            core::array::from_fn(|k| {
                system.steer[k] * delta
                    + system.tractor[k] * side_tractor
                    + system.trailer[k] * side_trailer
            })
        };
        let rate = |s: &[f64; 4], u: &[f64; 4]| -> [f64; 4] {
            core::array::from_fn(|k| {
                a[k][0] * s[0] + a[k][1] * s[1] + a[k][2] * s[2] + a[k][3] * s[3] + u[k]
            })
        };
        let (d0, d1) = (road_wheel[i], road_wheel[i + 1]);
        let (u0, um, u1) = (input(d0), input(0.5 * (d0 + d1)), input(d1));
        let k1 = rate(&s, &u0);
        let k = i / 2;
        out[0][k] += 0.5 * (d.yaw[i] - s[1] - t[P::YawBias as usize]);
        out[1][k] += 0.5 * (d.trailer_yaw[i] - s[2] - t[P::TrailerYawBias as usize]);
        let lateral = k1[0] + v * s[1] + GRAVITY_M_S2 * bank + t[P::AccelYBias as usize];
        out[2][k] += 0.5 * (d.accel_y[i] - lateral);
        let step = |k: &[f64; 4], h: f64| -> [f64; 4] { core::array::from_fn(|j| s[j] + h * k[j]) };
        let k2 = rate(&step(&k1, 0.5 * dt), &um);
        let k3 = rate(&step(&k2, 0.5 * dt), &um);
        let k4 = rate(&step(&k3, dt), &u1);
        for j in 0..4 {
            s[j] += dt / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
            s[j] = s[j].clamp(-50.0, 50.0);
        }
    }
    for (m, r) in [M::Yaw, M::TrailerYaw, M::AccelY].iter().zip(&mut out) {
        for (x, ok) in r.iter_mut().zip(&d.valid[*m as usize]) {
            if !ok {
                *x = 0.0;
            }
        }
    }
    out
}

/// Road-wheel angle of every sample: dead time, free play, offset, ratio, lag.
fn road_wheel(d: &Prepared, plant: &Plant, t: &Theta) -> Vec<f64> {
    let steering = &plant.lateral.steering;
    let lag = steering.lag_s + t[P::SteerLag as usize];
    let keep = if lag > 1e-3 { (-Drive::STEP_S / lag).exp() } else { 0.0 };
    let ratio = steering.ratio * (1.0 + t[P::SteerRatio as usize]);
    let offset = steering.offset_rad + t[P::SteerOffset as usize];
    let play = 0.5 * (steering.free_play_rad + t[P::FreePlay as usize]).max(0.0);
    let mut gear = d.steer[0];
    let mut angle = (gear - offset) / ratio;
    (0..d.n)
        .map(|i| {
            let wheel = at_index(&d.steer, i as f64);
            gear = gear.clamp(wheel - play, wheel + play);
            let target = (gear - offset) / ratio;
            angle = target + (angle - target) * keep;
            angle
        })
        .collect()
}
