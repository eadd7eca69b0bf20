//! What the evidence of a cause is worth against the ways in which it may not be there.
//!
//! Without a cause its size is still not nothing to the drives. Three models have it so, and what the
//! cause is worth is what it adds to the best of them:
//!
//! | why a size shows | the size without the cause | worth of `E` nats |
//! |---|---|---|
//! | noise that remembers longer than its filter | normal, `phi` times as scattered as drives in order should have it | `E / phi` |
//! | scatter beside another cause, which no drive in order has shown | Student's t of `n` degrees of freedom | `n/2 ln(1 + 2 E / (n phi))` |
//! | the form of a stronger cause `j` | normal of deviation `tau` | `E` less what that takes |
//!
//! The first is a tempered likelihood (Miller and Dunson, J. Am. Stat. Assoc. 114, 2018), with the
//! dispersion of drives in order about this very size. The third: the form of a cause is known to a part
//! `rho` of it ([`crate::course`]), along the signals that drive it and in any other way; that part is as
//! likely to look like one as like another of the `K` causes that show in its modules,
//! `tau² = rho² |theta_j S_j|² / (K |S|²)` (a discrepancy in the span of what could be mistaken for a
//! cause: Kennedy and O'Hagan, J. R. Statist. Soc. B 63, 2001).

use nalgebra::{DMatrix, DVector};

use crate::causes::hypothesis::{CATALOGUE, Hypothesis};
use crate::problem::course::form;
use crate::problem::{Direction, Gram};
use crate::search::decisions::DISPERSION_PRIOR;
use crate::search::evidence::Evidence;
use crate::search::refit::Fit;

/// Whether two causes show in a module of the same replay.
fn meet(a: &Hypothesis, b: &Hypothesis) -> bool {
    let groups = b.groups();
    a.groups().iter().any(|g| groups.contains(g))
}

/// How many other causes of the catalogue show where this one does.
fn neighbours(own: &Hypothesis) -> usize {
    let mut ids: Vec<&str> = Vec::new();
    for h in CATALOGUE.iter().filter(|h| h.id != own.id && meet(h, own)) {
        if !ids.contains(&h.id) {
            ids.push(h.id);
        }
    }
    ids.len()
}

/// How much more drives scatter about the `j`-th direction of a Gram matrix than their information
/// says, drawn towards one by [`DISPERSION_PRIOR`] drives' worth.
fn dispersion(gram: &Gram, scores: &[DVector<f64>], j: usize) -> f64 {
    let drives = gram.per_drive.len() as f64;
    let seen: f64 = scores.iter().map(|s| s[j] * s[j]).sum();
    let expected: f64 = gram.per_drive.iter().map(|g| g[(j + 1, j + 1)]).sum();
    let ratio = if expected > f64::MIN_POSITIVE { drives * seen / expected } else { drives };
    (DISPERSION_PRIOR + ratio) / (DISPERSION_PRIOR + drives)
}

