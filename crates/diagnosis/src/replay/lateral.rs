//! Tractor yaw rate, trailer yaw rate and lateral acceleration from hand wheel and speed, with the
//! tractor-semitrailer model of `dynamics::lateral` at the measured speed; tyres that saturate have at
//! every sample the stiffness of their slip and load there (`grip`).
//!
//! All tyres have one relaxation length, so that their forces on the bodies lag as one: three states
//! instead of one per axle.

use dynamics::lateral::{LateralParameters, SteeringParameters, YawSideslip};
use tractrix_core::GRAVITY_M_S2;

use super::Module as M;
use super::air::SideForce;
use super::grip::{Acting, Grip};
use super::inputs::BLOCK;
use super::prepared::{Prepared, at_index};
use crate::causes::param::{P, Theta};
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
pub(super) type State = [f64; 4];

/// `x + y h`, element by element.
#[inline(always)]
pub(super) fn plus(x: &State, y: &State, h: f64) -> State {
    core::array::from_fn(|i| x[i] + y[i] * h)
}

/// The state matrix of any speed, `A(v) s = tyres (s_0 / v, s_1 / v, s_2 / v, s_3) + turn v s_1` in its
/// first three rows, and the input columns.
pub(super) struct BySpeed {
    /// By columns.
    tyres: [State; 4],
    turn: State,
    steer: State,
    tractor: State,
    trailer: State,
    trailer_moment: State,
}

impl BySpeed {
    pub(super) fn new(model: &YawSideslip) -> Self {
        let (x, y) = (model.state_space(1.0), model.state_space(2.0));
        let column = |a: &[State; 4], j: usize| -> State {
            core::array::from_fn(|i| if i < 3 { a[i][j] } else { 0.0 })
        };
        // The yaw rate's column is `tyres / v + turn v`.
        let (one, two) = (column(&x.a, 1), column(&y.a, 1));
        let turn = core::array::from_fn(|i| (2.0 * two[i] - one[i]) / 3.0);
        Self {
            tyres: [column(&x.a, 0), plus(&one, &turn, -1.0), column(&x.a, 2), column(&x.a, 3)],
            turn,
            steer: x.b_steer,
            tractor: x.b_tractor_force,
            trailer: x.b_trailer_force,
            trailer_moment: x.b_trailer_moment,
        }
    }

    /// Accelerations by a side force at the trailer's centre of gravity and by a yaw moment on it.
    pub(super) fn trailer(&self) -> [&State; 2] {
        [&self.trailer, &self.trailer_moment]
    }

    /// Accelerations by the tyres' steady side forces per state, by columns, at `1 / v`.
    #[inline(always)]
    pub(super) fn tyres(&self, per_speed: f64) -> [State; 4] {
        let [a, b, c, d] = &self.tyres;
        [a.map(|x| x * per_speed), b.map(|x| x * per_speed), c.map(|x| x * per_speed), *d]
    }

