//! Tractor yaw rate, trailer yaw rate and lateral acceleration from hand wheel and speed, with the
//! linear tractor-semitrailer model of `dynamics::lateral` at the measured speed.

use dynamics::lateral::{LateralParameters, StateSpace, YawSideslip};
use tractrix_core::GRAVITY_M_S2;

use super::Module as M;
use super::force::side_force;
use super::prepared::Prepared;
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

/// Lateral velocity, yaw rates of tractor and trailer, articulation.
type State = [f64; 4];

/// `x + y h`, element by element.
#[inline(always)]
fn plus(x: &State, y: &State, h: f64) -> State {
    core::array::from_fn(|i| x[i] + y[i] * h)
}

/// `A(v) = constant + inverse / v + linear v`, exactly; by columns.
struct BySpeed {
    constant: [State; 4],
    inverse: [State; 4],
    linear: [State; 4],
    steer: State,
    tractor: State,
    trailer: State,
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
                out.inverse[j][i] = inverse;
                out.linear[j][i] = linear;
                out.constant[j][i] = a - inverse - linear;
            }
        }
        out
    }

    #[inline(always)]
    fn at(&self, v: f64) -> [State; 4] {
        let w = 1.0 / v;
        core::array::from_fn(|j| {
            plus(&plus(&self.constant[j], &self.inverse[j], w), &self.linear[j], v)
        })
    }
}

/// `A s + u`.
#[inline(always)]
fn rate(a: &[State; 4], s: &State, u: &State) -> State {
    let left = plus(&plus(u, &a[0], s[0]), &a[1], s[1]);
    let right: State = core::array::from_fn(|i| a[2][i] * s[2] + a[3][i] * s[3]);
    plus(&left, &right, 1.0)
}

/// Tractor yaw rate, trailer yaw rate and lateral acceleration of every sample, without the
/// instruments' offsets.
struct Motion {
    yaw: Vec<f64>,
    trailer_yaw: Vec<f64>,
    accel_y: Vec<f64>,
}

fn motion(d: &Prepared, plant: &Plant, t: &Theta, samples: usize) -> Motion {
    let p = loaded(d, plant, t);
    let mut model = YawSideslip::new(&p);
    model.stiffness_n_rad = stiffness(d, plant, t);
    let scale = [t[P::CFront as usize], t[P::CDrive as usize], t[P::CTrailer as usize]];
    for (axle, c) in model.stiffness_n_rad.iter_mut().enumerate() {
        *c *= 1.0 + scale[[0, 1, 1, 2, 2, 2][axle]];
    }
    let system = BySpeed::new(&model);
    let road_wheel = road_wheel(d, plant, t);
    let bank_m_s2 = GRAVITY_M_S2 * t[P::Bank as usize];
    // The bank pulls on both bodies, and the wind pushes them in a fixed proportion.
    let bank = plus(
        &system.tractor.map(|b| -model.tractor_mass_kg * bank_m_s2 * b),
        &system.trailer,
        -model.trailer_mass_kg * bank_m_s2,
    );
    let share = plant.side_force_tractor_frac;
    let wind = plus(&system.tractor.map(|b| share * b), &system.trailer, 1.0 - share);
    let side_force = side_force(d, plant, t);
    let speed_scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    let dt = Drive::STEP_S;
    let mut out = Motion {
        yaw: Vec::with_capacity(samples),
        trailer_yaw: Vec::with_capacity(samples),
        accel_y: Vec::with_capacity(samples),
    };
    let mut s: State = [0.0; 4];
    for ((i, speed), wheel) in (0..samples).zip(&d.speed).zip(road_wheel.windows(2)) {
        let v = (speed * speed_scale).max(MIN_SPEED_M_S);
        let a = system.at(v);
        let side = side_force.as_ref().map_or(bank, |f| plus(&bank, &wind, f[i]));
        let input = |delta: f64| plus(&side, &system.steer, delta);
        let (u0, u1) = (input(wheel[0]), input(wheel[1]));
        let um = input(0.5 * (wheel[0] + wheel[1]));
        let k1 = rate(&a, &s, &u0);
        out.yaw.push(s[1]);
        out.trailer_yaw.push(s[2]);
        out.accel_y.push(k1[0] + v * s[1] + bank_m_s2);
        let k2 = rate(&a, &plus(&s, &k1, 0.5 * dt), &um);
        let k3 = rate(&a, &plus(&s, &k2, 0.5 * dt), &um);
        let k4 = rate(&a, &plus(&s, &k3, dt), &u1);
        let sum: State = core::array::from_fn(|j| k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j]);
        s = plus(&s, &sum, dt / 6.0).map(|x| x.clamp(-50.0, 50.0));
    }
    out
}

/// Residuals of tractor yaw rate, trailer yaw rate and lateral acceleration, mean of two samples.
pub(super) fn residuals(d: &Prepared, plant: &Plant, t: &Theta) -> [Vec<f64>; 3] {
    let rows = (d.n / 2).saturating_sub(2);
    let motion = motion(d, plant, t, 2 * rows);
    [
        (M::Yaw, &d.yaw, &motion.yaw, P::YawBias),
        (M::TrailerYaw, &d.trailer_yaw, &motion.trailer_yaw, P::TrailerYawBias),
        (M::AccelY, &d.accel_y, &motion.accel_y, P::AccelYBias),
    ]
    .map(|(m, measured, modelled, bias)| {
        let mut out = vec![0.0; rows];
        let pairs = measured.chunks_exact(2).zip(modelled.chunks_exact(2));
        for ((x, ok), (a, b)) in out.iter_mut().zip(&d.valid[m as usize]).zip(pairs) {
            if *ok {
                *x = 0.5 * (a[0] + a[1] - b[0] - b[1]) - t[bias as usize];
            }
        }
        out
    })
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
    d.steer
        .iter()
        .map(|wheel| {
            gear = gear.clamp(wheel - play, wheel + play);
            let target = (gear - offset) / ratio;
            angle = target + (angle - target) * keep;
            angle
        })
        .collect()
}
