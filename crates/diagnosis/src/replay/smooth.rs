//! Inputs of the replay without the noise of their messages.
//!
//! What is driven through a free play or through a lag that differs between rise and fall must not
//! jitter: the jitter is rectified, and the fit takes it for a larger play or a shorter lag (errors
//! in variables). Both filters are symmetric in time and leave straight lines alone.

/// Samples on either side for the engine speed, which the vehicle's mass carries in gear: less than
/// the margin around shifts.
pub(super) const CRANK: usize = 10;

/// Samples on either side for the coolant: a switch between two thresholds tells tenths of the
/// message's kelvin.
pub(super) const COOLANT: usize = 100;

/// Samples on either side for the hand wheel.
const WHEEL: usize = 4;

/// Centred mean over `side` samples on either side, over fewer near the ends.
pub(super) fn running_mean(x: &[f64], side: usize) -> Vec<f64> {
    let sums = super::prepared::running_sum(x.iter().copied());
    let n = x.len();
    (0..n)
        .map(|i| {
            let side = side.min(i).min(n - 1 - i);
            (sums[i + side + 1] - sums[i - side]) / (2 * side + 1) as f64
        })
        .collect()
}

/// Local parabola through [`WHEEL`] samples on either side (Savitzky and Golay, Analytical
/// Chemistry 36, 1964); the ends keep their samples.
pub(super) fn quadratic(x: &[f64]) -> Vec<f64> {
    let m = WHEEL as f64;
    let weights: Vec<f64> = (0..=WHEEL)
        .map(|k| {
            let k = k as f64;
            3.0 * (3.0 * m * m + 3.0 * m - 1.0 - 5.0 * k * k)
                / ((2.0 * m + 3.0) * (2.0 * m + 1.0) * (2.0 * m - 1.0))
        })
        .collect();
    let mut out = x.to_vec();
    for (y, window) in out.iter_mut().skip(WHEEL).zip(x.windows(2 * WHEEL + 1)) {
        *y = weights[0] * window[WHEEL]
            + (1..=WHEEL)
                .map(|k| weights[k] * (window[WHEEL - k] + window[WHEEL + k]))
                .sum::<f64>();
    }
    out
}

/// A record between its samples, by cubic B-splines: exact for straight lines, and with the same noise
/// wherever it is read. A straight line between two noisy samples has half their noise in the middle,
/// which a fit takes for the delay at which the records agree. (Unser, IEEE Signal Processing Magazine
/// 16(6), 1999; the samples themselves as coefficients.)
pub(super) fn calm_at(x: &[f64], index: f64) -> f64 {
    let last = x.len() - 1;
    let index = index.clamp(0.0, last as f64);
    let (i, b) = (index as usize, index.fract());
    let weights = [
        (1.0 - b).powi(3),
        3.0 * b.powi(3) - 6.0 * b * b + 4.0,
        1.0 + 3.0 * b * (1.0 + b - b * b),
        b.powi(3),
    ];
    let sample = |k: isize| x[k.clamp(0, last as isize) as usize];
    weights.iter().zip(-1..).map(|(w, k)| w * sample(i as isize + k)).sum::<f64>() / 6.0
}

/// Part of what there is of a signal by which it jumps within a second, which neighbours do not tell.
pub(crate) const JUMP_FRAC: f64 = 0.06;

/// What the two rows on either side say of row `k`, exact for cubics: without the noise that the row
/// itself has. Nothing at the ends, and where the three rows on either side, the third for what
/// [`calm_at`] spreads, differ by more than `jump`.
///
/// A model that reads a noisy message is off by that noise. What multiplies the model, or follows the
/// message, would be fitted to damp it, were it taken from the same row: next to a pedal that tells the
/// torque without noise, five percent of the fuel, certain by 160 nats, in drives that are in order. A
/// neighbour's noise is its own (instrumental variables; Fuller, Measurement Error Models, 1.4).
pub(super) fn beside(rows: &[f64], k: usize, jump: f64) -> Option<f64> {
    let (before, after) = (rows.get(k.checked_sub(3)?..k)?, rows.get(k + 1..k + 4)?);
    let around = || before.iter().chain(after);
    let most = around().fold(f64::NEG_INFINITY, |a, x| a.max(*x));
    let least = around().fold(f64::INFINITY, |a, x| a.min(*x));
    let inner = 4.0 * (before[2] + after[0]);
    (most - least <= jump).then(|| (inner - before[1] - after[1]) / 6.0)
}

