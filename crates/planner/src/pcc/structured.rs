//! Structured interior-point solver: the fast path, `no_std`, no allocation after the first solve.
//!
//! Mehrotra's predictor-corrector method (S. Mehrotra, SIAM J. Optim. 2, 1992; Nocedal and Wright,
//! Numerical Optimization, ch. 14 and 16.6) on the reduced form. Per interval there are eight
//! inequalities `c·(E_k, E_{k+1}, b_k, u_k) <= d`:
//!
//! | i | row | d |
//! |---|---|---|
//! | 0 | `-p` | 0 |
//! | 1 | `p - φ'Ē` | φ⁰ |
//! | 2 | `b` | b_max |
//! | 3 | `-b` | 0 |
//! | 4 | `u` | D |
//! | 5 | `u - p` | 0 |
//! | 6 | `E_{k+1}` | E_max |
//! | 7 | `-E_{k+1}` | -E_min |
//!
//! The Newton matrix `H + CᵀWC`, `W = diag(z/s)`, couples `b_k` and `u_k` with their own interval only;
//! with these eliminated it is pentadiagonal in `E` and factors in O(N). The trip-time row is dense: it is
//! bordered, one more back-substitution per factorisation. A soft end adds one slack.
//!
//! Left out: the fence (its elapsed times are cumulative sums), which Clarabel solves.

use alloc::vec::Vec;

use super::lin::{Subproblem, Terminal, TimeRule};
use super::quadratic::Quadratic;
use super::solution::{Solution, SolveStatus};

const ROWS: usize = 8;
const MAX_ITERATIONS: u32 = 60;
/// Complementarity at which the solve ends, g per inequality.
const MU_END: f64 = 2e-10;
/// Largest violation of an inequality in its own unit (J/kg, m/s², s).
const PRIMAL_END: f64 = 1e-6;
/// Largest gradient left, relative to the largest cost gradient.
const DUAL_END: f64 = 1e-5;
/// Share of the way to the boundary that a step takes.
const BOUNDARY_SHARE: f64 = 0.995;

/// One scalar inequality outside the intervals: slack, multiplier and their steps.
#[derive(Debug, Clone, Copy, Default)]
struct Scalar {
    s: f64,
    z: f64,
    ds: f64,
    dz: f64,
    rp: f64,
    rc: f64,
}

impl Scalar {
    fn start(s: f64, mu: f64) -> Self {
        Self { s, z: mu / s, ..Self::default() }
    }
    fn weight(&self) -> f64 {
        self.z / self.s
    }
    /// `r_c/s - W r_p`, the inequality's part of the Newton right-hand side.
    fn pull(&self) -> f64 {
        (self.rc - self.z * self.rp) / self.s
    }
    fn direct(&mut self, c_dx: f64) {
        self.ds = -self.rp - c_dx;
        self.dz = (-self.rc - self.z * self.ds) / self.s;
    }
}

/// Workspace; reuse it from solve to solve.
#[derive(Debug, Clone, Default)]
pub struct Structured {
    quad: Quadratic,
    e: Vec<f64>,
    b: Vec<f64>,
    u: Vec<f64>,
    s: Vec<[f64; ROWS]>,
    z: Vec<[f64; ROWS]>,
    ds: Vec<[f64; ROWS]>,
    dz: Vec<[f64; ROWS]>,
    rp: Vec<[f64; ROWS]>,
    rc: Vec<[f64; ROWS]>,
    /// Dual residual.
    rd_e: Vec<f64>,
    rd_b: Vec<f64>,
    rd_u: Vec<f64>,
    /// Newton matrix over E (L D Lᵀ in place) and the eliminated brakes.
    m0: Vec<f64>,
    m1: Vec<f64>,
    m2: Vec<f64>,
    mb: Vec<f64>,
    mx0: Vec<f64>,
    mx1: Vec<f64>,
    /// Right-hand side, then step.
    de: Vec<f64>,
    db: Vec<f64>,
    du: Vec<f64>,
    /// Gradient of the duration and its solution with the Newton matrix.
    t: Vec<f64>,
    mt: Vec<f64>,
    time: Option<Scalar>,
    /// Soft end: slack variable, `slack >= 0`, `slack + E_N >= reference`.
    soft: Option<(f64, Scalar, Scalar)>,
    /// Negative dual residual of the slack, and its step.
    dslack: f64,
    dslack_step: f64,
}

