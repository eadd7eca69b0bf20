//! Nonlinear least squares with priors, for the studies that fit a handful of parameters.
//!
//! Minimises `|r(p)|² + sum ((p_i - m_i)/s_i)²` by Levenberg-Marquardt with central differences
//! (Nocedal & Wright, Numerical Optimization, ch. 10). Residuals are in standard deviations. The
//! covariance is the inverse of the information matrix, or the sandwich over clusters of
//! residuals (White 1982), which holds although the residuals inside a cluster belong together.

use nalgebra::{DMatrix, DVector};

/// Most steps of a search.
const ITERATIONS: usize = 200;

/// One parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Where the search starts, and the mean of the prior if there is one.
    pub start: f64,
    /// Typical size; sets the step of the differences.
    pub scale: f64,
    /// Standard deviation of a normal prior about `start`.
    pub prior_sigma: Option<f64>,
}

impl Parameter {
    /// A parameter without prior.
    #[must_use]
    pub fn free(start: f64, scale: f64) -> Self {
        Self { start, scale, prior_sigma: None }
    }

    /// A parameter that is known to within `sigma`.
    #[must_use]
    pub fn known(mean: f64, sigma: f64) -> Self {
        Self { start: mean, scale: sigma, prior_sigma: Some(sigma) }
    }
}

/// The result of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Parameters.
    pub value: Vec<f64>,
    /// Covariance of the parameters.
    pub covariance: DMatrix<f64>,
    /// Residuals of the data at the optimum, in standard deviations.
    pub residuals: Vec<f64>,
    jacobian: DMatrix<f64>,
}

impl Estimate {
    /// Standard deviation of a parameter.
    #[must_use]
    pub fn sigma(&self, parameter: usize) -> f64 {
        self.covariance[(parameter, parameter)].max(0.0).sqrt()
    }

    /// Sum of squared residuals of the data.
    #[must_use]
    pub fn chi_squared(&self) -> f64 {
        self.residuals.iter().map(|r| r * r).sum()
    }

    /// Correlation of two parameters.
    #[must_use]
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        self.covariance[(a, b)] / (self.sigma(a) * self.sigma(b))
    }

    /// This estimate with the covariance of residuals that belong together in runs of `cluster`.
    #[must_use]
    pub fn clustered(mut self, cluster: usize) -> Self {
        let (rows, columns) = self.jacobian.shape();
        let mut scores = DMatrix::zeros(columns, columns);
        for from in (0..rows).step_by(cluster.max(1)) {
            let n = cluster.min(rows - from);
            let r = DVector::from_column_slice(&self.residuals[from..from + n]);
            let score = self.jacobian.rows(from, n).transpose() * r;
            scores += &score * score.transpose();
        }
        self.covariance = &self.covariance * scores * &self.covariance;
        self
    }
}

/// Inverse of a positive definite matrix whose rows differ by many orders of magnitude.
fn scaled_inverse(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let size: Vec<f64> = a.diagonal().iter().map(|d| d.max(1e-300).sqrt()).collect();
    let (n, m) = a.shape();
    let scaled = DMatrix::from_fn(n, m, |i, j| a[(i, j)] / (size[i] * size[j]));
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(n, m, |i, j| inverse[(i, j)] / (size[i] * size[j])))
}

