//! Warm start: a solve begins where the last one was half way, if the two are alike.
//!
//! The last solution itself would be a poor start: it lies on its boundary, and an interior-point
//! method that starts at a boundary takes tiny steps. So the first point with a mean
//! complementarity below [`MU_KEPT`] is kept; it is still well inside. Slacks are taken from the new problem
//! and multipliers brought back near the central path (E. A. Yildirim, S. J. Wright, SIAM J. Optim.
//! 12, 2002, on warm starts of interior-point methods). A solve that starts too far away or does not
//! end soon ([`LIMITS`]) starts anew, cold.

use alloc::vec::Vec;

use super::{CEILING, FLOOR, ROWS, Scalar, SoftEnd, Structured, room};
use crate::pcc::solve::{Subproblem, Terminal, TimeRule};

/// Mean complementarity of a point that is kept, g per inequality.
pub(super) const MU_KEPT: f64 = 1e-3;
/// When a warm start is given up: where it starts farther from the new problem, or takes longer,
/// than a cold start does.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Iterations.
    pub(super) iterations: u32,
    /// Largest violation at the start in its own unit (J/kg, m/s², s).
    pub(super) primal: f64,
    /// Largest gradient at the start, relative to the largest cost gradient.
    pub(super) dual: f64,
}

pub(super) const LIMITS: Limits = Limits { iterations: 12, primal: 1.0, dual: 0.06 };
/// Least mean complementarity to start from, g per inequality.
const MU_LEAST: f64 = 1e-4;
/// Least share of an earlier slack.
const LEAST_SLACK: f64 = 0.5;
/// Factor from the central path up to which multipliers are left as they were.
const OFF_CENTRE: f64 = 10.0;

/// Point of an earlier solve.
#[derive(Debug, Clone, Default)]
pub(super) struct Kept {
    mu: f64,
    e: Vec<f64>,
    b: Vec<f64>,
    u: Vec<f64>,
    rows: Vec<[[f64; ROWS]; 2]>,
    time: Option<Scalar>,
    soft: Option<SoftEnd>,
}

fn centred(s: f64, z: f64, mu: f64) -> f64 {
    z.clamp(mu / (OFF_CENTRE * s), OFF_CENTRE * mu / s)
}

impl Structured {
    /// Keeps the current point, of mean complementarity `mu`.
    pub(super) fn keep(&mut self, mu: f64) {
        let kept = &mut self.kept;
        kept.mu = mu;
        for (to, from) in [(&mut kept.e, &self.e), (&mut kept.b, &self.b), (&mut kept.u, &self.u)] {
            to.clear();
            to.extend_from_slice(from);
        }
        kept.rows.clear();
        kept.rows.extend(self.rows.iter().map(|r| [r.s, r.z]));
        kept.time = self.time;
        kept.soft = self.soft;
    }

    /// Starts from the kept point; false if there is none of a problem like this one.
    pub(super) fn resume(&mut self, sub: &Subproblem, terminal: Terminal, time: TimeRule) -> bool {
        let n = sub.n;
        let kept = &self.kept;
        let alike = kept.e.len() == n
            && kept.time.is_some() == matches!(time, TimeRule::AtMost(_))
            && kept.soft.is_some() == matches!(terminal, Terminal::Soft { .. });
        if !alike {
            return false;
        }
        let mu = kept.mu.max(MU_LEAST);
        self.e.copy_from_slice(&kept.e);
        self.b.copy_from_slice(&kept.b);
        self.u.copy_from_slice(&kept.u);
        let fixed = if let Terminal::Fixed(e) = terminal {
            self.e[n - 1] = e;
            true
        } else {
            false
        };
        let mut e0 = sub.start_e;
        for k in 0..n {
            let (e1, b, u) = (self.e[k], self.b[k], self.u[k]);
            let p = sub.a0[k] * e0 + sub.a1[k] * e1 + b + sub.r[k];
            let room = room(sub, k, [e0, e1, b, u], p);
            let [s, z] = &kept.rows[k];
            let row = &mut self.rows[k];
            for i in 0..ROWS {
                row.s[i] = room[i].max(LEAST_SLACK * s[i]);
                row.z[i] = centred(row.s[i], z[i], mu);
            }
            if fixed && k + 1 == n {
                (row.z[CEILING], row.z[FLOOR]) = (0.0, 0.0);
            }
            e0 = e1;
        }
        self.time = kept.time;
        if let (Some(row), TimeRule::AtMost(t)) = (&mut self.time, time) {
            let lasts: f64 = self.t.iter().zip(&self.e).map(|(t, e)| t * e).sum();
            row.s = (t - self.known_time_s - lasts).max(LEAST_SLACK * row.s);
            row.z = centred(row.s, row.z, mu);
        }
        self.soft = kept.soft;
        if let (Some(end), Terminal::Soft { reference, .. }) = (&mut self.soft, terminal) {
            let spare = end.slack + self.e[n - 1] - reference;
            end.spare.s = spare.max(LEAST_SLACK * end.spare.s);
            for row in [&mut end.own, &mut end.spare] {
                row.z = centred(row.s, row.z, mu);
            }
        }
        true
    }
}
