//! Test-only reference: a planar multi-body tractor and semitrailer with nonlinear tyres.
//!
//! Two rigid bodies in inertial coordinates (Newton-Euler), joined by an explicit hitch force that
//! is solved from the constraint "both bodies have the hitch at the same place", stabilised after
//! Baumgarte. Tyre forces act at the true contact points, along the true wheel axes; slip angles
//! come from the contact points' inertial velocities. No small angles, no quasi-velocities, no
//! Lagrange function: nothing is shared with the model under test but the numbers of the truck.
//!
//! | symbol | meaning |
//! |---|---|
//! | e, n | unit vectors along and to the left of a body |
//! | lambda | force of the trailer on the tractor at the hitch, map axes, N |
//! | phi | hitch of the tractor minus hitch of the trailer, m |
#![allow(dead_code, reason = "every test binary uses its own part of this module")]
#![allow(clippy::unwrap_used, reason = "a test helper fails by panicking")]

pub(crate) mod linear;
pub(crate) mod measure;
pub(crate) mod trucks;

use dynamics::lateral::{LateralModel, LateralParameters};

/// Number of states: pose and velocity of both bodies, one slip per axle.
pub(crate) const N: usize = 18;
/// Rate of the constraint's stabilisation, 1/s.
const BAUMGARTE: f64 = 20.0;

/// Side force over slip angle.
#[derive(Clone, Copy)]
pub(crate) enum ReferenceTyre {
    /// `C alpha`.
    Linear,
    /// Magic formula (Pacejka) with shape factors fitted to a published heavy-truck tyre table
    /// (35 kN: 6.27 kN at 1, 12.19 kN at 2, 21.95 kN at 4 degrees).
    Magic { friction: f64 },
}

/// The reference truck.
#[derive(Clone, Copy)]
pub(crate) struct MultiBody {
    pub(crate) mass: [f64; 2],
    pub(crate) inertia: [f64; 2],
    pub(crate) hitch_behind_cg: f64,
    pub(crate) trailer_cg: f64,
    /// Drive-group centre behind the tractor's CG.
    pub(crate) reference_behind_cg: f64,
    /// Axles ahead of their body's CG.
    pub(crate) axle: [f64; 6],
    pub(crate) stiffness: [f64; 6],
    pub(crate) load: [f64; 6],
    pub(crate) tyre: ReferenceTyre,
    /// Relaxation length of the tyres, m; 0 for none.
    pub(crate) relaxation: f64,
}

/// What acts on it.
#[derive(Clone, Copy, Default)]
pub(crate) struct Action {
    pub(crate) delta: f64,
    /// Prescribed derivative of the tractor's longitudinal speed (the drive axles give the force);
    /// `None`: only `longitudinal` acts.
    pub(crate) accel: Option<f64>,
    /// Longitudinal force per axle.
    pub(crate) longitudinal: [f64; 6],
    /// Side force at each body's CG along its y axis.
    pub(crate) side: [f64; 2],
}

/// Everything that one evaluation gives.
#[derive(Clone, Copy)]
pub(crate) struct Evaluation {
    pub(crate) rate: [f64; N],
    pub(crate) hitch_force: [f64; 2],
    pub(crate) side_force: [f64; 6],
    pub(crate) drive_force: f64,
}

const BODY: [usize; 6] = [0, 0, 0, 1, 1, 1];

fn axes(angle: f64) -> ([f64; 2], [f64; 2]) {
    let (s, c) = angle.sin_cos();
    ([c, s], [-s, c])
}