/// Fits the parameters; `None` if residuals are not finite at the start or carry no information.
#[must_use]
pub fn least_squares(
    parameters: &[Parameter],
    residuals: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<Estimate> {
    let n = parameters.len();
    let mut p: Vec<f64> = parameters.iter().map(|p| p.start).collect();
    let prior = |p: &[f64], i: usize| -> f64 {
        parameters[i].prior_sigma.map_or(0.0, |s| (p[i] - parameters[i].start) / s)
    };
    let cost = |p: &[f64], r: &[f64]| -> f64 {
        r.iter().map(|r| r * r).sum::<f64>() + (0..n).map(|i| prior(p, i).powi(2)).sum::<f64>()
    };
    let mut r = residuals(&p);
    let mut best = cost(&p, &r);
    if !best.is_finite() {
        return None;
    }
    let mut damping = 1e-3;
    let mut jacobian = DMatrix::zeros(r.len(), n);
    let mut information = DMatrix::zeros(n, n);
    for _ in 0..ITERATIONS {
        for i in 0..n {
            let h = 1e-4 * parameters[i].scale;
            let moved = |sign: f64| {
                let mut q = p.clone();
                q[i] += sign * h;
                residuals(&q)
            };
            for (k, (a, b)) in moved(1.0).iter().zip(moved(-1.0)).enumerate() {
                jacobian[(k, i)] = (a - b) / (2.0 * h);
            }
        }
        if jacobian.iter().any(|j: &f64| !j.is_finite()) {
            return None;
        }
        information = jacobian.transpose() * &jacobian;
        let mut gradient = jacobian.transpose() * DVector::from_column_slice(&r);
        for i in 0..n {
            if let Some(s) = parameters[i].prior_sigma {
                information[(i, i)] += 1.0 / (s * s);
                gradient[i] += prior(&p, i) / s;
            }
        }
        let mut moved = false;
        // From the least damping to steps of nothing.
        for _ in 0..30 {
            let mut damped = information.clone();
            for i in 0..n {
                damped[(i, i)] *= 1.0 + damping;
            }
            let step = scaled_inverse(&damped)? * &gradient;
            let q: Vec<f64> = p.iter().zip(step.iter()).map(|(p, s)| p - s).collect();
            let trial = residuals(&q);
            let c = cost(&q, &trial);
            if c < best {
                moved = best - c > 1e-10 * best;
                (p, r, best) = (q, trial, c);
                damping = (0.2 * damping).max(1e-7);
                break;
            }
            damping *= 5.0;
        }
        if !moved {
            break;
        }
    }
    let covariance = scaled_inverse(&information)?;
    Some(Estimate { value: p, covariance, residuals: r, jacobian })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_the_covariance_of_the_textbook() {
        let x: Vec<f64> = (0..50).map(f64::from).collect();
        let fit = least_squares(&[Parameter::free(0.0, 1.0), Parameter::free(0.0, 1.0)], |p| {
            x.iter().map(|x| (p[0] + p[1] * x - 3.0 - 0.5 * x) / 0.2).collect()
        })
        .unwrap();
        assert!((fit.value[0] - 3.0).abs() < 1e-6 && (fit.value[1] - 0.5).abs() < 1e-6);
        let sxx: f64 = x.iter().map(|x| (x - 24.5) * (x - 24.5)).sum();
        assert!((fit.sigma(1) / (0.2 / sxx.sqrt()) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_the_data_do_not_say_keeps_its_prior() {
        let known = Parameter::known(2.0, 0.3);
        let fit = least_squares(&[Parameter::free(1.0, 1.0), known], |p| {
            vec![(p[0] * p[1] - 6.0) / 1e-3]
        })
        .unwrap();
        assert!((fit.value[0] - 3.0).abs() < 1e-3 && (fit.value[1] - 2.0).abs() < 1e-6);
        assert!((fit.sigma(1) - 0.3).abs() < 1e-3 && (fit.sigma(0) - 0.45).abs() < 5e-3);
    }

    #[test]
    fn residuals_that_repeat_do_not_narrow_the_clustered_interval() {
        let noise = [0.3, -0.8, 1.1, -0.2, 0.7, -1.3, 0.5, -0.4, 1.6, -1.5];
        let sigma = |repeat: usize| {
            let fit = least_squares(&[Parameter::free(0.0, 1.0)], |p| {
                noise.iter().flat_map(|e| core::iter::repeat_n(p[0] - e, repeat)).collect()
            });
            fit.unwrap().clustered(repeat).sigma(0)
        };
        assert!((sigma(1) - sigma(40)).abs() < 1e-6);
    }
}