    /// The state matrix with a part of the tyres' side forces.
    #[inline(always)]
    fn matrix(&self, tyres: &[State; 4], part: f64, v: f64) -> [State; 4] {
        let mut a = tyres.map(|c| c.map(|x| x * part));
        a[1] = plus(&a[1], &self.turn, v);
        (a[1][3], a[2][3]) = (1.0, -1.0);
        a
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
    let grip = Grip::new(d, plant, t[P::RetarderStage as usize], &model, &system);
    let mut road_wheel = RoadWheel::new(d, plant, t);
    // A bank pulls on both bodies, and the wind pushes them in a fixed proportion.
    let bank = system.tractor.map(|b| -model.tractor_mass_kg * b);
    let bank = plus(&bank, &system.trailer, -model.trailer_mass_kg);
    let [even, curved] = [P::Bank, P::CurveBank].map(|p| GRAVITY_M_S2 * t[p as usize]);
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
    let ahead_m = t[P::AccelYAhead as usize];
    let relaxation_m = plant.lateral.tyres.relaxation_length_m;
    let relaxes = relaxation_m > 0.0;
    let dt = Drive::STEP_S;
    let rows = (d.n / 2).saturating_sub(2);
    let mut out = [vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]];
    let mut s: State = [0.0; 4];
    let mut next = road_wheel.step(0);
    // What the tyres' forces keep of the last half sample, and what they take of their goal at its end.
    let (mut kept, mut end): (State, f64) = ([0.0; 4], 1.0);
    for from in (0..2 * rows).step_by(BLOCK) {
        let force = side_force.block(from);
        for (i, force) in (from..2 * rows).zip(force) {
            let v = (d.speed[i] * speed_scale).max(MIN_SPEED_M_S);
            let w = 1.0 / v;
            let bank_m_s2 = even - curved * d.curvature[i];
            let side = plus(&wind.map(|x| x * force), &bank, bank_m_s2);
            let before = next;
            next = road_wheel.step(i + 1);
            let Acting { tyres, steer_frac, pulled } = match &grip {
                Some(grip) => grip.acting(i, v, &s, before),
                None => Acting::of(system.tyres(w)),
            };
            let steer = |angle: f64| system.steer.map(|x| x * (steer_frac * angle));
            let middle = steer(0.5 * (before + next));
            // Runge and Kutta's steps of the bodies; the tyres' lag is solved exactly over each half
            // for goals that move evenly, so that no speed makes a short length unstable.
            let goal = rate(&tyres, &s, &steer(before));
            let built = plus(&kept, &goal, end);
            let (keep, [begin, part]) = first_order_hold(relaxation_m * w, 0.5 * dt);
            end = part;
            let mut a = system.matrix(&tyres, end, v);
            a[3] = plus(&a[3], &pulled, 1.0);
            let mut k1 = plus(&plus(&built, &side, 1.0), &system.turn, v * s[1]);
            k1 = plus(&k1, &pulled, s[3]);
            k1[3] = s[1] - s[2];
            let lateral = k1[0] + v * s[1] + ahead_m * k1[1] + bank_m_s2;
            out[0][i / 2] += 0.5 * (d.yaw[i] - s[1] - bias[0]);
            out[1][i / 2] += 0.5 * (d.trailer_yaw[i] - s[2] - bias[1]);
            out[2][i / 2] += 0.5 * (d.accel_y[i] - lateral - bias[2]);
            let begun =
                if relaxes { plus(&built.map(|x| x * keep), &goal, begin) } else { [0.0; 4] };
            let um = plus(&plus(&begun, &side, 1.0), &middle, end);
            let k2 = rate(&a, &plus(&s, &k1, 0.5 * dt), &um);
            let s3 = plus(&s, &k2, 0.5 * dt);
            let k3 = rate(&a, &s3, &um);
            if relaxes {
                let goal = rate(&tyres, &s3, &middle);
                kept = plus(&plus(&begun, &goal, end).map(|x| x * keep), &goal, begin);
            }
            let u1 = plus(&plus(&kept, &side, 1.0), &steer(next), end);
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
        let (keep, shares) = first_order_hold(lag, Drive::STEP_S);
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

/// What is left of the state of a first-order lag after `over_s`, and what it takes of its target at the
/// begin and at the end of it, exactly for a target that moves evenly in between.
#[inline(always)]
fn first_order_hold(lag_s: f64, over_s: f64) -> (f64, [f64; 2]) {
    if lag_s <= 0.0 {
        return (0.0, [0.0, 1.0]);
    }
    let keep = (-over_s / lag_s).exp();
    let end = 1.0 - (1.0 - keep) * lag_s / over_s;
    (keep, [1.0 - keep - end, end])
}

#[cfg(test)]
mod tests {
    use dynamics::TruckParameters;
    use dynamics::lateral::{LateralInputs, LateralModel, LateralState};

    use super::*;
    use crate::Channel as C;
    use crate::causes::param::PARAMS;

    /// Trucks yawed 3 to 4 % more than the model in every long curve: these are banked, which no map
    /// says, and their accelerometer measures gravity there, not at the centre of gravity.
    #[test]
    fn banked_curves_and_the_accelerometers_place_are_replayed_as_they_are_simulated() {
        const BANK_RAD_M: f64 = 17.0;
        const AHEAD_M: f64 = -2.0;
        let truck = TruckParameters::load("reference").unwrap();
        let plant = Plant::of_truck(&truck).unwrap();
        let n = 2_400;
        let wave = |i: usize, period_s: f64| {
            (core::f64::consts::TAU * i as f64 * Drive::STEP_S / period_s).sin()
        };
        let mut drive = Drive::new("curves", 0.0, n);
        drive.reported_mass_kg = Some(truck.lateral.total_mass_kg());
        let wheel = |i: usize| 0.3 * wave(i, 13.0);
        let curvature = |i: usize| wave(i, 40.0) / 600.0;
        let model = LateralModel::new(&truck.lateral).unwrap();
        let mut state = LateralState::default();
        let mut logged: [Vec<f64>; 3] = Default::default();
        for i in 0..n {
            for k in 0..10 {
                let part = (f64::from(k) + 0.5) / 10.0;
                let inputs = LateralInputs {
                    speed_m_s: 20.0,
                    steering_wheel_rad: wheel(i) + part * (wheel(i + 1) - wheel(i)),
                    bank_rad: -BANK_RAD_M * curvature(i),
                    ..LateralInputs::default()
                };
                if k == 0 {
                    let out = model.outputs(&state, &inputs);
                    logged[0].push(out.yaw_rate_rad_s);
                    logged[1].push(out.trailer_yaw_rate_rad_s);
                    logged[2].push(
                        out.tractor_accel_y_m_s2
                            + AHEAD_M * out.yaw_accel_rad_s2
                            + GRAVITY_M_S2 * inputs.bank_rad,
                    );
                }
                state = model.step(&state, &inputs, 0.1 * Drive::STEP_S);
            }
        }
        drive.set(C::SpeedMS, vec![20.0; n]);
        drive.set(C::SteeringWheelRad, (0..n).map(wheel).collect());
        drive.set(C::Curvature1M, (0..n).map(curvature).collect());
        for (c, x) in [C::YawRateRadS, C::TrailerYawRateRadS, C::AccelYMS2].into_iter().zip(logged)
        {
            drive.set(c, x);
        }
        let d = Prepared::new(&drive, &plant);
        let off = |t: &Theta| {
            residuals(&d, &plant, t).map(|x| x[100..].iter().map(|x| x * x).sum::<f64>().sqrt())
        };
        let mut theta = [0.0; PARAMS];
        let flat = off(&theta);
        theta[P::CurveBank as usize] = BANK_RAD_M;
        theta[P::AccelYAhead as usize] = AHEAD_M;
        for (j, (own, flat)) in off(&theta).iter().zip(flat).enumerate() {
            assert!(*own < 0.05 * flat, "{j}: {own} of {flat}");
        }
    }

    #[test]
    fn a_lag_follows_a_ramp_one_lag_behind_whatever_the_sample_time() {
        for lag in [0.02, 0.08, 0.3] {
            let (keep, shares) = first_order_hold(lag, Drive::STEP_S);
            let mut angle = 0.0;
            for i in 0..200 {
                let target = f64::from(i) * Drive::STEP_S;
                angle = keep * angle + shares[0] * target + shares[1] * (target + Drive::STEP_S);
            }
            assert!((angle - (200.0 * Drive::STEP_S - lag)).abs() < 1e-9, "{lag}: {angle}");
        }
    }
}
