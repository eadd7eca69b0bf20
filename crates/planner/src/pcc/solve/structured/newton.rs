//! One Newton system: residuals and reduced matrix in one sweep, directions in one sweep each.
//!
//! Per interval, weights of its inequalities act through four sums ([`Acting`]) and one product: on
//! the mean energy `-φ'` times the weight of full load.

use super::{
    BELOW_TRACTION, CEILING, CUT_OFF, FLOOR, FULL_LOAD, HARDEST_BRAKE, KINK, NO_BRAKE, ROWS,
    Structured,
};
use crate::pcc::solve::{Subproblem, Terminal, TimeRule};

/// Largest residuals and mean complementarity of a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Residuals {
    pub(super) primal: f64,
    pub(super) dual: f64,
    pub(super) mu: f64,
}

/// Parts of an interval's Newton system that stay after `b` and `u` are eliminated.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Eliminated {
    /// Weight of [`BELOW_TRACTION`], and the inverse of its sum with that of [`KINK`].
    w5: f64,
    inverse_u: f64,
    /// Coupling of the brake with the energies, and the inverse of its own entry.
    x0: f64,
    x1: f64,
    inverse_b: f64,
    /// Right-hand sides of `u` and of `b` after `u`.
    right_u: f64,
    right_b: f64,
}

/// Sums of row weights by what they act on.
struct Acting {
    traction: f64,
    brake: f64,
    below: f64,
    energy: f64,
}

impl Acting {
    #[inline]
    fn of(y: &[f64; ROWS]) -> Self {
        Self {
            traction: y[FULL_LOAD] - y[CUT_OFF] - y[BELOW_TRACTION],
            brake: y[HARDEST_BRAKE] - y[NO_BRAKE],
            below: y[KINK] + y[BELOW_TRACTION],
            energy: y[CEILING] - y[FLOOR],
        }
    }
}

/// Sums over a point's inequalities, and its largest residuals.
struct Sums {
    primal: f64,
    dual: f64,
    /// Σ s z, and the number of inequalities.
    product: f64,
    count: f64,
}

#[inline]
fn times(a: &[f64; ROWS], b: &[f64; ROWS]) -> [f64; ROWS] {
    core::array::from_fn(|i| a[i] * b[i])
}

/// Entry by entry the larger one; nothing waits for the entry before.
#[inline]
fn raise(seen: &mut [f64; ROWS], values: [f64; ROWS]) {
    for (m, v) in seen.iter_mut().zip(values) {
        *m = if v > *m { v } else { *m };
    }
}

fn largest(seen: &[f64; ROWS]) -> f64 {
    seen.iter().fold(0.0, |m, v| if *v > m { *v } else { m })
}

impl Structured {
    /// Gradient of the cost alone, into `grad_e` and `grad_b`.
    fn cost_gradient(&mut self, n: usize) {
        let q = &self.quad;
        let (e, b) = (&self.e[..n], &self.b[..n]);
        let (ge, gb) = (&mut self.grad_e[..n], &mut self.grad_b[..n]);
        let (d0, d1, d2) = (&q.d0[..n], &q.d1[..n], &q.d2[..n]);
        let (x0, x1, bb) = (&q.x0[..n], &q.x1[..n], &q.bb[..n]);
        let (c, cb) = (&q.ge[..n], &q.gb[..n]);
        for i in 0..n {
            ge[i] = c[i] + d0[i] * e[i] + x1[i] * b[i];
            gb[i] = cb[i] + bb[i] * b[i] + x1[i] * e[i];
        }
        for i in 1..n {
            ge[i] += d1[i - 1] * e[i - 1];
            ge[i - 1] += d1[i - 1] * e[i] + x0[i] * b[i];
            gb[i] += x0[i] * e[i - 1];
        }
        for i in 2..n {
            ge[i] += d2[i - 2] * e[i - 2];
            ge[i - 2] += d2[i - 2] * e[i];
        }
    }

