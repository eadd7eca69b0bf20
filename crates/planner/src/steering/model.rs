//! The linear tractor-semitrailer in the lateral controller's words, built from
//! [`LateralLimits`] alone (the paper's Eq. 3-10 with its frame errors corrected).
//!
//! State `x = [v_y, w_c, w_t, g, e_y, e_psi, delta]`:
//!
//! | symbol | unit | meaning |
//! |---|---|---|
//! | `v_y` | m/s | lateral speed of the tractor's centre of gravity, body axis |
//! | `w_c`, `w_t` | rad/s | yaw rate of tractor and trailer |
//! | `g` | rad | articulation, tractor heading minus trailer heading |
//! | `e_y` | m | offset of the reference point from the path, left positive |
//! | `e_psi` | rad | tractor heading minus path heading |
//! | `delta` | rad | road-wheel angle, first-order lag behind the commanded one |
//!
//! Input: commanded road-wheel angle. Disturbance: path curvature (left positive).

use nalgebra::{SMatrix, SVector};
use tractrix_core::{Geometry, LateralLimits};

/// State vector.
pub(super) type State = SVector<f64, 7>;
/// State matrix.
pub(super) type Matrix = SMatrix<f64, 7, 7>;

/// Lowest speed at which the linear model is used, m/s; below it is stiff and the truck kinematic.
pub(crate) const LOWEST_SPEED_M_S: f64 = 3.0;

/// Discrete model `x+ = A x + B u + E kappa` and its steady state per unit of curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DiscreteModel {
    /// State matrix.
    pub a: Matrix,
    /// Input vector.
    pub b: State,
    /// Curvature vector.
    pub e: State,
    /// Steady state on a path of unit curvature.
    pub x_steady: State,
    /// Steady road-wheel angle for unit curvature, rad m.
    pub u_steady: f64,
}

/// Yaw model `d/dt [v_y, w_c, w_t, g] = A s + B delta`; `None` if the inertia matrix is singular.
fn yaw_model(
    l: &LateralLimits,
    g: &Geometry,
    v: f64,
) -> Option<(SMatrix<f64, 4, 4>, SVector<f64, 4>)> {
    let (m_c, m_t) = (l.tractor_mass_kg, l.trailer_mass_kg);
    let (i_c, i_t) = (l.tractor_inertia_kg_m2, l.trailer_inertia_kg_m2);
    let l_c1 = g.wheelbase_m - g.cg_ahead_m;
    let l_h = g.cg_ahead_m - g.hitch_ahead_m;
    let l_t1 = l.trailer_cg_behind_hitch_m;
    let (a_f, a_r) = (g.cg_ahead_m - l.drive_half_spread_m, g.cg_ahead_m + l.drive_half_spread_m);
    let (c1, c2, c3) =
        (l.steer_stiffness_n_rad, l.drive_stiffness_n_rad, l.trailer_stiffness_n_rad);
    let l_m = g.hitch_to_trailer_axle_m;
    let s = l.trailer_half_spread_m;
    let z1 = l_c1 * c1 - 0.5 * c2 * (a_f + a_r);
    let z2 = l_c1 * l_c1 * c1 + 0.5 * c2 * (a_f * a_f + a_r * a_r);
    let s1 = l_m * c3;
    let s2 = (l_m * l_m + 2.0 / 3.0 * s * s) * c3;
    #[rustfmt::skip]
    let h = SMatrix::<f64, 4, 4>::new(
        m_c + m_t,   -m_t * l_h,               -m_t * l_t1,              0.0,
        -m_t * l_h,  m_t * l_h * l_h + i_c,    m_t * l_h * l_t1,         0.0,
        -m_t * l_t1, m_t * l_h * l_t1,         m_t * l_t1 * l_t1 + i_t,  0.0,
        0.0,         0.0,                      0.0,                      1.0,
    );
    #[rustfmt::skip]
    let a_h = SMatrix::<f64, 4, 4>::new(
        -(c1 + c2 + c3) / v,   -(z1 - l_h * c3) / v - (m_c + m_t) * v,      s1 / v,         -c3,
        -(z1 - l_h * c3) / v,  -(z2 + l_h * l_h * c3) / v + l_h * m_t * v,  -l_h * s1 / v,  l_h * c3,
        s1 / v,                -l_h * s1 / v + l_t1 * m_t * v,              -s2 / v,        s1,
        0.0,                   1.0,                                        -1.0,           0.0,
    );
    let b_h = SVector::<f64, 4>::new(c1, l_c1 * c1, 0.0, 0.0);
    let inverse = h.try_inverse()?;
    Some((inverse * a_h, inverse * b_h))
}

