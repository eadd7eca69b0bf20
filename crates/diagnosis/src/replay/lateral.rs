//! Tractor yaw rate, trailer yaw rate and lateral acceleration from hand wheel and speed, with the
//! linear tractor-semitrailer model of `dynamics::lateral` at the measured speed.

use dynamics::lateral::{LateralParameters, StateSpace, SteeringParameters, YawSideslip};
use tractrix_core::GRAVITY_M_S2;

use super::Module as M;
use super::air::SideForce;
use super::inputs::BLOCK;
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
    p.payload.yaw_gyration_squared_m2 *= 1.0 + t[P::PayloadSpread as usize];
    p
}

/// Axle stiffness, N/rad, at the loads of the load sheet; with `StiffnessFollows` = 1 at the loads
/// of a payload that lies elsewhere.
fn stiffness(d: &Prepared, plant: &Plant, t: &Theta) -> [f64; dynamics::lateral::AXLES] {
    let mut sheet = *t;
    // What the truck file itself says of the true mass, its tyres follow.
    let own = plant.truck.instruments.mass_scale_coeff;
    let more = (1.0 + t[P::Mass as usize]) / own - 1.0;
    sheet[P::Mass as usize] = own * (1.0 + more * t[P::StiffnessFollowsMass as usize]) - 1.0;
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
    trailer_moment: State,
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
            trailer_moment: x.b_trailer_moment,
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
    let mut road_wheel = RoadWheel::new(d, plant, t);
    let bank_m_s2 = GRAVITY_M_S2 * t[P::Bank as usize];
    // The bank pulls on both bodies, and the wind pushes them in a fixed proportion.
    let bank = plus(
        &system.tractor.map(|b| -model.tractor_mass_kg * bank_m_s2 * b),
        &system.trailer,
        -model.trailer_mass_kg * bank_m_s2,
    );
    let share = plant.truck.resistance.side_force_tractor_frac
        + t[P::SideShare as usize]
        + t[P::WindShare as usize]
        + t[P::CrosswindShare as usize];
    let behind_m = plant.truck.resistance.side_force_trailer_behind_cg_m
        + t[P::SideBehind as usize]
        + t[P::WindBehind as usize]
        + t[P::CrosswindBehind as usize];
    let trailer = plus(&system.trailer, &system.trailer_moment, -behind_m);
    let wind = plus(&system.tractor.map(|b| share * b), &trailer, 1.0 - share);
    let side_force = SideForce::new(d, plant, t);
    let speed_scale = 1.0 / (1.0 + t[P::SpeedScale as usize]);
    let bias = [P::YawBias, P::TrailerYawBias, P::AccelYBias].map(|p| t[p as usize]);
    let dt = Drive::STEP_S;
    let rows = (d.n / 2).saturating_sub(2);
    let mut out = [vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]];
    let mut s: State = [0.0; 4];
    let mut next = road_wheel.step(0);
    for from in (0..2 * rows).step_by(BLOCK) {
        let force = side_force.block(from);
        for (i, force) in (from..2 * rows).zip(force) {
            let v = (d.speed[i] * speed_scale).max(MIN_SPEED_M_S);
            let a = system.at(v);
            let side = plus(&bank, &wind, force);
            let before = next;
            next = road_wheel.step(i + 1);
            let u0 = plus(&side, &system.steer, before);
            let um = plus(&side, &system.steer, 0.5 * (before + next));
            let u1 = plus(&side, &system.steer, next);
            let k1 = rate(&a, &s, &u0);
            let lateral = k1[0] + v * s[1] + bank_m_s2;
            out[0][i / 2] += 0.5 * (d.yaw[i] - s[1] - bias[0]);
            out[1][i / 2] += 0.5 * (d.trailer_yaw[i] - s[2] - bias[1]);
            out[2][i / 2] += 0.5 * (d.accel_y[i] - lateral - bias[2]);
            let k2 = rate(&a, &plus(&s, &k1, 0.5 * dt), &um);
            let k3 = rate(&a, &plus(&s, &k2, 0.5 * dt), &um);
            let k4 = rate(&a, &plus(&s, &k3, dt), &u1);
            let sum: State = core::array::from_fn(|j| k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j]);
            s = plus(&s, &sum, dt / 6.0).map(|x| x.clamp(-50.0, 50.0));
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

/// Road-wheel angle of sample after sample: dead time, free play, offset, ratio, lag.
struct RoadWheel<'a> {
    steer: &'a [f64],
    /// Dead time, samples.
    delay: f64,
    /// What is left of the angle after a sample, and the shares of the targets at its begin and end.
    keep: f64,
    shares: [f64; 2],
    ratio: f64,
    offset: f64,
    play: f64,
    /// Part of the way to the middle that alignment takes the gear within the play, per sample.
    centres: f64,
    gear: f64,
    target: f64,
    angle: f64,
}

