//! The subproblem's cost as a matrix: pentadiagonal in the free energies, diagonal in the brakes.
//!
//! Unknowns are `E_1..E_N` and `b_0..b_{N-1}`; `E_0` is known and folded into the gradient. Both
//! solvers read the same arrays, so they solve identical problems.

use alloc::vec::Vec;

use super::lin::Subproblem;

/// `½ xᵀH x + gᵀx` over `x = (E_1..E_N, b_0..b_{N-1})`.
#[derive(Debug, Clone, Default)]
pub(super) struct Quadratic {
    /// Diagonal of H over E; entry `i` belongs to node `i+1`.
    pub d0: Vec<f64>,
    /// First off-diagonal: `d1[i]` couples nodes `i+1` and `i+2`.
    pub d1: Vec<f64>,
    /// Second off-diagonal.
    pub d2: Vec<f64>,
    /// Gradient over E.
    pub ge: Vec<f64>,
    /// Coupling of `b_k` with `E_k` (unused for k = 0).
    pub x0: Vec<f64>,
    /// Coupling of `b_k` with `E_{k+1}`.
    pub x1: Vec<f64>,
    /// Diagonal over b.
    pub bb: Vec<f64>,
    /// Gradient over b.
    pub gb: Vec<f64>,
}

impl Quadratic {
    /// Assembles the cost with a linear time price `beta_g_s` (zero when time is a constraint).
    pub(super) fn assemble(&mut self, sub: &Subproblem, beta_g_s: f64) {
        let n = sub.n;
        for v in [
            &mut self.d0,
            &mut self.d1,
            &mut self.d2,
            &mut self.ge,
            &mut self.x0,
            &mut self.x1,
            &mut self.bb,
            &mut self.gb,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        for k in 0..n {
            let (q1, q2) = (sub.q1[k], sub.q2[k]);
            let (a0, a1, r) = (sub.a0[k], sub.a1[k], sub.r[k]);
            let t2 = sub.hessian_price * sub.t2[k];
            let wa = 2.0 * sub.wa[k];
            // Hessian entries over (E_k, E_{k+1}) and gradient at zero.
            let h00 = q2 * a0 * a0 + wa + 0.25 * t2;
            let h01 = q2 * a0 * a1 - wa + 0.25 * t2;
            let h11 = q2 * a1 * a1 + wa + 0.25 * t2;
            let p_lin = q1 + q2 * r;
            let mean = 0.5 * (sub.ge[k] - t2 * sub.mean0[k]);
            let g0 = p_lin * a0 + mean + beta_g_s * sub.ta[k];
            let g1 = p_lin * a1 + mean + beta_g_s * sub.tb[k];
            self.bb[k] = q2;
            self.gb[k] = p_lin + sub.b_cost;
            self.x1[k] = q2 * a1;
            self.d0[k] += h11;
            self.ge[k] += g1;
            if k == 0 {
                self.ge[0] += h01 * sub.start_e;
                self.gb[0] += q2 * a0 * sub.start_e;
            } else {
                self.x0[k] = q2 * a0;
                self.d0[k - 1] += h00;
                self.d1[k - 1] += h01;
                self.ge[k - 1] += g0;
            }
        }
        // Σ (E_{k+2} - 2E_{k+1} + E_k)² w_j
        let w = 2.0 * sub.wj;
        for k in 0..n.saturating_sub(1) {
            let (i1, i2) = (k, k + 1);
            self.d0[i1] += 4.0 * w;
            self.d0[i2] += w;
            self.d1[i1] -= 2.0 * w;
            if k == 0 {
                self.ge[i1] -= 2.0 * w * sub.start_e;
                self.ge[i2] += w * sub.start_e;
            } else {
                let i0 = k - 1;
                self.d0[i0] += w;
                self.d1[i0] -= 2.0 * w;
                self.d2[i0] += w;
            }
        }
    }
}