/// All rows by those beside, where these tell them.
pub(crate) fn by_neighbours(rows: &[f64], jump: f64) -> Vec<f64> {
    let told = |(k, own): (usize, &f64)| beside(rows, k, jump).unwrap_or(*own);
    rows.iter().enumerate().map(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_stay_and_noise_halves() {
        let line: Vec<f64> = (0..200).map(|i| 0.3 + 0.02 * f64::from(i)).collect();
        for smoothed in [quadratic(&line), running_mean(&line, CRANK)] {
            assert!(smoothed.iter().zip(&line).all(|(x, y)| (x - y).abs() < 1e-9));
        }
        // Alternating neighbours are the fastest jitter there is.
        let jitter: Vec<f64> = (0..200).map(|i| if i % 3 == 0 { 1.0 } else { -0.5 }).collect();
        let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
        assert!(rms(&quadratic(&jitter)[WHEEL..200 - WHEEL]) < 0.5 * rms(&jitter));
        assert!(rms(&running_mean(&jitter, CRANK)[CRANK..200 - CRANK]) < 0.1 * rms(&jitter));
    }

    #[test]
    fn a_row_by_its_neighbours_is_exact_for_cubics_and_lacks_its_own_noise() {
        let cubic = |k: i32| f64::from(k).powi(3) - 7.0 * f64::from(k).powi(2) + 3.0;
        let mut rows: Vec<f64> = (0..20).map(cubic).collect();
        rows[9] += 5.0;
        for k in [9, 12] {
            let told = beside(&rows, k, f64::INFINITY).unwrap();
            assert!((told - cubic(k as i32)).abs() < 1e-9);
        }
        assert_eq!([2, 17].map(|k| beside(&rows, k, f64::INFINITY)), [None; 2]);
        assert_eq!(beside(&rows, 9, 1.0), None);
        assert_eq!(by_neighbours(&rows, 1.0)[9], rows[9]);
    }

    #[test]
    fn rows_between_samples_have_the_noise_of_rows_at_them() {
        let line: Vec<f64> = (0..40).map(|i| 2.0 + 0.5 * f64::from(i)).collect();
        let power = |b: f64| -> f64 {
            (0..40)
                .map(|j| {
                    let one: Vec<f64> = (0..40).map(|i| if i == j { 1.0 } else { 0.0 }).collect();
                    (20..24).map(|i| calm_at(&one, f64::from(i) - b)).sum::<f64>().powi(2)
                })
                .sum()
        };
        for tenth in 0..10 {
            let b = 0.1 * f64::from(tenth);
            assert!((calm_at(&line, 20.0 + b) - (12.0 + 0.5 * b)).abs() < 1e-12);
            assert!((power(b) / power(0.0) - 1.0).abs() < 0.01, "{b}: {}", power(b));
        }
        assert!((calm_at(&line, -3.0) - 2.0).abs() < 0.1 && calm_at(&[7.0], 5.0) == 7.0);
    }

    #[test]
    fn a_short_record_is_left_alone() {
        assert_eq!(quadratic(&[1.0, 5.0, 2.0]), [1.0, 5.0, 2.0]);
        assert_eq!(beside(&[1.0, 5.0, 2.0], 2, f64::INFINITY), None);
        assert_eq!(running_mean(&[], CRANK), Vec::<f64>::new());
    }
}