fn plus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl MultiBody {
    /// The truck of these parameters (payload already in the trailer's figures).
    pub(crate) fn new(p: &LateralParameters, tyre: ReferenceTyre) -> Self {
        assert_eq!(p.payload.mass_kg, 0.0, "the reference has no third body");
        let m = LateralModel::new(p).unwrap();
        let y = m.yaw_sideslip();
        let (c, t) = (&p.tractor, &p.trailer);
        let to_cg = t.axle_group_behind_hitch_m - t.cg_behind_hitch_m;
        Self {
            mass: [c.mass_kg, t.mass_kg],
            inertia: [c.yaw_inertia_kg_m2, t.yaw_inertia_kg_m2],
            hitch_behind_cg: c.hitch_behind_cg_m,
            trailer_cg: t.cg_behind_hitch_m,
            reference_behind_cg: c.drive_group_behind_cg_m,
            axle: [
                c.steer_axle_ahead_of_cg_m,
                c.drive_half_spread_m - c.drive_group_behind_cg_m,
                -c.drive_half_spread_m - c.drive_group_behind_cg_m,
                t.axle_half_spread_m - to_cg,
                -to_cg,
                -t.axle_half_spread_m - to_cg,
            ],
            stiffness: y.stiffness_n_rad,
            load: y.axle_load_n,
            tyre,
            relaxation: 0.0,
        }
    }

    /// Initial state: reference point at the origin along the map's x axis, with the hitch closed
    /// and the 4-state model's state `[v_yc, omega_c, omega_t, gamma]` at speed `v`.
    pub(crate) fn start(&self, v: f64, s: [f64; 4]) -> [f64; N] {
        let [vy, wc, wt, gamma] = s;
        let (e, n) = axes(-gamma);
        let mut q = [0.0; N];
        q[0] = self.reference_behind_cg;
        q[3] = q[0] - self.hitch_behind_cg - self.trailer_cg * e[0];
        q[4] = -self.trailer_cg * e[1];
        q[5] = -gamma;
        (q[6], q[7], q[8]) = (v, vy, wc);
        q[9] = v - self.trailer_cg * wt * n[0];
        q[10] = vy - self.hitch_behind_cg * wc - self.trailer_cg * wt * n[1];
        q[11] = wt;
        q
    }

    fn side_force(&self, axle: usize, slip: f64) -> f64 {
        let c = self.stiffness[axle];
        match self.tyre {
            ReferenceTyre::Linear => c * slip,
            ReferenceTyre::Magic { friction } => {
                let (shape, curvature) = (1.65, -1.0);
                let peak = friction * self.load[axle];
                let x = c / (shape * peak) * slip;
                peak * (shape * (x - curvature * (x - x.atan())).atan()).sin()
            }
        }
    }

    /// Derivative of the state.
    pub(crate) fn evaluate(&self, q: &[f64; N], action: &Action) -> Evaluation {
        let Some(wanted) = action.accel else { return self.evaluate_with(q, action, 0.0) };
        // The longitudinal acceleration is affine in the drive force.
        let at = |force: f64| {
            let e = self.evaluate_with(q, action, force);
            let (along, across) = axes(q[2]);
            let v_across = dot([q[6], q[7]], across);
            dot([e.rate[6], e.rate[7]], along) + q[8] * v_across
        };
        let (free, unit) = (at(0.0), at(1e3));
        self.evaluate_with(q, action, 1e3 * (wanted - free) / (unit - free))
    }

    fn evaluate_with(&self, q: &[f64; N], action: &Action, drive: f64) -> Evaluation {
        let frame = [axes(q[2]), axes(q[5])];
        let (mut force, mut moment) = ([[0.0; 2]; 2], [0.0; 2]);
        let mut rate = [0.0; N];
        let mut side_force = [0.0; 6];
        for i in 0..6 {
            let b = BODY[i];
            let (e, n) = frame[b];
            let (vx, vy, w) = (q[6 + 3 * b], q[7 + 3 * b], q[8 + 3 * b]);
            let velocity = [vx + w * self.axle[i] * n[0], vy + w * self.axle[i] * n[1]];
            let heading = q[2 + 3 * b] + if i == 0 { action.delta } else { 0.0 };
            let (along, across) = axes(heading);
            let rolling = dot(velocity, along);
            let kinematic_slip = (-dot(velocity, across)).atan2(rolling);
            let slip = if self.relaxation > 0.0 {
                rate[12 + i] = (kinematic_slip - q[12 + i]) * rolling / self.relaxation;
                q[12 + i]
            } else {
                kinematic_slip
            };
            side_force[i] = self.side_force(i, slip);
            let fx = action.longitudinal[i] + if i == 1 || i == 2 { 0.5 * drive } else { 0.0 };
            let f: [f64; 2] = core::array::from_fn(|k| side_force[i] * across[k] + fx * along[k]);
            moment[b] += self.axle[i] * (e[0] * f[1] - e[1] * f[0]);
            force[b] = plus(force[b], f);
        }
        for b in 0..2 {
            force[b] = plus(force[b], frame[b].1.map(|n| action.side[b] * n));
        }
        let lambda = self.hitch_force(q, &frame, &force, &moment);
        for b in 0..2 {
            let sign = if b == 0 { 1.0 } else { -1.0 };
            let arm = if b == 0 { -self.hitch_behind_cg } else { self.trailer_cg };
            let (o, (_, n)) = (3 * b, frame[b]);
            rate[o..o + 3].copy_from_slice(&q[6 + o..9 + o]);
            for k in 0..2 {
                rate[6 + o + k] = (force[b][k] + sign * lambda[k]) / self.mass[b];
            }
            rate[8 + o] = (moment[b] + sign * arm * dot(n, lambda)) / self.inertia[b];
        }
        Evaluation { rate, hitch_force: lambda, side_force, drive_force: drive }
    }

    /// Solves `J M^-1 J' lambda = -J M^-1 Q - bias - stabilisation`.
    fn hitch_force(
        &self,
        q: &[f64; N],
        frame: &[([f64; 2], [f64; 2]); 2],
        force: &[[f64; 2]; 2],
        moment: &[f64; 2],
    ) -> [f64; 2] {
        let ((ec, nc), (et, nt)) = (frame[0], frame[1]);
        let (lh, lt) = (self.hitch_behind_cg, self.trailer_cg);
        let (wc, wt) = (q[8], q[11]);
        let mut rhs = [0.0; 2];
        let mut a = [[0.0; 2]; 2];
        for k in 0..2 {
            let gap = q[k] - lh * ec[k] - q[3 + k] - lt * et[k];
            let gap_rate = q[6 + k] - lh * wc * nc[k] - q[9 + k] - lt * wt * nt[k];
            let free = force[0][k] / self.mass[0]
                - lh * nc[k] * moment[0] / self.inertia[0]
                - force[1][k] / self.mass[1]
                - lt * nt[k] * moment[1] / self.inertia[1];
            let bias = lh * wc * wc * ec[k] + lt * wt * wt * et[k];
            rhs[k] = -free - bias - 2.0 * BAUMGARTE * gap_rate - BAUMGARTE * BAUMGARTE * gap;
            for j in 0..2 {
                let translation =
                    if j == k { 1.0 / self.mass[0] + 1.0 / self.mass[1] } else { 0.0 };
                a[k][j] = translation
                    + lh * lh * nc[k] * nc[j] / self.inertia[0]
                    + lt * lt * nt[k] * nt[j] / self.inertia[1];
            }
        }
        let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
        [(rhs[0] * a[1][1] - rhs[1] * a[0][1]) / det, (rhs[1] * a[0][0] - rhs[0] * a[1][0]) / det]
    }

    /// One RK4 step; `action` at the start, the middle and the end of the step.
    pub(crate) fn step(&self, q: &[f64; N], actions: [&Action; 3], dt: f64) -> [f64; N] {
        let shifted = |k: &[f64; N], h: f64| core::array::from_fn(|i| q[i] + h * k[i]);
        let k1 = self.evaluate(q, actions[0]).rate;
        let k2 = self.evaluate(&shifted(&k1, 0.5 * dt), actions[1]).rate;
        let k3 = self.evaluate(&shifted(&k2, 0.5 * dt), actions[1]).rate;
        let k4 = self.evaluate(&shifted(&k3, dt), actions[2]).rate;
        core::array::from_fn(|i| q[i] + dt / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }

    /// `[v_yc, omega_c, omega_t, gamma]` of a state.
    pub(crate) fn reduced(&self, q: &[f64; N]) -> [f64; 4] {
        let (_, n) = axes(q[2]);
        [dot([q[6], q[7]], n), q[8], q[11], q[2] - q[5]]
    }

    /// Derivative of the reduced state, by the chain rule on the inertial one.
    pub(crate) fn reduced_rate(&self, q: &[f64; N], action: &Action) -> [f64; 4] {
        let r = self.evaluate(q, action).rate;
        let (e, n) = axes(q[2]);
        let turn = -q[8] * dot([q[6], q[7]], e);
        [dot([r[6], r[7]], n) + turn, r[8], r[11], q[8] - q[11]]
    }

    /// Position of the reference point.
    pub(crate) fn reference_point(&self, q: &[f64; N]) -> [f64; 2] {
        let (e, _) = axes(q[2]);
        [q[0] - self.reference_behind_cg * e[0], q[1] - self.reference_behind_cg * e[1]]
    }

    /// Distance of the two bodies' hitch points: the constraint's error.
    pub(crate) fn hitch_gap(&self, q: &[f64; N]) -> f64 {
        let ((ec, _), (et, _)) = (axes(q[2]), axes(q[5]));
        let gap: [f64; 2] = core::array::from_fn(|k| {
            q[k] - self.hitch_behind_cg * ec[k] - q[3 + k] - self.trailer_cg * et[k]
        });
        dot(gap, gap).sqrt()
    }
}