/// Coefficients of row `i` of interval `k` on `(E_k, E_{k+1}, b_k, u_k)`.
#[inline]
fn row(sub: &Subproblem, k: usize, i: usize) -> [f64; 4] {
    let half = 0.5 * sub.phi1[k];
    match i {
        0 => [-sub.a0[k], -sub.a1[k], -1.0, 0.0],
        1 => [sub.a0[k] - half, sub.a1[k] - half, 1.0, 0.0],
        2 => [0.0, 0.0, 1.0, 0.0],
        3 => [0.0, 0.0, -1.0, 0.0],
        4 => [0.0, 0.0, 0.0, 1.0],
        5 => [-sub.a0[k], -sub.a1[k], -1.0, 1.0],
        6 => [0.0, 1.0, 0.0, 0.0],
        _ => [0.0, -1.0, 0.0, 0.0],
    }
}

#[inline]
fn right(sub: &Subproblem, k: usize, i: usize) -> f64 {
    match i {
        0 => sub.r[k],
        1 => sub.phi0[k] - sub.r[k],
        2 => sub.b_max,
        3 => 0.0,
        4 => sub.kink[k],
        5 => sub.r[k],
        6 => sub.e_max[k + 1],
        _ => -sub.e_min[k + 1],
    }
}

impl Structured {
    /// Solves a subproblem into `out`. Allocates only while the workspace grows.
    pub fn solve_into(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        out: &mut Solution,
    ) {
        let beta = if let TimeRule::Price(beta) = time { beta } else { 0.0 };
        self.quad.assemble(sub, beta);
        self.start(sub, terminal, time);
        let fixed = matches!(terminal, Terminal::Fixed(_));
        let scale = self.quad.ge.iter().chain(&self.quad.gb).fold(1e-9, |a: f64, g| a.max(g.abs()));
        let mut status = SolveStatus::Failed;
        let mut used = 0;
        for iteration in 0..MAX_ITERATIONS {
            used = iteration;
            let (primal, dual) = self.residuals(sub, terminal, time);
            let mu = self.complementarity(fixed);
            if mu < MU_END && primal < PRIMAL_END && dual < DUAL_END * scale {
                status = SolveStatus::Solved;
                break;
            }
            if !(mu.is_finite() && primal.is_finite() && dual.is_finite()) {
                break;
            }
            if !self.factor(sub, fixed) {
                break;
            }
            // Predictor: straight at complementarity zero.
            self.set_complementarity(|s, z, _, _| s * z);
            self.direction(sub, fixed);
            let reach = self.reach(fixed).min(1.0);
            let ahead = self.complementarity_after(reach, fixed);
            let ratio = ahead / mu;
            let target = (ratio * ratio * ratio * mu).max(0.1 * MU_END);
            // Corrector: centring and the second-order term.
            self.set_complementarity(|s, z, ds, dz| s * z + ds * dz - target);
            self.direction(sub, fixed);
            let step = (BOUNDARY_SHARE * self.reach(fixed)).min(1.0);
            self.advance(step, fixed);
            if step < 1e-10 {
                break;
            }
        }
        if status == SolveStatus::Failed {
            let (primal, dual) = self.residuals(sub, terminal, time);
            let mu = self.complementarity(fixed);
            if mu < 1e5 * MU_END && primal < 1e-5 && dual < 1e-5 * scale {
                status = SolveStatus::AlmostSolved;
            } else if primal > 1e-3 {
                status = SolveStatus::Infeasible;
            }
        }
        self.write(sub, time, status, used, out);
    }