impl dyn Evidence + '_ {
    /// How much more these drives, which are in order, scatter about the sizes of every hypothesis than
    /// their information says, at least 1; the mean over the forms from which it is fitted.
    pub(crate) fn scatter_in_order(&self) -> Vec<f64> {
        let (mut directions, mut owner) = (Vec::new(), Vec::new());
        for (i, h) in CATALOGUE.iter().enumerate() {
            for start in h.starts {
                let shape: Vec<_> = h.shapes.iter().copied().zip(*start).collect();
                for p in h.sizes {
                    directions.push(Direction::new(*p, shape.clone(), p.spec().step));
                    owner.push(i);
                }
            }
        }
        let gram = self.gram(self.zero(), &directions);
        let scores = gram.scores(&DVector::zeros(directions.len()));
        let of = |i: usize| {
            let own = (0..owner.len()).filter(|j| owner[*j] == i);
            let all: Vec<f64> = own.map(|j| dispersion(&gram, &scores, j)).collect();
            (all.iter().sum::<f64>() / all.len().max(1) as f64).max(1.0)
        };
        (0..CATALOGUE.len()).map(of).collect()
    }

    /// What the evidence of the `i`-th member is worth; `nats` is what the set loses without each.
    pub(crate) fn worth(&self, fit: &Fit, i: usize, nats: &[f64]) -> f64 {
        let own = nats[i].max(0.0);
        let stronger: Vec<usize> =
            (0..fit.set.len()).filter(|j| (nats[*j], i) > (nats[i], *j)).collect();
        let noise = own / self.scatter_of(fit.set[i]);
        if stronger.is_empty() {
            return noise;
        }
        let form = own - self.looks_like(fit, i, &stronger).unwrap_or(0.0);
        noise.min(self.beside(fit, i, own)).min(form.max(0.0))
    }

    /// What `nats` of the `i`-th member are worth beside another cause: Student's t with the
    /// over-dispersion of the member's sizes on these drives alone.
    fn beside(&self, fit: &Fit, member: usize, nats: f64) -> f64 {
        let freedom = self.drives() as f64 - 1.0 + DISPERSION_PRIOR;
        let sizes = CATALOGUE[fit.set[member]].sizes;
        let all = fit.free.iter().zip(self.dispersions(fit));
        let most = all.filter(|(p, _)| sizes.contains(p)).map(|x| x.1).fold(1.0, f64::max);
        0.5 * freedom * (2.0 * nats / (freedom * most)).ln_1p()
    }

    /// Nats of the `i`-th member that the form of `stronger` ones takes: what its sizes say of a normal
    /// distribution with the deviation of that form, over what they say of nothing.
    fn looks_like(&self, fit: &Fit, i: usize, stronger: &[usize]) -> Option<f64> {
        let hyp = &CATALOGUE[fit.set[i]];
        let (information, _, _) = fit.whole.sum(|_| true);
        let places = |h: &Hypothesis| -> Vec<usize> {
            (0..fit.free.len()).filter(|j| h.sizes.contains(&fit.free[*j])).collect()
        };
        let size = |j: usize| {
            let p = fit.free[j] as usize;
            fit.theta[p] - self.zero()[p]
        };
        let square = |h: &Hypothesis| -> f64 {
            let all = places(h);
            let of = |a: &usize| {
                all.iter().map(|b| size(*a) * information[(*a, *b)] * size(*b)).sum::<f64>()
            };
            all.iter().map(of).sum()
        };
        let others = stronger.iter().map(|j| &CATALOGUE[fit.set[*j]]).filter(|h| meet(h, hyp));
        let patch: f64 =
            others.map(|h| form(h).powi(2) * square(h) / neighbours(h).max(1) as f64).sum();
        let own = places(hyp);
        let n = own.len();
        let spread = DMatrix::from_fn(n, n, |a, b| {
            if a == b { patch / information[(own[a], own[a])].max(f64::MIN_POSITIVE) } else { 0.0 }
        });
        // What the drives alone say of the sizes.
        let precision =
            DMatrix::from_fn(n, n, |a, b| fit.covariance[(own[a], own[b])]).try_inverse()?;
        let x = DVector::from_fn(n, |a, _| size(own[a]));
        let told = DMatrix::from_fn(n, n, |a, b| {
            let prior = if a == b { fit.priors[own[a]].sigma.powi(-2) } else { 0.0 };
            precision[(a, b)] - prior
        });
        let variance = told.clone().try_inverse()?;
        let x = &variance * (precision * x);
        let wide = (&variance + &spread).cholesky()?;
        let gain = 0.5 * (x.dot(&(&told * &x)) - x.dot(&wide.solve(&x)));
        let log_det = (DMatrix::identity(n, n) + spread * told).determinant().ln();
        let taken = gain - 0.5 * log_det;
        taken.is_finite().then_some(taken.max(0.0))
    }
}
