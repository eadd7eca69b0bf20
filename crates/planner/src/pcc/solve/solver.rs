//! Which solver a subproblem goes to.

#[cfg(feature = "solver")]
use super::clarabel::Clarabel;
use super::lin::{Subproblem, Terminal, TimeRule};
use super::solution::{Solution, SolveStatus};
use super::structured::Structured;

/// The default solver: the structured fast path, and Clarabel (feature `solver`) where a fence
/// needs elapsed times or the fast path stops early. The two agree to 1e-4 on the test corpus.
#[derive(Debug, Clone, Default)]
pub struct DefaultSolver {
    fast: Structured,
    #[cfg(feature = "solver")]
    clarabel: Clarabel,
}

impl DefaultSolver {
    /// Solves a subproblem; the last argument are a fence's earliest times per node.
    #[must_use]
    pub fn solve(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        fence_s: Option<&[f64]>,
    ) -> Solution {
        let mut found = Solution::default();
        if fence_s.is_none() {
            self.fast.solve_into(sub, terminal, time, &mut found);
        }
        if found.status != SolveStatus::Solved {
            return self.second_opinion(sub, terminal, time, fence_s, found);
        }
        found
    }

    #[cfg(feature = "solver")]
    fn second_opinion(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        fence_s: Option<&[f64]>,
        _fast: Solution,
    ) -> Solution {
        self.clarabel.solve(sub, terminal, time, fence_s)
    }

    #[cfg(not(feature = "solver"))]
    fn second_opinion(
        &mut self,
        _sub: &Subproblem,
        _terminal: Terminal,
        _time: TimeRule,
        _fence_s: Option<&[f64]>,
        fast: Solution,
    ) -> Solution {
        fast
    }
}
