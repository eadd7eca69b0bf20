//! The yaw-sideslip model, Eq. 3-10 of the paper, corrected.
//!
//! State `s = [v_yc, omega_c, omega_t, gamma]`: lateral speed of the tractor's CG in tractor axes,
//! yaw rates of tractor and trailer, and gamma = tractor heading minus trailer heading.
//!
//! | symbol | meaning |
//! |---|---|
//! | m_c, I_c, m_t, I_t | masses and yaw inertias |
//! | L_h, L_t1 | hitch behind the tractor's CG, trailer CG behind the hitch |
//! | x_j, C_j | axle position ahead of the tractor's CG (j = 1..3) and its cornering stiffness |
//! | l_j, C_j | axle position behind the hitch (j = 4..6) and its cornering stiffness |
//! | F_j | axle side force, to the left |
//!
//! ```text
//! H s' = g(s, delta)                                   H of Eq. 9
//! F_1 = C_1 (delta - (v_yc + x_1 omega_c)/v)           F_j = -C_j (v_yc + x_j omega_c)/v
//! F_j = -C_j ((v_yc - L_h omega_c - l_j omega_t)/v + gamma)             on the trailer
//! ```
//! Corrections against the printed equations: Eq. 3 needs the Boltzmann-Hamel terms because its
//! velocities are body-fixed. They are the accelerations `v omega_c` of *both* bodies in tractor
//! axes (Eq. 7 uses `v omega_t` with the trailer velocity of Eq. 5, which belongs to tractor axes:
//! a frame error), and the x-component of the trailer's side forces (`F_3 gamma`) is second order.
//! A longitudinal acceleration adds `L_t1 m_t (v' + g grade) gamma` to the trailer's row,
//! longitudinal axle forces add their components along the tractor's y axis.
//!
//! Left out: second-order terms in the angles, longitudinal load transfer.

use tractrix_core::GRAVITY_M_S2;

use super::{AXLES, LateralParameters, LoadedAxle, TyreLaw};

/// Three generalised forces: along v_yc, about the tractor's CG, about the hitch.
pub(super) type Force3 = [f64; 3];

/// Constants of the model for one loading state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct YawSideslip {
    /// Tractor mass, kg.
    pub tractor_mass_kg: f64,
    /// Trailer mass with payload, kg.
    pub trailer_mass_kg: f64,
    /// Tractor yaw inertia, kg m².
    pub tractor_inertia_kg_m2: f64,
    /// Trailer yaw inertia with payload, kg m².
    pub trailer_inertia_kg_m2: f64,
    /// Hitch behind the tractor's CG, m (L_h).
    pub hitch_behind_cg_m: f64,
    /// Trailer CG behind the hitch, m (L_t1).
    pub trailer_cg_behind_hitch_m: f64,
    /// Drive-group centre behind the tractor's CG, m (L_c2).
    pub drive_group_behind_cg_m: f64,
    /// Axles ahead of the tractor's CG (first three) and behind the hitch (last three), m.
    pub axle_position_m: [f64; AXLES],
    /// Axle cornering stiffness, N/rad.
    pub stiffness_n_rad: [f64; AXLES],
    /// Static axle loads, N.
    pub axle_load_n: [f64; AXLES],
    /// Relaxation length of the tyres, m.
    pub relaxation_length_m: f64,
    /// Tyre law.
    pub law: TyreLaw,
    /// Inverse of the upper-left 3x3 block of H.
    inverse_mass: [[f64; 3]; 3],
}

/// The linear model at one speed: `s' = A s + B_delta delta + B_c F_c + B_t F_t`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateSpace {
    /// System matrix A (Eq. 10), rows.
    pub a: [[f64; 4]; 4],
    /// Input column of the road-wheel angle, per rad.
    pub b_steer: [f64; 4],
    /// Input column of a side force at the tractor's CG, per N.
    pub b_tractor_force: [f64; 4],
    /// Input column of a side force at the trailer's CG, per N.
    pub b_trailer_force: [f64; 4],
    /// Input column of a yaw moment on the trailer, per Nm.
    pub b_trailer_moment: [f64; 4],
}

/// External loads and longitudinal quantities that the side forces depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Loads {
    /// Side force at and yaw moment about the tractor's CG.
    pub(super) tractor: [f64; 2],
    /// Side force at and yaw moment about the trailer's CG.
    pub(super) trailer: [f64; 2],
    /// `v' + g grade`, m/s².
    pub(super) specific_force_m_s2: f64,
    /// Longitudinal force of each axle, N.
    pub(super) longitudinal_n: [f64; AXLES],
    /// Tyres of each axle under these loads.
    pub(super) tyres: [LoadedAxle; AXLES],
}