    /// Residuals at the current point; the reduced Newton matrix into `band`, the right-hand side of
    /// the predictor (complementarity zero) into `base` and `parts`.
    pub(super) fn assemble(
        &mut self,
        sub: &Subproblem,
        terminal: Terminal,
        time: TimeRule,
    ) -> Residuals {
        let fixed = matches!(terminal, Terminal::Fixed(_));
        self.assemble_cost(sub.n);
        let mut sums = self.assemble_intervals(sub, fixed);
        self.assemble_time(time, &mut sums);
        self.assemble_soft_end(terminal, &mut sums);
        if fixed {
            let last = sub.n - 1;
            (self.grad_e[last], self.base[last]) = (0.0, 0.0);
        }
        let dual = self.grad_e.iter().fold(sums.dual, |m, g| m.max(g.abs()));
        Residuals { primal: sums.primal, dual, mu: sums.product / sums.count }
    }

    /// The cost alone: its gradient, its matrix, and the right-hand side against it.
    fn assemble_cost(&mut self, n: usize) {
        self.cost_gradient(n);
        self.band.m0.copy_from_slice(&self.quad.d0);
        self.band.m1.copy_from_slice(&self.quad.d1);
        self.band.m2.copy_from_slice(&self.quad.d2);
        for (r, g) in self.base.iter_mut().zip(&self.grad_e) {
            *r = -g;
        }
    }

    /// The inequalities of every interval, with brake and `u` eliminated.
    fn assemble_intervals(&mut self, sub: &Subproblem, fixed: bool) -> Sums {
        let n = sub.n;
        let (mut primals, mut products) = ([0.0; ROWS], [0.0; ROWS]);
        let mut dual = 0.0f64;
        // Slices of known length: no bounds to check and no pointers to read again in the sweep.
        let (rows, parts) = (&mut self.rows[..n], &mut self.parts[..n]);
        let (m0, m1) = (&mut self.band.m0[..n], &mut self.band.m1[..n]);
        let (grad_e, grad_b) = (&mut self.grad_e[..n], &mut self.grad_b[..n]);
        let (base, energy, brake, below) =
            (&mut self.base[..n], &self.e[..n], &self.b[..n], &self.u[..n]);
        let (of_a0, of_a1, of_r) = (&sub.a0[..n], &sub.a1[..n], &sub.r[..n]);
        let (phi0, phi1, kink) = (&sub.phi0[..n], &sub.phi1[..n], &sub.kink[..n]);
        let (discount, e_max, e_min) = (&sub.discount[..n], &sub.e_max[1..=n], &sub.e_min[1..=n]);
        let (bb, q0, q1) = (&self.quad.bb[..n], &self.quad.x0[..n], &self.quad.x1[..n]);
        let mut e0 = sub.start_e;
        for k in 0..n {
            let row = &mut rows[k];
            let (a0, a1, half) = (of_a0[k], of_a1[k], 0.5 * phi1[k]);
            let (e1, b, u) = (energy[k], brake[k], below[k]);
            let p = a0 * e0 + a1 * e1 + b + of_r[k];
            let mut over = [0.0; ROWS];
            over[CUT_OFF] = -p;
            over[FULL_LOAD] = p - half * (e0 + e1) - phi0[k];
            over[HARDEST_BRAKE] = b - sub.b_max;
            over[NO_BRAKE] = -b;
            over[KINK] = u - kink[k];
            over[BELOW_TRACTION] = u - p;
            over[CEILING] = e1 - e_max[k];
            over[FLOOR] = e_min[k] - e1;
            for (i, over) in over.into_iter().enumerate() {
                row.inverse_s[i] = 1.0 / row.s[i];
                row.rp[i] = over + row.s[i];
            }
            if fixed && k + 1 == n {
                (row.rp[CEILING], row.rp[FLOOR]) = (0.0, 0.0);
                (row.inverse_s[CEILING], row.inverse_s[FLOOR]) = (0.0, 0.0);
            }
            raise(&mut primals, row.rp.map(f64::abs));
            for (sum, product) in products.iter_mut().zip(times(&row.s, &row.z)) {
                *sum += product;
            }
            let w = times(&row.z, &row.inverse_s);
            // Dual residual with z, right-hand side with W r_p.
            let of_z = Acting::of(&row.z);
            let of_wr = Acting::of(&times(&w, &row.rp));
            let bend_z = half * row.z[FULL_LOAD];
            let bend_wr = half * w[FULL_LOAD] * row.rp[FULL_LOAD];
            let own_b = grad_b[k];
            grad_e[k] += a1 * of_z.traction - bend_z + of_z.energy;
            grad_b[k] = own_b + of_z.traction + of_z.brake;
            let right_u = discount[k] - of_wr.below;
            let left_u = of_z.below - discount[k];
            dual = dual.max(grad_b[k].abs()).max(left_u.abs());
            // u eliminated: its bound by the traction becomes a weight on p, in series with the kink's.
            let inverse_u = 1.0 / (w[KINK] + w[BELOW_TRACTION]);
            let wp = w[CUT_OFF] + w[KINK] * w[BELOW_TRACTION] * inverse_u;
            let share_u = w[BELOW_TRACTION] * inverse_u * right_u;
            let (f0, f1, wf) = (a0 - half, a1 - half, w[FULL_LOAD]);
            let inverse_b = 1.0 / (bb[k] + wp + wf + w[HARDEST_BRAKE] + w[NO_BRAKE]);
            let x1 = q1[k] + wp * a1 + wf * f1;
            let right_b = share_u - own_b - of_wr.traction - of_wr.brake;
            let share_b = inverse_b * right_b;
            let bounds = wp * a1 * a1 + wf * f1 * f1 + w[CEILING] + w[FLOOR];
            m0[k] += bounds - x1 * x1 * inverse_b;
            base[k] += a1 * (share_u - of_wr.traction) + bend_wr - of_wr.energy - x1 * share_b;
            let mut x0 = 0.0;
            if k > 0 {
                x0 = q0[k] + wp * a0 + wf * f0;
                grad_e[k - 1] += a0 * of_z.traction - bend_z;
                base[k - 1] += a0 * (share_u - of_wr.traction) + bend_wr - x0 * share_b;
                m0[k - 1] += wp * a0 * a0 + wf * f0 * f0 - x0 * x0 * inverse_b;
                m1[k - 1] += wp * a0 * a1 + wf * f0 * f1 - x0 * x1 * inverse_b;
            }
            let w5 = w[BELOW_TRACTION];
            parts[k] = Eliminated { w5, inverse_u, x0, x1, inverse_b, right_u, right_b };
            e0 = e1;
        }
        let count = (ROWS * n) as f64 - if fixed { 2.0 } else { 0.0 };
        Sums { primal: largest(&primals), dual, product: products.iter().sum::<f64>(), count }
    }

