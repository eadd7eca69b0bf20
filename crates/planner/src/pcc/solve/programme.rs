//! The subproblem as matrices, for solvers of general quadratic programmes.
//!
//! Unknowns `E_1..E_N`, `b_0..b_{N-1}`, `u_0..u_{N-1}`, then one slack of a soft end, then `t_1..t_N`
//! when a fence asks for elapsed times. The pattern depends on the number of intervals, the kinds of
//! end and time, and on where a fence binds; never on values.

use alloc::vec::Vec;

use super::lin::{Subproblem, Terminal, TimeRule};
use super::quadratic::Quadratic;

/// A sparse matrix, entry by entry.
#[derive(Debug, Clone, Default)]
pub struct Triplets {
    /// Row of every entry.
    pub row: Vec<usize>,
    /// Column of every entry.
    pub column: Vec<usize>,
    /// Value of every entry.
    pub value: Vec<f64>,
}

impl Triplets {
    fn push(&mut self, row: usize, column: usize, value: f64) {
        self.row.push(row);
        self.column.push(column);
        self.value.push(value);
    }
}

/// A quadratic programme `min ½xᵀPx + qᵀx, Ax + s = b, s ∈ {0}^z × R₊^m` in triplets, for Clarabel
/// and for writing out.
#[derive(Debug, Clone, Default)]
pub struct Programme {
    /// Number of unknowns.
    pub columns: usize,
    /// Upper triangle of P.
    pub p: Triplets,
    /// Linear cost.
    pub q: Vec<f64>,
    /// A.
    pub a: Triplets,
    /// Right-hand side.
    pub b: Vec<f64>,
    /// Leading rows that are equalities.
    pub equalities: usize,
}

/// Rows of the inequality blocks, for reading the multipliers back.
pub(super) struct Rows {
    pub(super) p_low: usize,
    pub(super) p_high: usize,
    pub(super) u_low: usize,
    pub(super) time: Option<usize>,
}

impl Programme {
    fn entry(&mut self, row: usize, column: usize, value: f64) {
        self.a.push(row, column, value);
    }

    fn cost(&mut self, row: usize, column: usize, value: f64) {
        let (i, j) = if row <= column { (row, column) } else { (column, row) };
        self.p.push(i, j, value);
    }

    /// Writes the subproblem as matrices. `fence_s` are earliest times per node (`-∞`: none).
    #[must_use]
    pub fn new(
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        fence_s: Option<&[f64]>,
    ) -> Self {
        Self::build(sub, terminal, time, fence_s).0
    }

    pub(super) fn build(
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        fence_s: Option<&[f64]>,
    ) -> (Self, Rows) {
        let n = sub.n;
        let mut m = Self::default();
        let soft = matches!(terminal, Terminal::Soft { .. });
        let slack = 3 * n;
        let t_first = 3 * n + usize::from(soft);
        m.columns = t_first + if fence_s.is_some() { n } else { 0 };
        let mut quad = Quadratic::default();
        quad.assemble(sub, if let TimeRule::Price(beta) = time { beta } else { 0.0 });
        m.q = alloc::vec![0.0; m.columns];
        for i in 0..n {
            m.cost(i, i, quad.d0[i]);
            if i + 1 < n {
                m.cost(i, i + 1, quad.d1[i]);
            }
            if i + 2 < n {
                m.cost(i, i + 2, quad.d2[i]);
            }
            m.cost(n + i, n + i, quad.bb[i]);
            m.cost(i, n + i, quad.x1[i]);
            if i > 0 {
                m.cost(i - 1, n + i, quad.x0[i]);
            }
            m.q[i] = quad.ge[i];
            m.q[n + i] = quad.gb[i];
            m.q[2 * n + i] = -sub.discount[i];
        }
        // Equalities first.
        let mut row = 0;
        if let Terminal::Fixed(e) = terminal {
            m.entry(row, n - 1, 1.0);
            m.b.push(e);
            row += 1;
        }
        if fence_s.is_some() {
            for k in 0..n {
                // t_{k+1} - t_k - ta E_k - tb E_{k+1} = t0
                m.entry(row, t_first + k, 1.0);
                m.entry(row, k, -sub.tb[k]);
                let mut right = sub.t0[k];
                if k == 0 {
                    right += sub.ta[0] * sub.start_e;
                } else {
                    m.entry(row, t_first + k - 1, -1.0);
                    m.entry(row, k - 1, -sub.ta[k]);
                }
                m.b.push(right);
                row += 1;
            }
        }
        m.equalities = row;
        let rows = m.inequalities(sub, terminal, time, row);
        if let Some(fence) = fence_s {
            let mut row = m.b.len();
            for k in 0..n {
                if fence[k + 1].is_finite() {
                    m.entry(row, t_first + k, -1.0);
                    m.b.push(-fence[k + 1]);
                    row += 1;
                }
            }
        }
        if let Terminal::Soft { pay, credit, .. } = terminal {
            m.q[slack] = pay - credit;
            m.q[n - 1] -= credit;
        }
        (m, rows)
    }