impl YawSideslip {
    /// Constants of the loading state that the parameters describe.
    #[must_use]
    pub fn new(p: &LateralParameters) -> Self {
        let trailer = p.loaded_trailer();
        let load = p.static_axle_load_n();
        let mut model = Self {
            tractor_mass_kg: p.tractor.mass_kg,
            trailer_mass_kg: trailer.mass_kg,
            tractor_inertia_kg_m2: p.tractor.yaw_inertia_kg_m2,
            trailer_inertia_kg_m2: trailer.yaw_inertia_kg_m2,
            hitch_behind_cg_m: p.tractor.hitch_behind_cg_m,
            trailer_cg_behind_hitch_m: trailer.cg_behind_hitch_m,
            drive_group_behind_cg_m: p.tractor.drive_group_behind_cg_m,
            axle_position_m: p.axle_positions_m(),
            stiffness_n_rad: p.tyres.stiffness_n_rad(&load),
            axle_load_n: load,
            relaxation_length_m: p.tyres.relaxation_length_m,
            law: p.tyres.law,
            inverse_mass: [[0.0; 3]; 3],
        };
        model.inverse_mass = inverse3(&model.mass_matrix());
        model
    }

    /// Upper-left 3x3 block of H (Eq. 9).
    #[must_use]
    pub fn mass_matrix(&self) -> [[f64; 3]; 3] {
        let (m, lh, lt) =
            (self.trailer_mass_kg, self.hitch_behind_cg_m, self.trailer_cg_behind_hitch_m);
        [
            [self.tractor_mass_kg + m, -lh * m, -lt * m],
            [-lh * m, m * lh * lh + self.tractor_inertia_kg_m2, lh * lt * m],
            [-lt * m, lh * lt * m, m * lt * lt + self.trailer_inertia_kg_m2],
        ]
    }

    /// `sum C_j, sum l_j C_j, sum l_j² C_j` of the trailer axles (C_3, S_1, S_2).
    pub(super) fn trailer_moments(&self) -> (f64, f64, f64) {
        (3..AXLES).fold((0.0, 0.0, 0.0), |(s0, s1, s2), j| {
            let (l, c) = (self.axle_position_m[j], self.stiffness_n_rad[j]);
            (s0 + c, s1 + l * c, s2 + l * l * c)
        })
    }

    /// A_h of Eq. 8 without its last row: derivative of the generalised forces by the state, with this
    /// part of the tyres' side force.
    #[inline]
    pub(super) fn force_jacobian(
        &self,
        v: f64,
        specific_force: f64,
        tyre_frac: f64,
    ) -> [[f64; 4]; 3] {
        let x = &self.axle_position_m;
        let c = self.stiffness_n_rad.map(|c| c * tyre_frac);
        let (lh, lt, mt) =
            (self.hitch_behind_cg_m, self.trailer_cg_behind_hitch_m, self.trailer_mass_kg);
        let (c3, s1, s2) = self.trailer_moments();
        let (c3, s1, s2) = (c3 * tyre_frac, s1 * tyre_frac, s2 * tyre_frac);
        let c12 = c[0] + c[1] + c[2];
        let z1 = x[0] * c[0] + x[1] * c[1] + x[2] * c[2];
        let z2 = x[0] * x[0] * c[0] + x[1] * x[1] * c[1] + x[2] * x[2] * c[2];
        let w = 1.0 / v;
        let z = (z1 - lh * c3) * w;
        [
            [-(c12 + c3) * w, -z - (self.tractor_mass_kg + mt) * v, s1 * w, -c3],
            [-z, -(z2 + lh * lh * c3) * w + lh * mt * v, -lh * s1 * w, lh * c3],
            [s1 * w, -lh * s1 * w + lt * mt * v, -s2 * w, s1 + lt * mt * specific_force],
        ]
    }

    /// State matrix and input columns of the linear model at speed `v` > 0, m/s (Eq. 10).
    #[must_use]
    pub fn state_space(&self, v: f64) -> StateSpace {
        let jacobian = self.force_jacobian(v, 0.0, 1.0);
        let column = |k: usize| self.accelerations(&core::array::from_fn(|i| jacobian[i][k]));
        let columns: [Force3; 4] = core::array::from_fn(column);
        let mut a = [[0.0; 4]; 4];
        for (i, row) in a.iter_mut().take(3).enumerate() {
            *row = core::array::from_fn(|k| columns[k][i]);
        }
        a[3] = [0.0, 1.0, -1.0, 0.0];
        let (c1, x1) = (self.stiffness_n_rad[0], self.axle_position_m[0]);
        let input = |g: Force3| {
            let [p, q, r] = self.accelerations(&g);
            [p, q, r, 0.0]
        };
        StateSpace {
            a,
            b_steer: input([c1, x1 * c1, 0.0]),
            b_tractor_force: input([1.0, 0.0, 0.0]),
            b_trailer_force: input([1.0, -self.hitch_behind_cg_m, -self.trailer_cg_behind_hitch_m]),
            b_trailer_moment: input([0.0, 0.0, 1.0]),
        }
    }

