//! Steering, kinematics and yaw-sideslip dynamics in one step, from standstill to the stability
//! limit.
//!
//! Above [`BLEND_HIGH_M_S`] the truck moves as the 4-state model says, below [`BLEND_LOW_M_S`] as
//! the kinematic one; between them their velocities are mixed with a smooth weight `w(v)`. The
//! 4-state model runs all the time (below `BLEND_LOW_M_S` at that speed), the articulation and the
//! pose integrate the mixed velocities, so that nothing jumps when the truck stops, starts or
//! reverses.
//!
//! Integration: ROS2 (`rosenbrock`), linearly implicit: no step length or speed makes it unstable
//! because of tyre stiffness; steps up to 10 ms are accurate to better than 1e-3 of the response.
//!
//! Left out: small-angle geometry is kept above the blend (articulation beyond 0.3 rad at speed is
//! outside the model), and side forces do not move the kinematic model.

use super::relaxation::Relaxation;
use super::rosenbrock::{ROS2, Solver, mass_times};
use super::yaw_sideslip::{Force3, Loads};
use super::{
    AXLES, Kinematic, LateralError, LateralInputs, LateralOutputs, LateralParameters, LateralState,
    LoadTransfer, StateSpace, SteeringParameters, YawSideslip,
};

/// Speed below which the motion is kinematic, m/s.
pub const BLEND_LOW_M_S: f64 = 1.0;
/// Speed above which the motion is that of the 4-state model, m/s.
pub const BLEND_HIGH_M_S: f64 = 3.0;

/// The lateral model of one truck in one loading state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateralModel {
    yaw_sideslip: YawSideslip,
    kinematic: Kinematic,
    load_transfer: LoadTransfer,
    steering: SteeringParameters,
    max_articulation_rad: f64,
}

/// Slip angles of the axles, rad.
type Slip = [f64; AXLES];

/// Velocities in use, after blending.
#[derive(Clone, Copy)]
struct Motion {
    /// At the reference point.
    lateral_speed_m_s: f64,
    yaw_rate_rad_s: f64,
    trailer_yaw_rate_rad_s: f64,
}

impl LateralModel {
    /// Checks the parameters and precomputes loads, stiffnesses and effective lengths.
    ///
    /// # Errors
    /// [`LateralError`] lists every violated bound.
    pub fn new(parameters: &LateralParameters) -> Result<Self, LateralError> {
        let violations = parameters.violations();
        if !violations.is_empty() {
            return Err(LateralError { violations });
        }
        let yaw_sideslip = YawSideslip::new(parameters);
        Ok(Self {
            kinematic: Kinematic::from_yaw_sideslip(&yaw_sideslip),
            yaw_sideslip,
            load_transfer: LoadTransfer::new(parameters),
            steering: parameters.steering,
            max_articulation_rad: parameters.max_articulation_rad,
        })
    }

    /// The 4-state part.
    #[must_use]
    pub fn yaw_sideslip(&self) -> &YawSideslip {
        &self.yaw_sideslip
    }

    /// The kinematic part.
    #[must_use]
    pub fn kinematic(&self) -> &Kinematic {
        &self.kinematic
    }

    /// Load transfer.
    #[must_use]
    pub fn load_transfer(&self) -> &LoadTransfer {
        &self.load_transfer
    }

    /// Steering gear.
    #[must_use]
    pub fn steering(&self) -> &SteeringParameters {
        &self.steering
    }

    /// State matrix and input columns at speed `v` > 0, m/s (Eq. 10).
    #[must_use]
    pub fn state_matrix(&self, v: f64) -> StateSpace {
        self.yaw_sideslip.state_space(v)
    }