    /// The longest duration, a dense row: all but its matrix, which [`Self::border`] brings in.
    fn assemble_time(&mut self, time: TimeRule, sums: &mut Sums) {
        let (Some(row), TimeRule::AtMost(t)) = (&mut self.time, time) else { return };
        let lasts = self.known_time_s + self.t.iter().zip(&self.e).map(|(t, e)| t * e).sum::<f64>();
        row.rp = lasts + row.s - t;
        sums.primal = sums.primal.max(row.rp.abs());
        let pull = -row.weight() * row.rp;
        for ((g, r), t) in self.grad_e.iter_mut().zip(&mut self.base).zip(&self.t) {
            *g += row.z * t;
            *r += pull * t;
        }
        sums.product += row.s * row.z;
        sums.count += 1.0;
    }

    /// A soft end, its slack eliminated.
    fn assemble_soft_end(&mut self, terminal: Terminal, sums: &mut Sums) {
        let (Some(end), Terminal::Soft { reference, pay, credit }) = (&mut self.soft, terminal)
        else {
            return;
        };
        let last = self.e.len() - 1;
        end.own.rp = end.own.s - end.slack;
        end.spare.rp = end.spare.s - end.slack - self.e[last] + reference;
        sums.primal = sums.primal.max(end.own.rp.abs()).max(end.spare.rp.abs());
        self.grad_e[last] -= credit + end.spare.z;
        self.base[last] += credit;
        let left = pay - credit - end.own.z - end.spare.z;
        sums.dual = sums.dual.max(left.abs());
        let (of_own, of_spare) = (end.own.weight(), end.spare.weight());
        // Predictor: multipliers fall out of the right-hand sides.
        end.right = -(pay - credit) + of_own * end.own.rp + of_spare * end.spare.rp;
        let share = of_spare / (of_own + of_spare);
        self.base[last] += of_spare * end.spare.rp - share * end.right;
        self.band.m0[last] += of_spare - of_spare * of_spare / (of_own + of_spare);
        sums.product += end.own.s * end.own.z + end.spare.s * end.spare.z;
        sums.count += 2.0;
    }

