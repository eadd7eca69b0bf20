//! Autoregressive whitening of residuals with masked rows.
//!
//! The filter is fitted by Levinson-Durbin on the pooled autocovariance of valid pairs and applied
//! alike to residuals and sensitivities, masked rows counting as zero: generalised least squares
//! with an AR noise model, and with slow noise beside it ([`super::slow`]) where that was fitted.

use super::slow::{Slow, SlowFilter, State};

/// Rows of a record.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows<'a> {
    /// Whether each is valid.
    pub(crate) ok: &'a [bool],
    /// Signal on which slow noise is a factor; nothing where it is added.
    pub(crate) carrier: Option<&'a [f64]>,
}

/// An AR filter and the standard deviation of its innovation.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Whitener {
    pub(crate) coefficients: Vec<f64>,
    pub(crate) sigma: f64,
    /// Noise that remembers longer than the coefficients reach.
    pub(crate) slow: Option<Slow>,
}

impl Whitener {
    /// Unit filter.
    pub(crate) fn white(sigma: f64) -> Self {
        Self { coefficients: Vec::new(), sigma, slow: None }
    }

    /// Fits order `order` to several records; `None` without valid rows.
    pub(crate) fn fit<'a>(
        records: impl Iterator<Item = (&'a [f64], &'a [bool])> + Clone,
        order: usize,
    ) -> Option<Self> {
        let mut covariance = Vec::with_capacity(order + 1);
        for lag in 0..=order {
            let (mut sum, mut count) = (0.0, 0.0);
            for (x, ok) in records.clone() {
                for i in lag..x.len().min(ok.len()) {
                    if ok[i] && ok[i - lag] {
                        sum += x[i] * x[i - lag];
                        count += 1.0;
                    }
                }
            }
            if count < 8.0 {
                break;
            }
            // Slight taper keeps the sequence positive definite with gaps.
            covariance.push(sum / count * if lag == 0 { 1.0 + 1e-6 } else { 1.0 });
        }
        let zero = *covariance.first()?;
        if zero <= 0.0 || !zero.is_finite() {
            return Some(Self::white(1e-12));
        }
        let (mut a, mut error): (Vec<f64>, f64) = (Vec::new(), zero);
        for m in 1..covariance.len() {
            let acc: f64 = covariance[m]
                - a.iter().enumerate().map(|(j, c)| c * covariance[m - 1 - j]).sum::<f64>();
            let k = (acc / error).clamp(-0.999, 0.999);
            let old = a.clone();
            for (j, c) in a.iter_mut().enumerate() {
                *c -= k * old[m - 2 - j];
            }
            a.push(k);
            error *= 1.0 - k * k;
        }
        let mut out = Self { coefficients: a, sigma: 1.0, slow: None };
        let (mut sum, mut count) = (0.0, 0.0);
        for (x, ok) in records {
            for (w, ok) in out.apply(x, ok).iter().zip(ok) {
                if *ok {
                    sum += w * w;
                    count += 1.0;
                }
            }
        }
        out.sigma = (sum / f64::max(count, 1.0)).sqrt().max(1e-12);
        Some(out)
    }

    /// Whitened record, zero where masked, with slow noise over its rows.
    pub(crate) fn whiten(&self, x: &[f64], ok: &[bool], slow: Option<&SlowFilter>) -> Vec<f64> {
        let mut out = self.apply(x, ok);
        if let Some(slow) = slow {
            slow.apply(&mut out, 0, &mut State::default());
        }
        out
    }

    /// Slow noise over the rows of a record.
    pub(crate) fn over(&self, rows: Rows<'_>) -> Option<SlowFilter> {
        self.slow.as_ref().map(|slow| slow.over(self.weights(rows)))
    }

    /// How much slow noise of one shows in every row that the coefficients have whitened.
    pub(crate) fn weights(&self, rows: Rows<'_>) -> Vec<f64> {
        let one = |ok: &bool| if *ok { 1.0 } else { 0.0 };
        rows.carrier.map_or_else(
            || rows.ok.iter().map(one).collect(),
            |x| {
                let shown: Vec<f64> = x.iter().zip(rows.ok).map(|(x, ok)| x * one(ok)).collect();
                self.apply(&shown, rows.ok)
            },
        )
    }

    /// The record through the coefficients alone.
    pub(crate) fn apply(&self, x: &[f64], ok: &[bool]) -> Vec<f64> {
        let n = x.len().min(ok.len());
        let mut out = x[..n].to_vec();
        for (lag, a) in self.coefficients.iter().enumerate() {
            let from = (lag + 1).min(n);
            for (y, x) in out[from..].iter_mut().zip(x) {
                *y -= a * x;
            }
        }
        let scale = 1.0 / self.sigma;
        for (y, ok) in out.iter_mut().zip(ok) {
            *y = if *ok { *y * scale } else { 0.0 };
        }
        out
    }

    /// A whitened record through the adjoint of the filter: its product with any record that is
    /// zero where masked is that of the whitened ones. `x` is zero where masked.
    pub(crate) fn adjoint(&self, mut x: Vec<f64>, slow: Option<&SlowFilter>) -> Vec<f64> {
        let scale = 1.0 / self.sigma;
        if let Some(slow) = slow {
            slow.adjoint(&mut x);
        }
        let mut out = x.clone();
        for (lag, a) in self.coefficients.iter().enumerate() {
            for (y, x) in out.iter_mut().zip(x.iter().skip(lag + 1)) {
                *y -= a * x;
            }
        }
        out.iter_mut().for_each(|y| *y *= scale);
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn an_ar2_record_is_whitened_to_unit_variance_although_rows_are_missing() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut x = vec![0.0; 20_000];
        for i in 2..x.len() {
            let e: f64 = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            x[i] = 1.2 * x[i - 1] - 0.5 * x[i - 2] + 0.3 * e;
        }
        let ok: Vec<bool> = (0..x.len()).map(|i| i % 700 > 40).collect();
        let w = Whitener::fit([(x.as_slice(), ok.as_slice())].into_iter(), 6).unwrap();
        assert!((w.coefficients[0] - 1.2).abs() < 0.05 && (w.coefficients[1] + 0.5).abs() < 0.08);
        assert!((w.sigma - 0.3).abs() < 0.02, "{}", w.sigma);
        let y = w.apply(&x, &ok);
        let lag1: f64 = y.windows(2).map(|p| p[0] * p[1]).sum::<f64>() / y.len() as f64;
        assert!(lag1.abs() < 0.03, "{lag1}");
    }
}