    /// What a planner may know about handling.
    #[must_use]
    pub fn limits(&self) -> tractrix_core::LateralLimits {
        let m = &self.yaw_sideslip;
        let [c1, c2, c3, c4, c5, c6] = m.stiffness_n_rad;
        let x = &m.axle_position_m;
        tractrix_core::LateralLimits {
            steering_ratio: self.steering.ratio,
            steering_lag_s: self.steering.lag_s,
            tractor_mass_kg: m.tractor_mass_kg,
            tractor_inertia_kg_m2: m.tractor_inertia_kg_m2,
            trailer_mass_kg: m.trailer_mass_kg,
            trailer_inertia_kg_m2: m.trailer_inertia_kg_m2,
            trailer_cg_behind_hitch_m: m.trailer_cg_behind_hitch_m,
            drive_half_spread_m: 0.5 * (x[1] - x[2]),
            trailer_half_spread_m: 0.5 * (x[5] - x[3]),
            steer_stiffness_n_rad: c1,
            drive_stiffness_n_rad: c2 + c3,
            trailer_stiffness_n_rad: c4 + c5 + c6,
            rollover_accel_m_s2: self.load_transfer.rollover_accel_m_s2(),
            max_road_wheel_rad: self.steering.max_wheel_rad / self.steering.ratio,
        }
    }

    /// State after `dt_s` (up to 10 ms for full accuracy), inputs held.
    #[must_use]
    pub fn step(&self, state: &LateralState, inputs: &LateralInputs, dt_s: f64) -> LateralState {
        let steering = self.steering.step(&state.steering, inputs.steering_wheel_rad, dt_s);
        let deltas = [state.steering.road_wheel_rad, steering.road_wheel_rad];
        let next = self.integrate(state, inputs, deltas, dt_s);
        LateralState { steering, ..next }
    }

    /// One ROS2 step with the road-wheel angle at the start and at the end of the step.
    #[inline]
    fn integrate(
        &self,
        state: &LateralState,
        inputs: &LateralInputs,
        deltas: [f64; 2],
        dt: f64,
    ) -> LateralState {
        let m = &self.yaw_sideslip;
        let loads = self.loads(inputs);
        let v = inputs.speed_m_s.max(BLEND_LOW_M_S);
        let weight = blend(inputs.speed_m_s);
        let s0 = reduced(state);
        let lag = Relaxation::new(m, v, dt);
        let tyre_frac = lag.map_or(1.0, |lag| lag.tyre_frac);
        let solver = Solver::new(m, v, loads.specific_force_m_s2, ROS2 * dt, weight, tyre_frac);
        // The second stage solves with f - 2 k1, here premultiplied by H.
        let stage = |s: &[f64; 4], tyres: &Slip, delta: f64, first: Option<&([f64; 4], Slip)>| {
            let wheels = m.slip_rad(v, s, delta);
            let hk = first.map_or([0.0; 3], |(k, _)| mass_times(m, k));
            let (k3, less) = first.map_or((0.0, [0.0; AXLES]), |(k, t)| (k[3], t.map(|x| 2.0 * x)));
            let acting = if lag.is_some() { tyres } else { &wheels };
            let g = m.force(v, s, delta, acting, &loads);
            let g: Force3 = core::array::from_fn(|i| g[i] - 2.0 * hk[i]);
            let u = self.motion(inputs.speed_m_s, weight, s, delta);
            let r = u.yaw_rate_rad_s - u.trailer_yaw_rate_rad_s - 2.0 * k3;
            let Some(lag) = lag else { return (solver.solve(g, r), [0.0; AXLES]) };
            let own = lag.own(&wheels, tyres, &less);
            let own_force = lag.force(m, &own);
            let k = solver.solve(core::array::from_fn(|i| g[i] + own_force[i]), r);
            (k, lag.rate(m, v, &k, &own))
        };
        let first = stage(&s0, &state.tyre_slip_rad, deltas[0], None);
        let (k1, t1) = &first;
        let s1 = core::array::from_fn(|i| s0[i] + dt * k1[i]);
        let tyres1 = core::array::from_fn(|j| state.tyre_slip_rad[j] + dt * t1[j]);
        let (k2, t2) = stage(&s1, &tyres1, deltas[1], Some(&first));
        let s: [f64; 4] = core::array::from_fn(|i| s0[i] + dt * (1.5 * k1[i] + 0.5 * k2[i]));
        let s = self.stop(s);
        let next = self.move_pose(state, inputs.speed_m_s, weight, [&s0, &s], deltas, dt);
        let tyre_slip_rad =
            core::array::from_fn(|j| state.tyre_slip_rad[j] + dt * (1.5 * t1[j] + 0.5 * t2[j]));
        LateralState { tyre_slip_rad, ..next }
    }