    /// Factors the reduced matrix; false if a pivot is not positive.
    pub(super) fn factor(&mut self, fixed: bool) -> bool {
        if fixed {
            self.band.pin_last();
        }
        self.band.factor()
    }

    /// Predictor: the step to complementarity zero, its reach, and `Σ ds dz`.
    pub(super) fn predict(&mut self, sub: &Subproblem, fixed: bool) -> (f64, f64) {
        self.de.copy_from_slice(&self.base);
        if self.time.is_some() {
            self.mt.copy_from_slice(&self.t);
            if fixed {
                self.mt[sub.n - 1] = 0.0;
            }
            self.band.solve_two(&mut self.de, &mut self.mt);
        } else {
            self.band.solve(&mut self.de);
        }
        self.border();
        let n = sub.n;
        let (mut worsts, mut products) = ([0.0; ROWS], [0.0; ROWS]);
        let mut before = 0.0;
        let (a0, a1, phi1) = (&sub.a0[..n], &sub.a1[..n], &sub.phi1[..n]);
        let (parts, rows, de) = (&self.parts[..n], &mut self.rows[..n], &self.de[..n]);
        for k in 0..n {
            let (part, row, de) = (&parts[k], &mut rows[k], de[k]);
            let step = part.recover([a0[k], a1[k], 0.5 * phi1[k]], before, de).of_rows;
            let mut ratios = [0.0; ROWS];
            for i in 0..ROWS {
                let ds = -row.rp[i] - step[i];
                // -ds/s, and -dz/z = 1 + ds/s.
                let ratio = ds * row.inverse_s[i];
                let dz = -row.z[i] - row.z[i] * ratio;
                row.ds[i] = ds;
                row.dz[i] = dz;
                products[i] += ds * dz;
                ratios[i] = if -ratio > 1.0 + ratio { -ratio } else { 1.0 + ratio };
            }
            raise(&mut worsts, ratios);
            before = de;
        }
        let (mut worst, mut product) = (largest(&worsts), products.iter().sum::<f64>());
        self.scalar_steps(|r| r.s * r.z);
        self.scalars(|r| {
            worst = worst.max(-r.ds / r.s).max(-r.dz / r.z);
            product += r.ds * r.dz;
        });
        (1.0 / worst.max(1e-12), product)
    }

