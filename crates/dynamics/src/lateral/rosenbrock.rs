//! The linear systems of the integration method.
//!
//! ROS2 (Verwer, Spee, Blom, Hundsdorfer, SIAM J. Sci. Comput. 20, 1999) for `s' = f(t, s)` with
//! `c = (1 - 1/sqrt(2)) h` and any J near the Jacobian:
//!
//! ```text
//! (I - c J) k_1 = f(t, s)        (I - c J) k_2 = f(t + h, s + h k_1) - 2 k_1
//! s_next = s + 3/2 h k_1 + 1/2 h k_2
//! ```
//! L-stable and of order 2. Here J is the linear model's, and the first three rows are multiplied
//! by H (Eq. 8), so that no inverse is needed; one factorisation serves both stages.

use super::YawSideslip;
use super::yaw_sideslip::Force3;

/// `1 - 1/sqrt(2)`: the method's parameter.
pub(super) const ROS2: f64 = 1.0 - core::f64::consts::FRAC_1_SQRT_2;

/// First three rows of `H k`.
#[inline]
pub(super) fn mass_times(m: &YawSideslip, k: &[f64; 4]) -> Force3 {
    let h = m.mass_matrix();
    core::array::from_fn(|i| h[i][0] * k[0] + h[i][1] * k[1] + h[i][2] * k[2])
}

/// Factors of `H - c A_h` with the articulation eliminated: `k_4 = r + c w (k_2 - k_3)`, and with the
/// tyres' own slip angles, which leave a part of their side force there.
pub(super) struct Solver {
    /// Triangular factors of the 3x3 system; reciprocal pivots on the diagonal.
    lu: [[f64; 3]; 3],
    /// `c` times the articulation column of A_h.
    gamma: Force3,
    cw: f64,
}

impl Solver {
    #[inline]
    pub(super) fn new(
        m: &YawSideslip,
        v: f64,
        specific_force: f64,
        c: f64,
        weight: f64,
        tyre_frac: f64,
    ) -> Self {
        let (h, j) = (m.mass_matrix(), m.force_jacobian(v, specific_force, tyre_frac));
        let cw = c * weight;
        let gamma: Force3 = core::array::from_fn(|i| c * j[i][3]);
        let mut a: [[f64; 3]; 3] =
            core::array::from_fn(|i| core::array::from_fn(|k| h[i][k] - c * j[i][k]));
        for (row, g) in a.iter_mut().zip(gamma) {
            row[1] -= cw * g;
            row[2] += cw * g;
        }
        // The symmetric part is positive definite (mass and tyre damping): no pivoting needed.
        a[0][0] = 1.0 / a[0][0];
        for i in 1..3 {
            a[i][0] *= a[0][0];
            a[i][1] -= a[i][0] * a[0][1];
            a[i][2] -= a[i][0] * a[0][2];
        }
        a[1][1] = 1.0 / a[1][1];
        a[2][1] *= a[1][1];
        a[2][2] = 1.0 / (a[2][2] - a[2][1] * a[1][2]);
        Self { lu: a, gamma, cw }
    }

    #[inline]
    pub(super) fn solve(&self, g: Force3, r: f64) -> [f64; 4] {
        let a = &self.lu;
        let b: Force3 = core::array::from_fn(|i| g[i] + self.gamma[i] * r);
        let y1 = b[1] - a[1][0] * b[0];
        let y2 = b[2] - a[2][0] * b[0] - a[2][1] * y1;
        let z = y2 * a[2][2];
        let y = (y1 - a[1][2] * z) * a[1][1];
        let x = (b[0] - a[0][1] * y - a[0][2] * z) * a[0][0];
        [x, y, z, r + self.cw * (y - z)]
    }
}