impl<'a> RoadWheel<'a> {
    fn new(d: &'a Prepared, plant: &Plant, t: &Theta) -> Self {
        let steering = &plant.lateral.steering;
        // What delays the wheels on top may be a lag or a dead time: the size is their sum.
        let dead_s = (t[P::SteerDelay as usize] * t[P::SteerLag as usize]).max(0.0);
        let lag = steering.lag_s + t[P::SteerLag as usize] - dead_s;
        let ratio = steering.ratio * (1.0 + t[P::SteerRatio as usize]);
        let offset = steering.offset_rad + t[P::SteerOffset as usize];
        let centring_1_s = steering.free_play_centring_1_s + t[P::PlayCentring as usize];
        let gear = d.steer[0];
        let target = (gear - offset) / ratio;
        let (keep, shares) = first_order_hold(lag);
        Self {
            steer: &d.steer,
            delay: dead_s / Drive::STEP_S,
            keep,
            shares,
            ratio,
            offset,
            play: 0.5 * (steering.free_play_rad + t[P::FreePlay as usize]).max(0.0),
            centres: 1.0 - (-Drive::STEP_S * centring_1_s).exp(),
            gear,
            target,
            angle: target,
        }
    }

    #[inline(always)]
    fn step(&mut self, i: usize) -> f64 {
        let wheel = if self.delay > 0.0 {
            at_index(self.steer, i as f64 - self.delay)
        } else {
            self.steer[i]
        };
        let (low, high) = (wheel - self.play, wheel + self.play);
        let gear = self.gear.clamp(low, high);
        self.gear = SteeringParameters::centred_rad(gear, self.offset, (low, high), self.centres);
        let before = self.target;
        self.target = (self.gear - self.offset) / self.ratio;
        self.angle =
            self.keep * self.angle + self.shares[0] * before + self.shares[1] * self.target;
        self.angle
    }
}

/// What is left of the state of a first-order lag after a sample, and what it takes of its target at
/// the begin and at the end of the sample, exactly for a target that moves evenly in between.
fn first_order_hold(lag_s: f64) -> (f64, [f64; 2]) {
    if lag_s < 1e-3 {
        return (0.0, [0.0, 1.0]);
    }
    let keep = (-Drive::STEP_S / lag_s).exp();
    let end = 1.0 - (1.0 - keep) * lag_s / Drive::STEP_S;
    (keep, [1.0 - keep - end, end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_follows_a_ramp_one_lag_behind_whatever_the_sample_time() {
        for lag in [0.02, 0.08, 0.3] {
            let (keep, shares) = first_order_hold(lag);
            let mut angle = 0.0;
            for i in 0..200 {
                let target = f64::from(i) * Drive::STEP_S;
                angle = keep * angle + shares[0] * target + shares[1] * (target + Drive::STEP_S);
            }
            assert!((angle - (200.0 * Drive::STEP_S - lag)).abs() < 1e-9, "{lag}: {angle}");
        }
    }
}