    /// Slip angle of every axle, rad, positive when it gives a force to the left.
    #[inline]
    #[must_use]
    pub fn slip_rad(&self, v: f64, s: &[f64; 4], delta: f64) -> [f64; AXLES] {
        let x = &self.axle_position_m;
        let [vy, wc, wt, gamma] = *s;
        let w = 1.0 / v;
        let hitch = (vy - self.hitch_behind_cg_m * wc) * w + gamma;
        [
            delta - (vy + x[0] * wc) * w,
            -(vy + x[1] * wc) * w,
            -(vy + x[2] * wc) * w,
            x[3] * wt * w - hitch,
            x[4] * wt * w - hitch,
            x[5] * wt * w - hitch,
        ]
    }

    /// Tyres of every axle under its static and these longitudinal loads, N.
    #[inline]
    pub(super) fn tyres(&self, longitudinal_n: &[f64; AXLES]) -> [LoadedAxle; AXLES] {
        core::array::from_fn(|j| {
            self.law.under_load(self.stiffness_n_rad[j], self.axle_load_n[j], longitudinal_n[j])
        })
    }

    /// Generalised forces of side forces of the axles, N.
    #[inline]
    pub(super) fn of_axles(&self, f: &[f64; AXLES]) -> Force3 {
        let x = &self.axle_position_m;
        let trailer = f[3] + f[4] + f[5];
        [
            f[0] + f[1] + f[2] + trailer,
            x[0] * f[0] + x[1] * f[1] + x[2] * f[2] - self.hitch_behind_cg_m * trailer,
            -(x[3] * f[3] + x[4] * f[4] + x[5] * f[5]),
        ]
    }

    /// Generalised forces g of `H s' = g`, first three rows, with the tyres at these slip angles, rad.
    #[inline]
    pub(super) fn force(
        &self,
        v: f64,
        s: &[f64; 4],
        delta: f64,
        slip: &[f64; AXLES],
        loads: &Loads,
    ) -> Force3 {
        let f: [f64; AXLES] = core::array::from_fn(|j| loads.tyres[j].side_force_n(slip[j]));
        let x = &self.axle_position_m;
        let fx = &loads.longitudinal_n;
        let [_, wc, _, gamma] = *s;
        let steer = f[0] + fx[0] * delta;
        let trailer = f[3] + f[4] + f[5] - (fx[3] + fx[4] + fx[5]) * gamma + loads.trailer[0];
        let (lh, lt, mt) =
            (self.hitch_behind_cg_m, self.trailer_cg_behind_hitch_m, self.trailer_mass_kg);
        let turn = v * wc;
        [
            steer + f[1] + f[2] + trailer + loads.tractor[0] - (self.tractor_mass_kg + mt) * turn,
            x[0] * steer + x[1] * f[1] + x[2] * f[2] - lh * trailer
                + loads.tractor[1]
                + lh * mt * turn,
            -(x[3] * f[3] + x[4] * f[4] + x[5] * f[5]) - lt * loads.trailer[0]
                + loads.trailer[1]
                + lt * mt * (turn + loads.specific_force_m_s2 * gamma),
        ]
    }

    /// `H^-1 g`: accelerations of the first three states.
    #[inline]
    #[must_use]
    pub(super) fn accelerations(&self, g: &Force3) -> Force3 {
        let h = &self.inverse_mass;
        core::array::from_fn(|i| h[i][0] * g[0] + h[i][1] * g[1] + h[i][2] * g[2])
    }

    /// Side force of a banked road on a body, N: bank in rad, left side up positive.
    #[inline]
    pub(super) fn bank_force_n(mass_kg: f64, bank_rad: f64) -> f64 {
        -mass_kg * GRAVITY_M_S2 * bank_rad
    }
}

/// Inverse of a symmetric positive definite 3x3 matrix by cofactors.
fn inverse3(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum::<f64>();
    core::array::from_fn(|i| core::array::from_fn(|j| cofactor(j, i) / determinant))
}
