//! What the evidence of a cause is worth against the ways in which it may not be there.
//!
//! Without a cause its size is still not nothing to the drives. What tolerances would do beyond their first
//! order is taken off before (`lost_as_driven`): windy days are no wind. Three more models have it so, and
//! what the cause is worth is what it adds to the best of them:
//!
//! | why a size shows | the size without the cause | worth of `E` nats |
//! |---|---|---|
//! | noise and forms that the model does not have, as drives in order show them | Student's t of `n` degrees of freedom, `phi` times as scattered as those drives should have it | `n/2 ln(1 + 2 E / (n phi))` |
//! | the same, as these drives show it | the same | the same |
//! | the form of a stronger cause `j` | normal of deviation `tau` | `E` less what that takes |
//!
//! The first is a tempered likelihood (Miller and Dunson, J. Am. Stat. Assoc. 114, 2018) with a dispersion
//! that is itself known from a few drives only: from as many as say something of the size, one or two
//! where the baseline was hardly ever hot or high. Without a baseline nothing is known of it, `E` is what
//! it is. The third: the form of a cause is known to a part
//! `rho` of it ([`crate::problem::course`]), along the signals that drive it and in any other way; that part is as
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

/// How much more drives in order scatter about a size than their information says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dispersion {
    /// Variance over that which is expected, at least 1.
    pub(crate) ratio: f64,
    /// Degrees of freedom: drives in order that say something of the size, and the prior's.
    pub(crate) freedom: f64,
}

impl Dispersion {
    /// Where no drive in order has shown more.
    pub(crate) const NONE: Self = Self { ratio: 1.0, freedom: f64::INFINITY };

    /// What `nats` of evidence are worth: those of Student's t.
    fn worth(self, nats: f64) -> f64 {
        let n = self.freedom;
        if n.is_finite() {
            0.5 * n * (2.0 * nats / (n * self.ratio)).ln_1p()
        } else {
            nats / self.ratio
        }
    }
}

/// How much more drives scatter about the `j`-th direction of a Gram matrix than their information
/// says, drawn towards one by [`DISPERSION_PRIOR`] drives' worth. Drives count by what they say of it
/// (the effective number of weights: Kish, Survey Sampling, 1965).
fn dispersion(gram: &Gram, scores: &[DVector<f64>], j: usize) -> Dispersion {
    let seen: f64 = scores.iter().map(|s| s[j] * s[j]).sum();
    let expected: f64 = gram.per_drive.iter().map(|g| g[(j + 1, j + 1)]).sum();
    let squares: f64 = gram.per_drive.iter().map(|g| g[(j + 1, j + 1)].powi(2)).sum();
    let told = squares > f64::MIN_POSITIVE;
    let drives = if told { expected * expected / squares } else { 0.0 };
    let ratio = if told { drives * seen / expected } else { 0.0 };
    let freedom = DISPERSION_PRIOR + drives;
    Dispersion { ratio: (DISPERSION_PRIOR + ratio) / freedom, freedom }
}

impl dyn Evidence + '_ {
    /// How much more these drives, which are in order, scatter about the sizes of every hypothesis than
    /// their information says, at least 1; the mean over the forms from which it is fitted.
    pub(crate) fn scatter_in_order(&self) -> Vec<Dispersion> {
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
        let gram = self.gram_as_driven(self.zero(), &directions);
        let scores = gram.scores(&DVector::zeros(directions.len()));
        let of = |i: usize| {
            let own = (0..owner.len()).filter(|j| owner[*j] == i);
            let all: Vec<Dispersion> = own.map(|j| dispersion(&gram, &scores, j)).collect();
            let mean = |of: fn(&Dispersion) -> f64| {
                all.iter().map(of).sum::<f64>() / all.len().max(1) as f64
            };
            Dispersion { ratio: mean(|d| d.ratio).max(1.0), freedom: mean(|d| d.freedom) }
        };
        (0..CATALOGUE.len()).map(of).collect()
    }

    /// What the evidence of the `i`-th member is worth; `nats` is what the set loses without each.
    pub(crate) fn worth(&self, fit: &Fit, i: usize, nats: &[f64]) -> f64 {
        let own = nats[i].max(0.0);
        let stronger: Vec<usize> =
            (0..fit.set.len()).filter(|j| (nats[*j], i) > (nats[i], *j)).collect();
        let noise = self.scatter_of(fit.set[i]).worth(own).min(self.agreed(fit, i, own));
        if stronger.is_empty() {
            return noise;
        }
        let form = own - self.looks_like(fit, i, &stronger).unwrap_or(0.0);
        noise.min(form.max(0.0))
    }

    /// What `nats` of the `i`-th member are worth with the over-dispersion of its sizes on these drives
    /// themselves.
    fn agreed(&self, fit: &Fit, member: usize, nats: f64) -> f64 {
        let freedom = self.drives() as f64 - 1.0 + DISPERSION_PRIOR;
        let sizes = CATALOGUE[fit.set[member]].sizes;
        let all = fit.free.iter().zip(self.dispersions(fit));
        let ratio = all.filter(|(p, _)| sizes.contains(p)).map(|x| x.1).fold(1.0, f64::max);
        Dispersion { ratio, freedom }.worth(nats)
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
