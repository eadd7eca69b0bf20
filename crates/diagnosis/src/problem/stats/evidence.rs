//! Evidence of a linear-Gaussian extension from its information matrix and gradient.
//!
//! With residual `r`, sensitivities `G`, nuisance-marginal metric `M`, prior covariance `P`:
//! `log Z = 1/2 b' (A + P^-1)^-1 b - 1/2 log|I + P A|`, `A = G'MG`, `b = G'Mr`
//! (MacKay, Neural Computation 4, 1992), relative to no extension.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// `I + S A S` with the prior's deviations `S`, factored, and its `log|.|`.
fn scaled(a: &DMatrix<f64>, prior_sigma: &[f64]) -> Option<(Cholesky<f64, Dyn>, f64)> {
    let (n, d) = (prior_sigma.len(), prior_sigma);
    let of = |i, j| d[i] * a[(i, j)] * d[j] + if i == j { 1.0 } else { 0.0 };
    let chol = DMatrix::from_fn(n, n, of).cholesky()?;
    let log_det: f64 = 2.0 * (0..n).map(|i| chol.l()[(i, i)].ln()).sum::<f64>();
    Some((chol, log_det))
}

/// Log evidence in nats and the posterior mean; `None` if the system is not positive definite.
pub(crate) fn linear(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    prior_sigma: &[f64],
) -> Option<(f64, DVector<f64>)> {
    let d = DVector::from_column_slice(prior_sigma);
    let (chol, log_det) = scaled(a, prior_sigma)?;
    let rhs = d.component_mul(b);
    let x = chol.solve(&rhs);
    let log_z = 0.5 * rhs.dot(&x) - 0.5 * log_det;
    Some((log_z, x.component_mul(&d)))
}

/// Covariance `(A + P^-1)^-1` and `log|I + P A|`; `None` if the system is not positive definite.
pub(crate) fn posterior(a: &DMatrix<f64>, prior_sigma: &[f64]) -> Option<(DMatrix<f64>, f64)> {
    let (chol, log_det) = scaled(a, prior_sigma)?;
    let (inverse, n, d) = (chol.inverse(), prior_sigma.len(), prior_sigma);
    Some((DMatrix::from_fn(n, n, |i, j| d[i] * inverse[(i, j)] * d[j]), log_det))
}

/// Rows and columns `keep` of a matrix.
pub(crate) fn sub(a: &DMatrix<f64>, keep: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(keep.len(), keep.len(), |i, j| a[(keep[i], keep[j])])
}

/// Entries `keep` of a vector.
pub(crate) fn pick(b: &DVector<f64>, keep: &[usize]) -> DVector<f64> {
    DVector::from_iterator(keep.len(), keep.iter().map(|i| b[*i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evidence_of_one_direction_is_the_closed_form() {
        let (information, gradient, sigma) = (400.0, 50.0, 0.3_f64);
        let (log_z, x) = linear(
            &DMatrix::from_element(1, 1, information),
            &DVector::from_element(1, gradient),
            &[sigma],
        )
        .unwrap();
        let precision = information + 1.0 / (sigma * sigma);
        assert!((x[0] - gradient / precision).abs() < 1e-12);
        let expected =
            0.5 * gradient * gradient / precision - 0.5 * (1.0 + sigma * sigma * information).ln();
        assert!((log_z - expected).abs() < 1e-9);
    }

    #[test]
    fn a_direction_that_carries_nothing_costs_evidence() {
        let a = DMatrix::from_diagonal(&DVector::from_vec(vec![100.0, 100.0]));
        let with = linear(&a, &DVector::from_vec(vec![40.0, 0.0]), &[1.0, 1.0]).unwrap().0;
        let without = linear(&sub(&a, &[0]), &DVector::from_vec(vec![40.0]), &[1.0]).unwrap().0;
        assert!(with < without);
    }
}