    /// Articulation stop: clamps gamma and makes the bodies turn together if they fold further,
    /// by the impulse moment of an inelastic hinge stop.
    #[inline]
    fn stop(&self, mut s: [f64; 4]) -> [f64; 4] {
        if s[3].abs() > self.max_articulation_rad {
            s[3] = s[3].clamp(-self.max_articulation_rad, self.max_articulation_rad);
            let fold = s[1] - s[2];
            if fold * s[3] > 0.0 {
                let kick = self.yaw_sideslip.accelerations(&[0.0, -1.0, 1.0]);
                let impulse = fold / (kick[2] - kick[1]);
                for (value, k) in s.iter_mut().zip(kick) {
                    *value += k * impulse;
                }
            }
        }
        s
    }

    /// Pose of the reference point by the midpoint of the velocities before and after.
    #[inline]
    fn move_pose(
        &self,
        state: &LateralState,
        speed: f64,
        weight: f64,
        s: [&[f64; 4]; 2],
        deltas: [f64; 2],
        dt: f64,
    ) -> LateralState {
        let before = self.motion(speed, weight, s[0], deltas[0]);
        let after = self.motion(speed, weight, s[1], deltas[1]);
        let turn = 0.5 * dt * (before.yaw_rate_rad_s + after.yaw_rate_rad_s);
        let lateral = 0.5 * (before.lateral_speed_m_s + after.lateral_speed_m_s);
        let (sin, cos) = libm::sincos(state.yaw_rad + 0.5 * turn);
        LateralState {
            x_m: state.x_m + dt * (speed * cos - lateral * sin),
            y_m: state.y_m + dt * (speed * sin + lateral * cos),
            yaw_rad: state.yaw_rad + turn,
            articulation_rad: -s[1][3],
            cg_lateral_speed_m_s: s[1][0],
            yaw_rate_rad_s: s[1][1],
            trailer_yaw_rate_rad_s: s[1][2],
            ..*state
        }
    }

    /// Blended velocities.
    #[inline]
    fn motion(&self, speed: f64, weight: f64, s: &[f64; 4], delta: f64) -> Motion {
        let dynamic = Motion {
            lateral_speed_m_s: s[0] - self.yaw_sideslip.drive_group_behind_cg_m * s[1],
            yaw_rate_rad_s: s[1],
            trailer_yaw_rate_rad_s: s[2],
        };
        if weight >= 1.0 {
            return dynamic;
        }
        let mut k = self.kinematic.velocity(speed, delta, -s[3]);
        if s[3].abs() >= self.max_articulation_rad
            && (k.yaw_rate_rad_s - k.trailer_yaw_rate_rad_s) * s[3] > 0.0
        {
            k.trailer_yaw_rate_rad_s = k.yaw_rate_rad_s;
        }
        let mix = |d: f64, k: f64| k + weight * (d - k);
        Motion {
            lateral_speed_m_s: mix(dynamic.lateral_speed_m_s, k.lateral_speed_m_s),
            yaw_rate_rad_s: mix(dynamic.yaw_rate_rad_s, k.yaw_rate_rad_s),
            trailer_yaw_rate_rad_s: mix(dynamic.trailer_yaw_rate_rad_s, k.trailer_yaw_rate_rad_s),
        }
    }

