//! How far two empirical distributions lie apart.
//!
//! Kolmogorov-Smirnov: `sup |F - G|`, dimensionless. Wasserstein-1: `∫ |F - G| dx`, in the unit of
//! the samples (the mean distance that the samples have to be moved). F, G are the empirical
//! distribution functions; sizes may differ.

use std::borrow::Cow;

use serde::Serialize;

/// Both distribution functions as steps over all sample values: calls `see(x, next_x, |F - G|)`.
fn walk(a: &[f64], b: &[f64], mut see: impl FnMut(f64, f64, f64)) {
    fn sorted(values: &[f64]) -> Cow<'_, [f64]> {
        if values.is_sorted() {
            return Cow::Borrowed(values);
        }
        let mut values = values.to_vec();
        values.sort_unstable_by(f64::total_cmp);
        Cow::Owned(values)
    }
    let (a, b) = (sorted(a), sorted(b));
    let (mut i, mut j) = (0, 0);
    loop {
        let x = match (a.get(i), b.get(j)) {
            (Some(&p), Some(&q)) => p.min(q),
            (Some(&p), None) => p,
            (None, Some(&q)) => q,
            (None, None) => return,
        };
        while a.get(i).is_some_and(|&p| p <= x) {
            i += 1;
        }
        while b.get(j).is_some_and(|&q| q <= x) {
            j += 1;
        }
        let next = a
            .get(i)
            .copied()
            .into_iter()
            .chain(b.get(j).copied())
            .fold(x, |n, y| if n == x { y } else { n.min(y) });
        let apart = i as f64 / a.len() as f64 - j as f64 / b.len() as f64;
        see(x, next, libm::fabs(apart));
    }
}

/// The Kolmogorov-Smirnov distance, 0 to 1; `None` if a set is empty.
#[must_use]
pub fn kolmogorov_smirnov(a: &[f64], b: &[f64]) -> Option<f64> {
    let mut most = 0.0f64;
    walk(a, b, |_, _, apart| most = most.max(apart));
    (!a.is_empty() && !b.is_empty()).then_some(most)
}

/// What the Kolmogorov-Smirnov distance of two sets of independent samples of *one* distribution
/// stays below in 95 % of cases: `1.358 sqrt((n + m) / (n m))`, at most 1 (Smirnov 1948). A distance
/// below it says nothing. 1 for an empty set.
#[must_use]
pub fn kolmogorov_smirnov_by_chance(n: usize, m: usize) -> f64 {
    let (n, m) = (n as f64, m as f64);
    (1.358 * libm::sqrt((n + m) / (n * m))).min(1.0)
}

/// The Wasserstein-1 distance in the unit of the samples; `None` if a set is empty.
#[must_use]
pub fn wasserstein(a: &[f64], b: &[f64]) -> Option<f64> {
    let mut sum = 0.0;
    walk(a, b, |x, next, apart| sum += apart * (next - x));
    (!a.is_empty() && !b.is_empty()).then_some(sum)
}

/// A set of samples in a few numbers, in the unit of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Moments {
    /// Number of samples.
    pub samples: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// 5 % of the samples are below.
    pub p05: f64,
    /// A quarter of the samples is below.
    pub p25: f64,
    /// The median.
    pub p50: f64,
    /// Three quarters of the samples are below.
    pub p75: f64,
    /// 95 % of the samples are below.
    pub p95: f64,
}

/// Moments and quantiles; `None` if there are no samples.
#[must_use]
pub fn moments(values: &[f64]) -> Option<Moments> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let at = |q: f64| sorted.get((q * (n - 1.0)) as usize).copied();
    let mean = sorted.iter().sum::<f64>() / n;
    let variance = sorted.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
    Some(Moments {
        samples: sorted.len(),
        mean,
        sigma: libm::sqrt(variance),
        p05: at(0.05)?,
        p25: at(0.25)?,
        p50: at(0.5)?,
        p75: at(0.75)?,
        p95: at(0.95)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_one_distribution_differ_by_more_than_chance_in_one_case_of_twenty() {
        let draws = |trial: u64, first: u32, n: u32| -> Vec<f64> {
            let d = crate::philox::Draws::new(trial, crate::philox::Stream::Search, 0);
            (first..first + n).map(|k| d.uniform(k)).collect()
        };
        let (n, m, trials) = (40u32, 60u32, 2000);
        let bound = kolmogorov_smirnov_by_chance(n as usize, m as usize);
        let above = (0..trials)
            .filter(|&t| kolmogorov_smirnov(&draws(t, 0, n), &draws(t, n, m)).unwrap() > bound)
            .count();
        let part = above as f64 / trials as f64;
        assert!((0.02..0.06).contains(&part), "{part}");
    }

    fn grid(n: usize, from: f64, to: f64) -> Vec<f64> {
        (0..n).map(|k| from + (to - from) * (k as f64 + 0.5) / n as f64).collect()
    }

    #[test]
    fn equal_sets_are_nowhere_apart_and_separate_ones_entirely() {
        let a = grid(50, 0.0, 1.0);
        assert_eq!(kolmogorov_smirnov(&a, &a), Some(0.0));
        assert_eq!(wasserstein(&a, &a), Some(0.0));
        let b: Vec<f64> = a.iter().map(|x| x + 10.0).collect();
        assert_eq!(kolmogorov_smirnov(&a, &b), Some(1.0));
        assert!((wasserstein(&a, &b).unwrap() - 10.0).abs() < 1e-9, "a shift costs its length");
        assert_eq!(kolmogorov_smirnov(&a, &[]), None);
    }

    #[test]
    fn uniform_distributions_have_their_closed_form_distances() {
        // U(0,1) against U(0,2): sup |x - x/2| at x = 1; integral of x/2 and of 1 - x/2.
        let (a, b) = (grid(1000, 0.0, 1.0), grid(3000, 0.0, 2.0));
        assert!((kolmogorov_smirnov(&a, &b).unwrap() - 0.5).abs() < 2e-3);
        assert!((wasserstein(&a, &b).unwrap() - 0.5).abs() < 2e-3);
    }

    #[test]
    fn ties_count_once() {
        // F jumps by 2/3 at 1, G by 1/3: 1/3 apart, over a width of 1.
        let (a, b) = ([1.0, 1.0, 2.0], [1.0, 2.0, 2.0]);
        assert!((kolmogorov_smirnov(&a, &b).unwrap() - 1.0 / 3.0).abs() < 1e-12);
        assert!((wasserstein(&a, &b).unwrap() - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn moments_of_a_ramp() {
        let m = moments(&grid(1001, 0.0, 1.0)).unwrap();
        assert!((m.mean - 0.5).abs() < 1e-12 && (m.p50 - 0.5).abs() < 1e-12);
        assert!((m.sigma - 1.0 / 12f64.sqrt()).abs() < 1e-5 && (m.p95 - 0.95).abs() < 2e-3);
        assert_eq!(moments(&[]), None);
    }
}
