//! Means and scatter of the tolerances between drives that are in order, and how well the means are known.

use nalgebra::{DMatrix, DVector};

use super::{Problem, nuisance_directions};
use crate::DiagnosisError;
use crate::causes::param::{P, PARAMS, Spec, Theta};
use crate::search::decisions::{MEAN_PRIOR, SCATTER_PRIOR};

const SCATTER_ROUNDS: usize = 25;

/// Factor of the covariance of means whose errors have nothing to do with each other: `spread` of each,
/// in the scatter between drives.
pub(super) fn means_apart(tolerance: &[f64; PARAMS], spread: impl Fn(P) -> f64) -> DMatrix<f64> {
    let of = nuisance_directions(tolerance).into_iter().map(|d| spread(d.p)).collect();
    DMatrix::from_diagonal(&DVector::from_vec(of))
}

/// What drives in order say about the means of their tolerances.
struct Means {
    /// Most probable means.
    mean: DVector<f64>,
    /// Information about them, their prior included.
    information: DMatrix<f64>,
    /// Posterior covariance of the tolerances of every drive were the means known.
    spreads: Vec<DMatrix<f64>>,
}

impl Means {
    /// From the information and the gradient of every drive about its tolerances, their `variance`
    /// between drives, and the precision `prior` of their means, which stands at `-before`: means are
    /// counted from where they were moved to, their prior stays where they began. Errors of the means
    /// go together where what the drives show does, as rolling resistance and drag do: a drive leaves
    /// `V^-1 - V^-1 (A + V^-1)^-1 V^-1` of information once its own tolerances are integrated out.
    fn of(
        systems: &[(DMatrix<f64>, DVector<f64>)],
        variance: &[f64],
        prior: &[f64],
        before: &[f64],
    ) -> Option<Self> {
        let q = variance.len();
        let mut information = DMatrix::from_fn(q, q, |a, b| if a == b { prior[a] } else { 0.0 });
        let mut gradient = DVector::from_fn(q, |a, _| -prior[a] * before[a]);
        let mut spreads = Vec::with_capacity(systems.len());
        for (a, b) in systems {
            let mut a = a.clone();
            for (j, v) in variance.iter().enumerate() {
                a[(j, j)] += 1.0 / v;
            }
            let spread = a.cholesky()?.inverse();
            let own = &spread * b;
            for (j, v) in variance.iter().enumerate() {
                gradient[j] += own[j] / v;
                information[(j, j)] += 1.0 / v;
                for (k, w) in variance.iter().enumerate() {
                    information[(j, k)] -= spread[(j, k)] / (v * w);
                }
            }
            spreads.push(spread);
        }
        let mean = information.clone().cholesky()?.solve(&gradient);
        Some(Self { mean, information, spreads })
    }

    /// Factor of their covariance, in the scatter between drives.
    fn factor(&self, variance: &[f64]) -> Option<DMatrix<f64>> {
        let q = variance.len();
        let scaled =
            |a: usize, b: usize| self.information[(a, b)] * (variance[a] * variance[b]).sqrt();
        let covariance = DMatrix::from_fn(q, q, scaled).cholesky()?.inverse();
        Some(covariance.cholesky()?.unpack())
    }
}