    fn loads(&self, inputs: &LateralInputs) -> Loads {
        let m = &self.yaw_sideslip;
        let bank = |mass| YawSideslip::bank_force_n(mass, inputs.bank_rad);
        Loads {
            tractor: [
                inputs.tractor.side_n + bank(m.tractor_mass_kg),
                inputs.tractor.yaw_moment_nm,
            ],
            trailer: [
                inputs.trailer.side_n + bank(m.trailer_mass_kg),
                inputs.trailer.yaw_moment_nm,
            ],
            specific_force_m_s2: inputs.accel_x_m_s2
                + tractrix_core::GRAVITY_M_S2 * inputs.grade_rad,
            longitudinal_n: inputs.axle_longitudinal_force_n,
            tyres: m.tyres(&inputs.axle_longitudinal_force_n),
        }
    }

    /// What sensors and other effects want to know in this state under these inputs.
    #[must_use]
    pub fn outputs(&self, state: &LateralState, inputs: &LateralInputs) -> LateralOutputs {
        let m = &self.yaw_sideslip;
        let loads = self.loads(inputs);
        let v = inputs.speed_m_s.max(BLEND_LOW_M_S);
        let weight = blend(inputs.speed_m_s);
        let delta = state.steering.road_wheel_rad;
        let s = reduced(state);
        let slip_rad = m.slip_rad(v, &s, delta);
        let acting = if m.relaxation_length_m > 0.0 { &state.tyre_slip_rad } else { &slip_rad };
        let side_force_n: [f64; AXLES] =
            core::array::from_fn(|j| loads.tyres[j].side_force_n(acting[j]));
        let [vy_dot, wc_dot, wt_dot] = m.accelerations(&m.force(v, &s, delta, acting, &loads));
        let u = self.motion(inputs.speed_m_s, weight, &s, delta);
        // Below the blend the turn is taken as steady.
        let turn = inputs.speed_m_s * u.yaw_rate_rad_s;
        let tractor = turn + weight * vy_dot;
        let trailer = tractor
            - weight * (m.hitch_behind_cg_m * wc_dot + m.trailer_cg_behind_hitch_m * wt_dot);
        let own = side_force_n[0]
            + side_force_n[1]
            + side_force_n[2]
            + loads.longitudinal_n[0] * delta
            + loads.tractor[0];
        LateralOutputs {
            lateral_speed_m_s: u.lateral_speed_m_s,
            accel_y_m_s2: tractor - weight * m.drive_group_behind_cg_m * wc_dot,
            tractor_accel_y_m_s2: tractor,
            trailer_accel_y_m_s2: trailer,
            yaw_rate_rad_s: u.yaw_rate_rad_s,
            trailer_yaw_rate_rad_s: u.trailer_yaw_rate_rad_s,
            yaw_accel_rad_s2: weight * wc_dot,
            articulation_rad: state.articulation_rad,
            road_wheel_rad: delta,
            slip_rad,
            side_force_n,
            hitch_force_n: m.tractor_mass_kg * tractor - own,
            load_transfer_ratio: self.load_transfer.ratio(tractor, trailer, inputs.bank_rad),
        }
    }
}

/// The 4-state model's state.
#[inline]
fn reduced(state: &LateralState) -> [f64; 4] {
    [
        state.cg_lateral_speed_m_s,
        state.yaw_rate_rad_s,
        state.trailer_yaw_rate_rad_s,
        -state.articulation_rad,
    ]
}

/// Weight of the 4-state model over speed: 0 below the blend, 1 above, smooth between.
#[inline]
fn blend(speed_m_s: f64) -> f64 {
    let z = ((speed_m_s - BLEND_LOW_M_S) / (BLEND_HIGH_M_S - BLEND_LOW_M_S)).clamp(0.0, 1.0);
    z * z * (3.0 - 2.0 * z)
}