    fn inequalities(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
        first: usize,
    ) -> Rows {
        let n = sub.n;
        let (p_low, p_high) = (first, first + n);
        for k in 0..n {
            // -p <= 0
            self.entry(p_low + k, k, -sub.a1[k]);
            self.entry(p_low + k, n + k, -1.0);
            let known = if k == 0 { sub.a0[0] * sub.start_e } else { 0.0 };
            if k > 0 {
                self.entry(p_low + k, k - 1, -sub.a0[k]);
            }
            self.b.push(sub.r[k] + known);
        }
        for k in 0..n {
            // p - phi1 Ē <= phi0
            let half = 0.5 * sub.phi1[k];
            self.entry(p_high + k, k, sub.a1[k] - half);
            self.entry(p_high + k, n + k, 1.0);
            let mut right = sub.phi0[k] - sub.r[k];
            if k > 0 {
                self.entry(p_high + k, k - 1, sub.a0[k] - half);
            } else {
                right -= (sub.a0[0] - half) * sub.start_e;
            }
            self.b.push(right);
        }
        let u_low = first + 2 * n;
        for k in 0..n {
            // u - p <= 0
            self.entry(u_low + k, 2 * n + k, 1.0);
            self.entry(u_low + k, k, -sub.a1[k]);
            self.entry(u_low + k, n + k, -1.0);
            let known = if k == 0 { sub.a0[0] * sub.start_e } else { 0.0 };
            if k > 0 {
                self.entry(u_low + k, k - 1, -sub.a0[k]);
            }
            self.b.push(sub.r[k] + known);
        }
        let mut row = first + 3 * n;
        let mut bound = |m: &mut Self, column: usize, sign: f64, right: f64| {
            m.entry(row, column, sign);
            m.b.push(right);
            row += 1;
        };
        let last_free = if matches!(terminal, Terminal::Fixed(_)) { n - 1 } else { n };
        for i in 0..last_free {
            bound(self, i, 1.0, sub.e_max[i + 1]);
            bound(self, i, -1.0, -sub.e_min[i + 1]);
        }
        for k in 0..n {
            bound(self, n + k, 1.0, sub.b_max);
            bound(self, n + k, -1.0, 0.0);
            bound(self, 2 * n + k, 1.0, sub.kink[k]);
        }
        if let Terminal::Soft { reference, .. } = terminal {
            // s >= 0 and s + E_N >= reference
            bound(self, 3 * n, -1.0, 0.0);
            bound(self, 3 * n, -1.0, -reference);
            let row = self.b.len() - 1;
            self.entry(row, n - 1, -1.0);
        }
        let time_row = if let TimeRule::AtMost(t) = time {
            let row = self.b.len();
            let mut right = t;
            for k in 0..n {
                let next = if k + 1 < n { sub.ta[k + 1] } else { 0.0 };
                self.entry(row, k, sub.tb[k] + next);
                right -= sub.t0[k];
            }
            right -= sub.ta[0] * sub.start_e;
            self.b.push(right);
            Some(row)
        } else {
            None
        };
        Rows { p_low, p_high, u_low, time: time_row }
    }
}