impl Problem<'_> {
    /// Mean and scatter of every tolerance between the drives by expectation-maximisation, with
    /// [`SCATTER_PRIOR`] drives' worth of the scatter that is expected and a prior for the mean. The
    /// mean is what this truck and its weather are like when all is well (a crosswind of any sign
    /// adds drag): causes count from there. `moved` is how far means have been moved before; the prior
    /// stands where they began. Returns the factor of the covariance of the means, in the scatter
    /// between drives.
    pub(super) fn scatter(&mut self, moved: &mut Theta) -> Result<DMatrix<f64>, DiagnosisError> {
        let specs: Vec<&Spec> =
            nuisance_directions(&self.reference.tolerance).iter().map(|d| d.p.spec()).collect();
        let systems: Vec<(DMatrix<f64>, DVector<f64>)> = (0..self.drives.len())
            .map(|i| {
                let n = &self.nuisance[i];
                (n.scaled(), self.against(i, &n.base))
            })
            .collect();
        let count = self.drives.len() as f64;
        // Means and variances in units of what the columns are scaled with.
        let unit = |s: &Spec| self.reference.tolerance[s.p as usize];
        let expected: Vec<f64> = specs.iter().map(|s| (s.scatter() / unit(s)).powi(2)).collect();
        let prior: Vec<f64> =
            expected.iter().map(|e| (MEAN_PRIOR * MEAN_PRIOR * e).recip()).collect();
        let before: Vec<f64> = specs.iter().map(|s| moved[s.p as usize] / unit(s)).collect();
        let means = |variance: &[f64]| {
            Means::of(&systems, variance, &prior, &before)
                .ok_or_else(|| DiagnosisError::Numerics("means of the tolerances".into()))
        };
        let mut variance = vec![1.0; specs.len()];
        for _ in 0..SCATTER_ROUNDS {
            let means = means(&variance)?;
            let mut second = vec![0.0; specs.len()];
            for (spread, (_, b)) in means.spreads.iter().zip(&systems) {
                let weighed = means.mean.iter().zip(&variance).map(|(m, v)| m / v);
                let z = spread * (b + DVector::from_iterator(specs.len(), weighed));
                for (j, s) in second.iter_mut().enumerate() {
                    *s += (z[j] - means.mean[j]).powi(2) + spread[(j, j)];
                }
            }
            for (j, (v, s)) in variance.iter_mut().zip(&specs).enumerate() {
                if s.p == P::BrakeLoad {
                    // weighed anew on every trip, loads that no drive in order had among them
                    continue;
                }
                let bound = match s.p {
                    P::TurboLag | P::PedalDelay | P::TorqueReport => 2.0,
                    _ => 10.0,
                };
                *v = ((SCATTER_PRIOR * expected[j] + second[j]) / (SCATTER_PRIOR + count))
                    .min(bound * bound * expected[j]);
            }
        }
        let means = means(&variance)?;
        let factor = means.factor(&variance).ok_or_else(|| {
            DiagnosisError::Numerics("covariance of the tolerances' means".into())
        })?;
        for (j, (v, s)) in variance.iter().zip(&specs).enumerate() {
            let i = s.p as usize;
            let x = &mut self.reference.theta[i];
            let before = *x;
            *x = (*x + means.mean[j] * self.reference.tolerance[i]).clamp(s.lo, s.hi);
            moved[i] += *x - before;
            self.reference.tolerance[i] *= v.sqrt();
        }
        Ok(factor)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::Means;

    /// Each pass drew the mean towards where the one before had left it, so that the prior was
    /// forgotten: a baseline that was 2.7 % low in friction was learned as 3.4 %, and trucks in order
    /// had 5 to 7 % more of it.
    #[test]
    fn a_mean_that_was_moved_once_is_not_moved_again() {
        let values = [-1.4, -0.1, -3.3, -2.9];
        let known = 1e9;
        let systems = |from: f64| -> Vec<_> {
            let gradient = |x: &f64| DVector::from_element(1, known * (x - from));
            values.iter().map(|x| (DMatrix::from_element(1, 1, known), gradient(x))).collect()
        };
        let first = Means::of(&systems(0.0), &[1.0], &[2.4], &[0.0]).unwrap();
        assert!((first.mean[0] - values.iter().sum::<f64>() / 6.4).abs() < 1e-6);
        let factor = first.factor(&[1.0]).unwrap();
        assert!((factor[(0, 0)] - 6.4_f64.sqrt().recip()).abs() < 1e-6);
        let from = first.mean[0];
        let second = Means::of(&systems(from), &[1.0], &[2.4], &[from]).unwrap();
        assert!(second.mean[0].abs() < 1e-6, "{}", second.mean[0]);
    }

    /// Known each as well as its drives say for itself, rolling resistance and drag of a baseline were
    /// both as good as unknown, and a truck with 15 % more of one lost a quarter of its evidence: what
    /// the drives show is their sum, and that they know.
    #[test]
    fn means_that_show_as_a_sum_are_known_as_a_sum() {
        let systems = vec![(DMatrix::from_element(2, 2, 1e6), DVector::from_element(2, 1e6)); 8];
        let means = Means::of(&systems, &[1.0; 2], &[2.0; 2], &[0.0; 2]).unwrap();
        let factor = means.factor(&[1.0; 2]).unwrap();
        let covariance = &factor * factor.transpose();
        let along = |x: f64, y: f64| {
            let d = DVector::from_vec(vec![x, y]);
            (d.transpose() * &covariance * &d)[(0, 0)]
        };
        // Scatter 2 of a sum over 8 drives beside the prior of 1; of the difference the prior alone
        assert!((along(1.0, 1.0) - 1.0 / (8.0 / 2.0 + 1.0)).abs() < 1e-3, "{covariance}");
        assert!((along(1.0, -1.0) - 1.0).abs() < 1e-3, "{covariance}");
        assert!((means.mean[0] - 0.4).abs() < 1e-3, "{}", means.mean[0]);
    }
}