/// The discrete model at `speed_m_s` for steps of `dt_s`; `None` if the data are degenerate.
#[must_use]
pub(super) fn discrete_model(
    l: &LateralLimits,
    g: &Geometry,
    speed_m_s: f64,
    dt_s: f64,
) -> Option<DiscreteModel> {
    let v = speed_m_s.max(LOWEST_SPEED_M_S);
    let (a4, b4) = yaw_model(l, g, v)?;
    let lag = l.steering_lag_s.max(0.02);
    let mut a = Matrix::zeros();
    a.fixed_view_mut::<4, 4>(0, 0).copy_from(&a4);
    a.fixed_view_mut::<4, 1>(0, 6).copy_from(&b4);
    a[(4, 0)] = 1.0;
    a[(4, 1)] = -g.cg_ahead_m;
    a[(4, 5)] = v;
    a[(5, 1)] = 1.0;
    a[(6, 6)] = -1.0 / lag;
    // exp([A B E; 0 0 0] dt): exact for inputs held over the step
    let mut block = SMatrix::<f64, 9, 9>::zeros();
    block.fixed_view_mut::<7, 7>(0, 0).copy_from(&a);
    block[(6, 7)] = 1.0 / lag;
    block[(5, 8)] = -v;
    let exp = exponential(&(block * dt_s));

    let per_delta = -(a4.try_inverse()? * b4);
    let u_steady = v / per_delta[1];
    let s4 = per_delta * u_steady;
    let e_psi = -(s4[0] - g.cg_ahead_m * s4[1]) / v;
    let model = DiscreteModel {
        a: exp.fixed_view::<7, 7>(0, 0).into_owned(),
        b: exp.fixed_view::<7, 1>(0, 7).into_owned(),
        e: exp.fixed_view::<7, 1>(0, 8).into_owned(),
        x_steady: State::from([s4[0], s4[1], s4[2], s4[3], 0.0, e_psi, u_steady]),
        u_steady,
    };
    let finite = model.a.iter().chain(model.x_steady.iter()).all(|x| x.is_finite());
    finite.then_some(model)
}

/// Matrix exponential by scaling and squaring of the Taylor series (norm below 1/8, order 10).
fn exponential(m: &SMatrix<f64, 9, 9>) -> SMatrix<f64, 9, 9> {
    let norm = m.iter().fold(0.0_f64, |n, x| n.max(x.abs())) * 9.0;
    let mut halvings = 0;
    let mut scale = 1.0;
    while norm * scale > 0.125 && halvings < 40 {
        scale *= 0.5;
        halvings += 1;
    }
    let small = m * scale;
    let mut term = SMatrix::<f64, 9, 9>::identity();
    let mut sum = term;
    for k in 1..=10 {
        term = term * small / f64::from(k);
        sum += term;
    }
    for _ in 0..halvings {
        sum *= sum;
    }
    sum
}

/// Solves the discrete algebraic Riccati equation `P = A'P(I + B B'P/r)^-1 A + Q` by structured
/// doubling (Chu, Fan, Lin 2004): quadratic convergence. `None` without convergence.
#[must_use]
pub(super) fn solve_dare(a: &Matrix, b: &State, q: &Matrix, r: f64) -> Option<Matrix> {
    let (mut a_k, mut g_k, mut h_k) = (*a, b * b.transpose() / r, *q);
    for _ in 0..60 {
        let w = (Matrix::identity() + g_k * h_k).try_inverse()?;
        let aw = a_k * w;
        let next = h_k + a_k.transpose() * h_k * w * a_k;
        let change = (next - h_k).abs().max();
        g_k += aw * g_k * a_k.transpose();
        a_k = aw * a_k;
        h_k = (next + next.transpose()) * 0.5;
        if !change.is_finite() {
            return None;
        }
        if change <= 1e-12 * h_k.abs().max() {
            return Some(h_k);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{reference_geometry, reference_lateral};

    #[test]
    fn the_steady_yaw_gain_equals_the_published_one_at_six_speeds() {
        for (v, gain) in [
            (5.0, 1.143),
            (10.0, 2.283),
            (15.0, 3.416),
            (20.0, 4.540),
            (25.0, 5.652),
            (27.8, 6.268),
        ] {
            let m = discrete_model(&reference_lateral(), &reference_geometry(), v, 0.01).unwrap();
            assert!((v / m.u_steady - gain).abs() < 2e-3 * gain, "{v}: {}", v / m.u_steady);
        }
    }

    #[test]
    fn the_steady_state_is_a_fixed_point_of_the_discrete_model() {
        let m = discrete_model(&reference_lateral(), &reference_geometry(), 18.0, 0.02).unwrap();
        let next = m.a * m.x_steady + m.b * m.u_steady + m.e;
        assert!((next - m.x_steady).abs().max() < 1e-9);
    }

    #[test]
    fn the_riccati_solution_satisfies_its_equation_and_stabilises() {
        let m = discrete_model(&reference_lateral(), &reference_geometry(), 20.0, 0.02).unwrap();
        let mut q = Matrix::zeros();
        q[(4, 4)] = 100.0;
        let p = solve_dare(&m.a, &m.b, &q, 10.0).unwrap();
        let k = (m.b.transpose() * p * m.a) / (10.0 + (m.b.transpose() * p * m.b)[0]);
        let closed = m.a - m.b * k;
        let residual = m.a.transpose() * p * closed + q - p;
        assert!(residual.abs().max() < 1e-6 * p.abs().max());
        let mut x = State::from_element(0.1);
        for _ in 0..2000 {
            x = closed * x;
        }
        assert!(x.abs().max() < 1e-6);
    }
}
