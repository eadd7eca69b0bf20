//! Structured interior-point solver: the fast path, `no_std`, no allocation after the first solve.
//!
//! Mehrotra's predictor-corrector method (S. Mehrotra, SIAM J. Optim. 2, 1992; Nocedal and Wright,
//! Numerical Optimization, ch. 14 and 16.6) on the reduced form. Per interval there are eight
//! inequalities `c·(E_k, E_{k+1}, b_k, u_k) <= d`:
//!
//! | name | row | d |
//! |---|---|---|
//! | [`CUT_OFF`] | `-p` | 0 |
//! | [`FULL_LOAD`] | `p - φ'Ē` | φ⁰ |
//! | [`HARDEST_BRAKE`] | `b` | b_max |
//! | [`NO_BRAKE`] | `-b` | 0 |
//! | [`KINK`] | `u` | D |
//! | [`BELOW_TRACTION`] | `u - p` | 0 |
//! | [`CEILING`] | `E_{k+1}` | E_max |
//! | [`FLOOR`] | `-E_{k+1}` | -E_min |
//!
//! The Newton matrix `H + CᵀWC`, `W = diag(z/s)`, couples `b_k` and `u_k` with their own interval only;
//! with these eliminated it is pentadiagonal in `E` and factors in O(N). The trip-time row is dense: it is
//! bordered, one more back-substitution per factorisation. A soft end adds one slack.
//!
//! Per iteration the intervals are swept three times (system, predictor, corrector); all state of an
//! interval's inequalities lies side by side in memory.
//!
//! Left out: the fence (its elapsed times are cumulative sums), which Clarabel solves.

mod banded;
mod newton;
mod warm;

use alloc::vec::Vec;

use self::banded::Band;
use self::newton::Eliminated;
use self::warm::Kept;
use super::lin::{Subproblem, Terminal, TimeRule};
use super::quadratic::Quadratic;
use super::solution::{Solution, SolveStatus};

const ROWS: usize = 8;
const CUT_OFF: usize = 0;
const FULL_LOAD: usize = 1;
const HARDEST_BRAKE: usize = 2;
const NO_BRAKE: usize = 3;
const KINK: usize = 4;
const BELOW_TRACTION: usize = 5;
const CEILING: usize = 6;
const FLOOR: usize = 7;
const MAX_ITERATIONS: u32 = 60;
/// Complementarity at which the solve ends, g per inequality.
const MU_END: f64 = 2e-10;
/// Multiple of [`MU_END`] that counts as solved where no further step can be computed.
const ROUNDING_SHARE: f64 = 5.0;
/// Largest violation of an inequality in its own unit (J/kg, m/s², s).
const PRIMAL_END: f64 = 1e-6;
/// Largest gradient left, relative to the largest cost gradient.
const DUAL_END: f64 = 1e-5;
/// Share of the way to the boundary that a step takes.
const BOUNDARY_SHARE: f64 = 0.995;

/// The inequalities of one interval: slacks, multipliers, `1/s`, primal residuals and steps. Rows
/// that a fixed end does not have keep `z = 0` and `1/s = 0`, which takes them out of every sum.
#[derive(Debug, Clone, Copy, Default)]
struct Rows {
    s: [f64; ROWS],
    z: [f64; ROWS],
    inverse_s: [f64; ROWS],
    rp: [f64; ROWS],
    ds: [f64; ROWS],
    dz: [f64; ROWS],
}

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
    fn direct(&mut self, c_dx: f64, rc: f64) {
        self.ds = -self.rp - c_dx;
        self.dz = (-rc - self.z * self.ds) / self.s;
    }
    fn advance(&mut self, step: f64) {
        self.s += step * self.ds;
        self.z += step * self.dz;
    }
}

/// A soft end: the missing energy `slack`, `slack >= 0`, `slack + E_N >= reference`.
#[derive(Debug, Clone, Copy, Default)]
struct SoftEnd {
    slack: f64,
    own: Scalar,
    spare: Scalar,
    /// Right-hand side of the slack's row, and the slack's step.
    right: f64,
    step: f64,
}

/// What each inequality of interval `k` leaves at `(E_k, E_{k+1}, b, u)` with traction `p`.
fn room(sub: &Subproblem, k: usize, [e0, e1, b, u]: [f64; 4], p: f64) -> [f64; ROWS] {
    [
        p,
        sub.phi0[k] + 0.5 * sub.phi1[k] * (e0 + e1) - p,
        sub.b_max - b,
        b,
        sub.kink[k] - u,
        p - u,
        sub.e_max[k + 1] - e1,
        e1 - sub.e_min[k + 1],
    ]
}

