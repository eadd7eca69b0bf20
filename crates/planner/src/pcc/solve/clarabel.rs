//! The subproblem through Clarabel (interior point, homogeneous embedding): default and oracle.
//!
//! Clarabel cannot start from the last solution (0.11): a solve takes the same iterations every time.

use alloc::vec::Vec;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, SupportedConeT,
    ZeroConeT,
};

use super::lin::{Subproblem, Terminal, TimeRule};
use super::programme::{Programme, Rows};
use super::solution::{Solution, SolveStatus};

/// Clarabel's settings: quiet, single-threaded, and with a fixed pattern. The subproblem's units (J/kg,
/// m/s², g) are near one already: equilibration costs a fifth more iterations. Refinement of each
/// linear solve takes half of the time and changes nothing down to [`TOLERANCE`].
fn settings(tolerance: f64) -> DefaultSettings<f64> {
    DefaultSettings {
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        verbose: false,
        max_iter: 60,
        presolve_enable: false,
        max_threads: 1,
        equilibrate_enable: false,
        iterative_refinement_enable: tolerance < TOLERANCE,
        ..DefaultSettings::default()
    }
}

/// Tolerance of gap and feasibility: a tenth of Clarabel's own, where energies still move.
const TOLERANCE: f64 = 1e-9;

/// Clarabel with the workspace of its last solve: a subproblem of the same pattern keeps ordering
/// and symbolic factorisation.
#[derive(Default)]
pub struct Clarabel {
    last: Option<Workspace>,
}

struct Workspace {
    equalities: usize,
    solver: DefaultSolver<f64>,
}

impl Clone for Clarabel {
    /// Without the workspace, which solutions do not depend on.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl core::fmt::Debug for Clarabel {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Clarabel").field("warm", &self.last.is_some()).finish()
    }
}

impl Clarabel {
    /// Solves the subproblem to a tolerance of gap and feasibility of 1e-9.
    #[must_use]
    pub fn solve(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        fence_s: Option<&[f64]>,
    ) -> Solution {
        self.solve_to(sub, terminal, time, fence_s, TOLERANCE)
    }

    fn solve_to(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        fence_s: Option<&[f64]>,
        tolerance: f64,
    ) -> Solution {
        let (m, rows) = Programme::build(sub, terminal, time, fence_s);
        let p = CscMatrix::new_from_triplets(m.columns, m.columns, m.p.row, m.p.column, m.p.value);
        let a = CscMatrix::new_from_triplets(m.b.len(), m.columns, m.a.row, m.a.column, m.a.value);
        let kept = self.last.take().and_then(|mut last| {
            let same = last.equalities == m.equalities
                && last.solver.update_data(&p, &m.q, &a, &m.b).is_ok();
            same.then_some(last)
        });
        let made = || {
            let mut cones: Vec<SupportedConeT<f64>> = Vec::with_capacity(2);
            if m.equalities > 0 {
                cones.push(ZeroConeT(m.equalities));
            }
            cones.push(NonnegativeConeT(m.b.len() - m.equalities));
            let solver = DefaultSolver::new(&p, &m.q, &a, &m.b, &cones, settings(tolerance));
            solver.ok().map(|solver| Workspace { equalities: m.equalities, solver })
        };
        let Some(mut now) = kept.or_else(made) else {
            return Solution::default();
        };
        now.solver.solve();
        let found = read(&now.solver, sub, time, &rows);
        self.last = Some(now);
        found
    }
}

/// Solves the subproblem with a new Clarabel to its usual tolerance (1e-9).
#[must_use]
pub fn solve(
    sub: &Subproblem,
    terminal: Terminal,
    time: TimeRule,
    fence_s: Option<&[f64]>,
) -> Solution {
    Clarabel::default().solve(sub, terminal, time, fence_s)
}

/// Solves the subproblem with a new Clarabel to a given tolerance of gap and feasibility.
#[must_use]
pub fn solve_to(
    sub: &Subproblem,
    terminal: Terminal,
    time: TimeRule,
    fence_s: Option<&[f64]>,
    tolerance: f64,
) -> Solution {
    Clarabel::default().solve_to(sub, terminal, time, fence_s, tolerance)
}

/// The solution in the planner's terms.
fn read(solver: &DefaultSolver<f64>, sub: &Subproblem, time: TimeRule, rows: &Rows) -> Solution {
    let n = sub.n;
    let s = &solver.solution;
    let status = match s.status {
        SolverStatus::Solved => SolveStatus::Solved,
        SolverStatus::AlmostSolved => SolveStatus::AlmostSolved,
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
            SolveStatus::Infeasible
        }
        _ => SolveStatus::Failed,
    };
    if s.x.iter().any(|v| !v.is_finite()) {
        return Solution { status: SolveStatus::Failed, ..Solution::default() };
    }
    let mut e = Vec::with_capacity(n + 1);
    e.push(sub.start_e);
    e.extend_from_slice(&s.x[..n]);
    Solution {
        status,
        e_j_kg: e,
        b_m_s2: s.x[n..2 * n].to_vec(),
        traction_price: (0..n)
            .map(|k| s.z[rows.p_high + k] - s.z[rows.p_low + k] - s.z[rows.u_low + k])
            .collect(),
        cut_price: (0..n).map(|k| s.z[rows.p_low + k]).collect(),
        beta_g_s: match (time, rows.time) {
            (TimeRule::Price(beta), _) => beta,
            (_, Some(row)) => s.z[row],
            (_, None) => 0.0,
        },
        iterations: s.iterations,
    }
}