    fn start(&mut self, sub: &Subproblem, terminal: Terminal, time: TimeRule) {
        let n = sub.n;
        for v in [
            &mut self.e,
            &mut self.b,
            &mut self.u,
            &mut self.rd_u,
            &mut self.du,
            &mut self.rd_e,
            &mut self.rd_b,
            &mut self.m0,
            &mut self.m1,
            &mut self.m2,
            &mut self.mb,
            &mut self.mx0,
            &mut self.mx1,
            &mut self.de,
            &mut self.db,
            &mut self.t,
            &mut self.mt,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        for v in [&mut self.s, &mut self.z, &mut self.ds, &mut self.dz, &mut self.rp, &mut self.rc]
        {
            v.clear();
            v.resize(n, [0.0; ROWS]);
        }
        for k in 0..n {
            // Energies of the linearisation point at the interval's end, inside the bounds.
            let next =
                if k + 1 < n { 0.5 * (sub.mean0[k] + sub.mean0[k + 1]) } else { sub.mean0[k] };
            let (low, high) = (sub.e_min[k + 1], sub.e_max[k + 1]);
            let room = (0.05 * (high - low)).clamp(0.0, 3.0);
            self.e[k] = next.clamp(low + room, (high - room).max(low + room));
            self.b[k] = 0.02 * sub.b_max;
            self.u[k] = 0.5 * sub.kink[k];
            let nodes = if k + 1 < n { sub.ta[k + 1] } else { 0.0 };
            self.t[k] = sub.tb[k] + nodes;
        }
        if let Terminal::Fixed(e) = terminal {
            self.e[n - 1] = e;
        }
        let mu = 1.0;
        for k in 0..n {
            for i in 0..ROWS {
                let c = row(sub, k, i);
                let gap = right(sub, k, i) - self.dot(sub, k, &c);
                let least = if i >= 6 { 0.5 } else { 0.02 };
                self.s[k][i] = gap.max(least);
                self.z[k][i] = mu / self.s[k][i];
            }
        }
        self.time = match time {
            TimeRule::AtMost(t) => Some(Scalar::start((t - self.duration(sub)).max(0.5), 3.0 * mu)),
            TimeRule::Price(_) => None,
        };
        self.soft = match terminal {
            Terminal::Soft { reference, .. } => {
                let slack = (reference - self.e[n - 1]).max(0.0) + 1.0;
                let spare = slack + self.e[n - 1] - reference;
                Some((slack, Scalar::start(slack, mu), Scalar::start(spare, mu)))
            }
            Terminal::Fixed(_) => None,
        };
    }

    fn e_at(&self, sub: &Subproblem, node: usize) -> f64 {
        if node == 0 { sub.start_e } else { self.e[node - 1] }
    }

    fn dot(&self, sub: &Subproblem, k: usize, c: &[f64; 4]) -> f64 {
        c[0] * self.e_at(sub, k) + c[1] * self.e[k] + c[2] * self.b[k] + c[3] * self.u[k]
    }

    fn duration(&self, sub: &Subproblem) -> f64 {
        (0..sub.n).map(|k| sub.t0[k] + sub.ta[k] * self.e_at(sub, k) + sub.tb[k] * self.e[k]).sum()
    }

    /// Inequalities of interval `k` that exist: a fixed end has no bounds.
    #[inline]
    fn rows_of(k: usize, n: usize, fixed: bool) -> usize {
        if fixed && k + 1 == n { 6 } else { ROWS }
    }

    /// Residuals; returns the largest primal and dual one.
    fn residuals(&mut self, sub: &Subproblem, terminal: Terminal, time: TimeRule) -> (f64, f64) {
        let n = sub.n;
        let fixed = matches!(terminal, Terminal::Fixed(_));
        let q = &self.quad;
        for i in 0..n {
            let mut g = q.ge[i] + q.d0[i] * self.e[i];
            if i > 0 {
                g += q.d1[i - 1] * self.e[i - 1];
            }
            if i > 1 {
                g += q.d2[i - 2] * self.e[i - 2];
            }
            if i + 1 < n {
                g += q.d1[i] * self.e[i + 1] + q.x0[i + 1] * self.b[i + 1];
            }
            if i + 2 < n {
                g += q.d2[i] * self.e[i + 2];
            }
            self.rd_e[i] = g + q.x1[i] * self.b[i];
            let before = if i > 0 { q.x0[i] * self.e[i - 1] } else { 0.0 };
            self.rd_u[i] = -sub.discount[i];
            self.rd_b[i] = q.gb[i] + q.bb[i] * self.b[i] + q.x1[i] * self.e[i] + before;
        }
        let mut primal = 0.0f64;
        for k in 0..n {
            for i in 0..Self::rows_of(k, n, fixed) {
                let c = row(sub, k, i);
                let r = self.dot(sub, k, &c) + self.s[k][i] - right(sub, k, i);
                self.rp[k][i] = r;
                primal = primal.max(r.abs());
                let z = self.z[k][i];
                if k > 0 {
                    self.rd_e[k - 1] += c[0] * z;
                }
                self.rd_e[k] += c[1] * z;
                self.rd_b[k] += c[2] * z;
                self.rd_u[k] += c[3] * z;
            }
        }
        if let (Some(mut row), TimeRule::AtMost(t)) = (self.time, time) {
            row.rp = self.duration(sub) + row.s - t;
            primal = primal.max(row.rp.abs());
            for (g, t) in self.rd_e.iter_mut().zip(&self.t) {
                *g += row.z * t;
            }
            self.time = Some(row);
        }
        let mut dual = 0.0f64;
        if let (Some((slack, mut own, mut spare)), Terminal::Soft { reference, pay, credit }) =
            (self.soft, terminal)
        {
            own.rp = own.s - slack;
            spare.rp = spare.s - slack - self.e[n - 1] + reference;
            primal = primal.max(own.rp.abs()).max(spare.rp.abs());
            self.rd_e[n - 1] -= credit + spare.z;
            dual = (pay - credit - own.z - spare.z).abs();
            self.dslack = -(pay - credit - own.z - spare.z);
            self.soft = Some((slack, own, spare));
        }
        if fixed {
            self.rd_e[n - 1] = 0.0;
        }
        for r in self.rd_e.iter().chain(&self.rd_b).chain(&self.rd_u) {
            dual = dual.max(r.abs());
        }
        (primal, dual)
    }

    /// Assembles and factors the Newton matrix; false if a pivot is not positive.
    fn factor(&mut self, sub: &Subproblem, fixed: bool) -> bool {
        let n = sub.n;
        let q = &self.quad;
        self.m0.copy_from_slice(&q.d0);
        self.m1.copy_from_slice(&q.d1);
        self.m2.copy_from_slice(&q.d2);
        for k in 0..n {
            let w: [f64; ROWS] = core::array::from_fn(|i| {
                if i < Self::rows_of(k, n, fixed) { self.z[k][i] / self.s[k][i] } else { 0.0 }
            });
            let half = 0.5 * sub.phi1[k];
            let (a0, a1) = (sub.a0[k], sub.a1[k]);
            let (f0, f1) = (a0 - half, a1 - half);
            // u eliminated: row 5 becomes a weight on p, in series with row 4.
            let wp = w[0] + w[4] * w[5] / (w[4] + w[5]);
            let bb = q.bb[k] + wp + w[1] + w[2] + w[3];
            let x1 = q.x1[k] + wp * a1 + w[1] * f1;
            let x0 = if k > 0 { q.x0[k] + wp * a0 + w[1] * f0 } else { 0.0 };
            self.mb[k] = bb;
            self.mx0[k] = x0;
            self.mx1[k] = x1;
            self.m0[k] += wp * a1 * a1 + w[1] * f1 * f1 + w[6] + w[7] - x1 * x1 / bb;
            if k > 0 {
                self.m0[k - 1] += wp * a0 * a0 + w[1] * f0 * f0 - x0 * x0 / bb;
                self.m1[k - 1] += wp * a0 * a1 + w[1] * f0 * f1 - x0 * x1 / bb;
            }
        }
        if let Some((_, own, spare)) = &self.soft {
            let (w7, w8) = (own.weight(), spare.weight());
            self.m0[n - 1] += w8 - w8 * w8 / (w7 + w8);
        }
        if fixed {
            self.m0[n - 1] = 1.0;
            if n > 1 {
                self.m1[n - 2] = 0.0;
            }
            if n > 2 {
                self.m2[n - 3] = 0.0;
            }
        }
        // L D Lᵀ: m0 becomes 1/D, m1 and m2 the columns of L.
        for i in 0..n {
            let pivot = self.m0[i];
            if pivot.is_nan() || pivot <= 1e-14 {
                return false;
            }
            let inverse = 1.0 / pivot;
            let l1 = self.m1[i] * inverse;
            let l2 = self.m2[i] * inverse;
            if i + 1 < n {
                self.m0[i + 1] -= l1 * self.m1[i];
                self.m1[i + 1] -= l1 * self.m2[i];
            }
            if i + 2 < n {
                self.m0[i + 2] -= l2 * self.m2[i];
            }
            self.m0[i] = inverse;
            self.m1[i] = l1;
            self.m2[i] = l2;
        }
        if self.time.is_some() {
            self.mt.copy_from_slice(&self.t);
            if fixed {
                self.mt[n - 1] = 0.0;
            }
            back_substitute(&self.m0, &self.m1, &self.m2, &mut self.mt);
        }
        true
    }

    /// Newton direction for the current residuals, into `de`, `db`, `ds`, `dz`.
    fn direction(&mut self, sub: &Subproblem, fixed: bool) {
        let n = sub.n;
        for k in 0..n {
            self.de[k] = -self.rd_e[k];
            self.db[k] = -self.rd_b[k];
            self.du[k] = -self.rd_u[k];
        }
        for k in 0..n {
            for i in 0..Self::rows_of(k, n, fixed) {
                let c = row(sub, k, i);
                let pull = (self.rc[k][i] - self.z[k][i] * self.rp[k][i]) / self.s[k][i];
                if k > 0 {
                    self.de[k - 1] += c[0] * pull;
                }
                self.de[k] += c[1] * pull;
                self.db[k] += c[2] * pull;
                self.du[k] += c[3] * pull;
            }
            let (w4, w5) = (self.z[k][4] / self.s[k][4], self.z[k][5] / self.s[k][5]);
            let share = w5 / (w4 + w5) * self.du[k];
            if k > 0 {
                self.de[k - 1] += sub.a0[k] * share;
            }
            self.de[k] += sub.a1[k] * share;
            self.db[k] += share;
        }
        if let Some(row) = &self.time {
            let pull = row.pull();
            for (d, t) in self.de.iter_mut().zip(&self.t) {
                *d += t * pull;
            }
        }
        let mut slack_right = 0.0;
        if let Some((_, own, spare)) = &self.soft {
            slack_right = self.dslack - own.pull() - spare.pull();
            let (w7, w8) = (own.weight(), spare.weight());
            self.de[n - 1] -= spare.pull() + w8 / (w7 + w8) * slack_right;
        }
        // Brakes out, energies, brakes back.
        for k in 0..n {
            let share = self.db[k] / self.mb[k];
            self.de[k] -= self.mx1[k] * share;
            if k > 0 {
                self.de[k - 1] -= self.mx0[k] * share;
            }
        }
        if fixed {
            self.de[n - 1] = 0.0;
        }
        back_substitute(&self.m0, &self.m1, &self.m2, &mut self.de);
        if let Some(row) = &self.time {
            let along = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let y = along(&self.t, &self.de) / (1.0 / row.weight() + along(&self.t, &self.mt));
            for (d, m) in self.de.iter_mut().zip(&self.mt) {
                *d -= y * m;
            }
        }
        for k in 0..n {
            let before = if k > 0 { self.mx0[k] * self.de[k - 1] } else { 0.0 };
            self.db[k] = (self.db[k] - self.mx1[k] * self.de[k] - before) / self.mb[k];
        }
        for k in 0..n {
            let before = if k > 0 { self.de[k - 1] } else { 0.0 };
            let dp = sub.a0[k] * before + sub.a1[k] * self.de[k] + self.db[k];
            let (w4, w5) = (self.z[k][4] / self.s[k][4], self.z[k][5] / self.s[k][5]);
            self.du[k] = (self.du[k] + w5 * dp) / (w4 + w5);
            for i in 0..Self::rows_of(k, n, fixed) {
                let c = row(sub, k, i);
                let c_dx =
                    c[0] * before + c[1] * self.de[k] + c[2] * self.db[k] + c[3] * self.du[k];
                let ds = -self.rp[k][i] - c_dx;
                self.ds[k][i] = ds;
                self.dz[k][i] = (-self.rc[k][i] - self.z[k][i] * ds) / self.s[k][i];
            }
        }
        if let Some(row) = &mut self.time {
            let c_dx = self.t.iter().zip(&self.de).map(|(a, b)| a * b).sum();
            row.direct(c_dx);
        }
        if let Some((_, own, spare)) = &mut self.soft {
            let (w7, w8) = (own.weight(), spare.weight());
            self.dslack_step = (slack_right - w8 * self.de[n - 1]) / (w7 + w8);
            own.direct(-self.dslack_step);
            spare.direct(-self.dslack_step - self.de[n - 1]);
        }
    }

    fn set_complementarity(&mut self, f: impl Fn(f64, f64, f64, f64) -> f64) {
        for k in 0..self.rc.len() {
            for i in 0..ROWS {
                self.rc[k][i] = f(self.s[k][i], self.z[k][i], self.ds[k][i], self.dz[k][i]);
            }
        }
        let one = |r: &mut Scalar| r.rc = f(r.s, r.z, r.ds, r.dz);
        if let Some(r) = &mut self.time {
            one(r);
        }
        if let Some((_, a, b)) = &mut self.soft {
            one(a);
            one(b);
        }
    }

    /// Largest step that keeps slacks and multipliers positive.
    fn reach(&self, fixed: bool) -> f64 {
        let n = self.s.len();
        let mut worst = 0.0f64;
        for k in 0..n {
            for i in 0..Self::rows_of(k, n, fixed) {
                worst = worst.max(-self.ds[k][i] / self.s[k][i]).max(-self.dz[k][i] / self.z[k][i]);
            }
        }
        self.scalars(|r| worst = worst.max(-r.ds / r.s).max(-r.dz / r.z));
        if worst > 0.0 { 1.0 / worst } else { f64::INFINITY }
    }

    fn scalars(&self, mut f: impl FnMut(&Scalar)) {
        if let Some(r) = &self.time {
            f(r);
        }
        if let Some((_, a, b)) = &self.soft {
            f(a);
            f(b);
        }
    }

    fn complementarity(&self, fixed: bool) -> f64 {
        self.complementarity_after(0.0, fixed)
    }

    /// Mean of `s z` after a step.
    fn complementarity_after(&self, step: f64, fixed: bool) -> f64 {
        let n = self.s.len();
        let (mut sum, mut count) = (0.0, 0.0);
        for k in 0..n {
            for i in 0..Self::rows_of(k, n, fixed) {
                sum +=
                    (self.s[k][i] + step * self.ds[k][i]) * (self.z[k][i] + step * self.dz[k][i]);
                count += 1.0;
            }
        }
        self.scalars(|r| {
            sum += (r.s + step * r.ds) * (r.z + step * r.dz);
            count += 1.0;
        });
        sum / count
    }

    fn advance(&mut self, step: f64, fixed: bool) {
        let n = self.s.len();
        for k in 0..n {
            self.e[k] += step * self.de[k];
            self.b[k] += step * self.db[k];
            self.u[k] += step * self.du[k];
            for i in 0..Self::rows_of(k, n, fixed) {
                self.s[k][i] += step * self.ds[k][i];
                self.z[k][i] += step * self.dz[k][i];
            }
        }
        let one = |r: &mut Scalar| {
            r.s += step * r.ds;
            r.z += step * r.dz;
        };
        if let Some(r) = &mut self.time {
            one(r);
        }
        if let Some((slack, a, b)) = &mut self.soft {
            *slack += step * self.dslack_step;
            one(a);
            one(b);
        }
    }

    fn write(
        &self,
        sub: &Subproblem,
        time: TimeRule,
        status: SolveStatus,
        iterations: u32,
        out: &mut Solution,
    ) {
        out.status = status;
        out.iterations = iterations;
        out.e_j_kg.clear();
        out.e_j_kg.push(sub.start_e);
        out.e_j_kg.extend_from_slice(&self.e);
        out.b_m_s2.clear();
        out.b_m_s2.extend_from_slice(&self.b);
        out.traction_price.clear();
        out.traction_price.extend(self.z.iter().map(|z| z[1] - z[0] - z[5]));
        out.cut_price.clear();
        out.cut_price.extend(self.z.iter().map(|z| z[0]));
        out.beta_g_s = match time {
            TimeRule::Price(beta) => beta,
            TimeRule::AtMost(_) => self.time.map_or(0.0, |r| r.z),
        };
    }
}

/// Solves `L D Lᵀ x = r` in place; `d` holds 1/D.
fn back_substitute(d: &[f64], l1: &[f64], l2: &[f64], r: &mut [f64]) {
    let n = r.len();
    for i in 0..n {
        let x = r[i];
        if i + 1 < n {
            r[i + 1] -= l1[i] * x;
        }
        if i + 2 < n {
            r[i + 2] -= l2[i] * x;
        }
        r[i] = x * d[i];
    }
    for i in (0..n).rev() {
        let mut x = r[i];
        if i + 1 < n {
            x -= l1[i] * r[i + 1];
        }
        if i + 2 < n {
            x -= l2[i] * r[i + 2];
        }
        r[i] = x;
    }
}