/// Workspace; reuse it from solve to solve.
#[derive(Debug, Clone, Default)]
pub struct Structured {
    quad: Quadratic,
    e: Vec<f64>,
    b: Vec<f64>,
    u: Vec<f64>,
    rows: Vec<Rows>,
    parts: Vec<Eliminated>,
    band: Band,
    grad_e: Vec<f64>,
    grad_b: Vec<f64>,
    /// Right-hand side over E, after elimination.
    base: Vec<f64>,
    de: Vec<f64>,
    db: Vec<f64>,
    du: Vec<f64>,
    /// Gradient of the duration and its solution with the Newton matrix.
    t: Vec<f64>,
    mt: Vec<f64>,
    /// Part of the duration that does not depend on the unknowns, s.
    known_time_s: f64,
    time: Option<Scalar>,
    soft: Option<SoftEnd>,
    kept: Kept,
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
        self.resize(sub.n);
        self.duration_row(sub);
        let (mut status, mut used) = (SolveStatus::Failed, 0);
        if self.resume(sub, terminal, time) {
            (status, used) = self.descend(sub, terminal, time, Some(warm::LIMITS));
        }
        if status != SolveStatus::Solved {
            self.start(sub, terminal, time);
            let (cold, more) = self.descend(sub, terminal, time, None);
            (status, used) = (cold, used + more);
        }
        self.write(sub, time, status, used, out);
    }

    /// Iterates from the current point; how it ended, and the iterations used. `warm` says when a
    /// warm start is given up.
    fn descend(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        warm: Option<warm::Limits>,
    ) -> (SolveStatus, u32) {
        let fixed = matches!(terminal, Terminal::Fixed(_));
        let scale = self.quad.ge.iter().chain(&self.quad.gb).fold(1e-9, |a: f64, g| a.max(g.abs()));
        let mut status = SolveStatus::Failed;
        let mut used = 0;
        let mut keep = true;
        let most = warm.map_or(MAX_ITERATIONS, |limits| limits.iterations);
        for iteration in 0..=most {
            used = iteration;
            let now = self.assemble(sub, terminal, time);
            if now.mu < MU_END && now.primal < PRIMAL_END && now.dual < DUAL_END * scale {
                status = SolveStatus::Solved;
                break;
            }
            if now.mu < 1e5 * MU_END && now.primal < 1e-5 && now.dual < 1e-5 * scale {
                status = SolveStatus::AlmostSolved;
            } else {
                status =
                    if now.primal > 1e-3 { SolveStatus::Infeasible } else { SolveStatus::Failed };
            }
            let far = |w: warm::Limits| now.primal > w.primal || now.dual > w.dual * scale;
            if iteration == 0 && warm.is_some_and(far) {
                break;
            }
            let finite = now.mu.is_finite() && now.primal.is_finite() && now.dual.is_finite();
            if !finite || iteration == most {
                break;
            }
            if !self.factor(fixed) {
                // Rounding ends it: hardly short of the goal counts as there.
                if status == SolveStatus::AlmostSolved && now.mu < ROUNDING_SHARE * MU_END {
                    status = SolveStatus::Solved;
                }
                break;
            }
            if keep && now.mu < warm::MU_KEPT {
                self.keep(now.mu);
                keep = false;
            }
            let (reach, product) = self.predict(sub, fixed);
            // Mean of (s + αds)(z + αdz), where s dz + z ds = -s z.
            let reach = reach.min(1.0);
            let ahead = (1.0 - reach) * now.mu + reach * reach * product / self.count(fixed);
            let ratio = (ahead / now.mu).max(0.0);
            let target = (ratio * ratio * ratio * now.mu).max(0.1 * MU_END);
            let step = (BOUNDARY_SHARE * self.correct(sub, fixed, target)).min(1.0);
            self.advance(step);
            if step.is_nan() || step < 1e-10 {
                break;
            }
        }
        (status, used)
    }

    /// Number of inequalities: a fixed end has no bounds of its own.
    fn count(&self, fixed: bool) -> f64 {
        let mut count = (ROWS * self.rows.len()) as f64 - if fixed { 2.0 } else { 0.0 };
        self.scalars(|_| count += 1.0);
        count
    }

    fn resize(&mut self, n: usize) {
        for v in [
            &mut self.e,
            &mut self.b,
            &mut self.u,
            &mut self.grad_e,
            &mut self.grad_b,
            &mut self.base,
            &mut self.de,
            &mut self.db,
            &mut self.du,
            &mut self.t,
            &mut self.mt,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.band.resize(n);
        self.rows.clear();
        self.rows.resize(n, Rows::default());
        self.parts.clear();
        self.parts.resize(n, Eliminated::default());
    }

    /// The linearised duration as a row.
    fn duration_row(&mut self, sub: &Subproblem) {
        let n = sub.n;
        self.known_time_s = sub.t0.iter().sum::<f64>() + sub.ta[0] * sub.start_e;
        for k in 0..n {
            let nodes = if k + 1 < n { sub.ta[k + 1] } else { 0.0 };
            self.t[k] = sub.tb[k] + nodes;
        }
    }

    fn start(&mut self, sub: &Subproblem, terminal: Terminal, time: TimeRule) {
        let n = sub.n;
        for k in 0..n {
            // Energies of the linearisation point at the interval's end, inside the bounds.
            let next =
                if k + 1 < n { 0.5 * (sub.mean0[k] + sub.mean0[k + 1]) } else { sub.mean0[k] };
            let (low, high) = (sub.e_min[k + 1], sub.e_max[k + 1]);
            let room = (0.05 * (high - low)).clamp(0.0, 3.0);
            self.e[k] = next.clamp(low + room, (high - room).max(low + room));
            self.b[k] = 0.02 * sub.b_max;
            self.u[k] = 0.5 * sub.kink[k];
        }
        let fixed = if let Terminal::Fixed(e) = terminal {
            self.e[n - 1] = e;
            true
        } else {
            false
        };
        let mu = 1.0;
        let mut e0 = sub.start_e;
        for k in 0..n {
            let (e1, b, u) = (self.e[k], self.b[k], self.u[k]);
            let p = sub.a0[k] * e0 + sub.a1[k] * e1 + b + sub.r[k];
            let room = room(sub, k, [e0, e1, b, u], p);
            let row = &mut self.rows[k];
            for (i, room) in room.into_iter().enumerate() {
                row.s[i] = room.max(if i == CEILING || i == FLOOR { 0.5 } else { 0.02 });
                row.z[i] = mu / row.s[i];
            }
            if fixed && k + 1 == n {
                (row.z[CEILING], row.z[FLOOR]) = (0.0, 0.0);
            }
            e0 = e1;
        }
        self.time = match time {
            TimeRule::AtMost(t) => {
                let lasts: f64 = self.t.iter().zip(&self.e).map(|(t, e)| t * e).sum();
                Some(Scalar::start((t - self.known_time_s - lasts).max(0.5), 3.0 * mu))
            }
            TimeRule::Price(_) => None,
        };
        self.soft = match terminal {
            Terminal::Soft { reference, .. } => {
                let slack = (reference - self.e[n - 1]).max(0.0) + 1.0;
                let spare = slack + self.e[n - 1] - reference;
                Some(SoftEnd {
                    slack,
                    own: Scalar::start(slack, mu),
                    spare: Scalar::start(spare, mu),
                    ..SoftEnd::default()
                })
            }
            Terminal::Fixed(_) => None,
        };
    }

    fn scalars(&self, mut f: impl FnMut(&Scalar)) {
        if let Some(r) = &self.time {
            f(r);
        }
        if let Some(end) = &self.soft {
            f(&end.own);
            f(&end.spare);
        }
    }

    fn advance(&mut self, step: f64) {
        for (x, dx) in [(&mut self.e, &self.de), (&mut self.b, &self.db), (&mut self.u, &self.du)] {
            for (x, dx) in x.iter_mut().zip(dx) {
                *x += step * dx;
            }
        }
        for row in &mut self.rows {
            for i in 0..ROWS {
                row.s[i] += step * row.ds[i];
                row.z[i] += step * row.dz[i];
            }
        }
        if let Some(r) = &mut self.time {
            r.advance(step);
        }
        if let Some(end) = &mut self.soft {
            end.slack += step * end.step;
            end.own.advance(step);
            end.spare.advance(step);
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
        out.traction_price
            .extend(self.rows.iter().map(|r| r.z[FULL_LOAD] - r.z[CUT_OFF] - r.z[BELOW_TRACTION]));
        out.cut_price.clear();
        out.cut_price.extend(self.rows.iter().map(|r| r.z[CUT_OFF]));
        out.beta_g_s = match time {
            TimeRule::Price(beta) => beta,
            TimeRule::AtMost(_) => self.time.map_or(0.0, |r| r.z),
        };
    }
}