    /// Corrector: centring to `target` and the second-order term. Returns the reach.
    pub(super) fn correct(&mut self, sub: &Subproblem, fixed: bool, target: f64) -> f64 {
        let n = sub.n;
        let (a0, a1, phi1) = (&sub.a0[..n], &sub.a1[..n], &sub.phi1[..n]);
        let (parts, rows, base) = (&mut self.parts[..n], &mut self.rows[..n], &mut self.base[..n]);
        for k in 0..n {
            let (part, row) = (&mut parts[k], &mut rows[k]);
            for i in 0..ROWS {
                // From here `dz` holds the second-order term until the step is recovered.
                row.dz[i] = row.ds[i] * row.dz[i] - target;
            }
            let y = times(&row.dz, &row.inverse_s);
            let of_y = Acting::of(&y);
            let bend = 0.5 * phi1[k] * y[FULL_LOAD];
            let share_u = part.w5 * part.inverse_u * of_y.below;
            let on_b = of_y.traction + of_y.brake + share_u;
            part.right_u += of_y.below;
            part.right_b += on_b;
            let share_b = part.inverse_b * on_b;
            let on_p = of_y.traction + share_u;
            base[k] += a1[k] * on_p - bend + of_y.energy - part.x1 * share_b;
            if k > 0 {
                base[k - 1] += a0[k] * on_p - bend - part.x0 * share_b;
            }
        }
        if let Some(row) = &mut self.time {
            row.rc = row.s * row.z + row.ds * row.dz - target;
            let pull = (row.ds * row.dz - target) / row.s;
            for (r, t) in self.base.iter_mut().zip(&self.t) {
                *r += t * pull;
            }
        }
        if let Some(end) = &mut self.soft {
            for r in [&mut end.own, &mut end.spare] {
                r.rc = r.s * r.z + r.ds * r.dz - target;
            }
            let own = (end.own.ds * end.own.dz - target) / end.own.s;
            let spare = (end.spare.ds * end.spare.dz - target) / end.spare.s;
            let (w7, w8) = (end.own.weight(), end.spare.weight());
            end.right -= own + spare;
            self.base[n - 1] += -spare + w8 / (w7 + w8) * (own + spare);
        }
        if fixed {
            self.base[n - 1] = 0.0;
        }
        self.de.copy_from_slice(&self.base);
        self.band.solve(&mut self.de);
        self.border();
        let mut worsts = [0.0; ROWS];
        let mut before = 0.0;
        let (parts, rows, de) = (&self.parts[..n], &mut self.rows[..n], &self.de[..n]);
        let (db, du) = (&mut self.db[..n], &mut self.du[..n]);
        for k in 0..n {
            let (part, row, de) = (&parts[k], &mut rows[k], de[k]);
            let found = part.recover([a0[k], a1[k], 0.5 * phi1[k]], before, de);
            (db[k], du[k]) = (found.db, found.du);
            let step = found.of_rows;
            let mut ratios = [0.0; ROWS];
            for i in 0..ROWS {
                let ds = -row.rp[i] - step[i];
                let dz = -row.z[i] - (row.z[i] * ds + row.dz[i]) * row.inverse_s[i];
                row.ds[i] = ds;
                row.dz[i] = dz;
                let (of_s, of_z) = (-ds * row.inverse_s[i], -dz / row.z[i]);
                ratios[i] = if of_s > of_z { of_s } else { of_z };
            }
            raise(&mut worsts, ratios);
            before = de;
        }
        let mut worst = largest(&worsts);
        self.scalar_steps(|r| r.rc);
        self.scalars(|r| worst = worst.max(-r.ds / r.s).max(-r.dz / r.z));
        1.0 / worst.max(1e-12)
    }

    /// The dense time row by one Schur complement.
    fn border(&mut self) {
        if let Some(row) = &self.time {
            let along = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let y = along(&self.t, &self.de) / (1.0 / row.weight() + along(&self.t, &self.mt));
            for (d, m) in self.de.iter_mut().zip(&self.mt) {
                *d -= y * m;
            }
        }
    }

    /// Steps of the inequalities outside the intervals, for the complementarity `rc`.
    fn scalar_steps(&mut self, rc: impl Fn(&super::Scalar) -> f64) {
        if let Some(row) = &mut self.time {
            let c_dx = self.t.iter().zip(&self.de).map(|(a, b)| a * b).sum();
            let rc = rc(row);
            row.direct(c_dx, rc);
        }
        if let Some(end) = &mut self.soft {
            let last = self.de[self.de.len() - 1];
            let (w7, w8) = (end.own.weight(), end.spare.weight());
            end.step = (end.right - w8 * last) / (w7 + w8);
            let (own, spare) = (rc(&end.own), rc(&end.spare));
            end.own.direct(-end.step, own);
            end.spare.direct(-end.step - last, spare);
        }
    }
}

/// Brake, `u` and left-hand sides of the inequalities: an interval's step.
struct Step {
    db: f64,
    du: f64,
    of_rows: [f64; ROWS],
}

impl Eliminated {
    /// An interval's step from the steps of its energies; `[a0, a1, φ'/2]`.
    #[inline]
    fn recover(&self, [a0, a1, half]: [f64; 3], before: f64, de: f64) -> Step {
        let db = (self.right_b - self.x1 * de - self.x0 * before) * self.inverse_b;
        let dp = a0 * before + a1 * de + db;
        let du = (self.right_u + self.w5 * dp) * self.inverse_u;
        let bend = half * (before + de);
        let mut of_rows = [0.0; ROWS];
        of_rows[CUT_OFF] = -dp;
        of_rows[FULL_LOAD] = dp - bend;
        of_rows[HARDEST_BRAKE] = db;
        of_rows[NO_BRAKE] = -db;
        of_rows[KINK] = du;
        of_rows[BELOW_TRACTION] = du - dp;
        of_rows[CEILING] = de;
        of_rows[FLOOR] = -de;
        Step { db, du, of_rows }
    }
}
