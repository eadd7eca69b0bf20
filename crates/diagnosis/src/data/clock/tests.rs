//! Lags that were put in are found, with intervals that hold.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const STEP_S: f64 = 0.05;

/// Sums of twelve uniform numbers: normal enough, no tables.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// Speed of a drive as sums of slow waves whose phases and periods are drawn.
fn drive(rng: &mut ChaCha8Rng) -> impl Fn(f64) -> f64 + use<> {
    let waves: Vec<[f64; 3]> = (0..25)
        .map(|_| {
            let period = 12.0 + 90.0 * rng.random::<f64>();
            [0.02 * period * normal(rng), std::f64::consts::TAU / period, 6.0 * rng.random::<f64>()]
        })
        .collect();
    move |t| 18.0 + waves.iter().map(|[a, w, p]| a * (w * t + p).sin()).sum::<f64>()
}

/// Two channels of one drive, x late by `lag(t)`, both noisy and quantised.
fn pair(seed: u64, duration_s: f64, lag: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let v = drive(&mut rng);
    noisy(&mut rng, [0.05, 0.03], duration_s, v, lag)
}

/// The same of a speed that is given, with this noise of both, m/s.
fn noisy(
    rng: &mut ChaCha8Rng,
    sigma_m_s: [f64; 2],
    duration_s: f64,
    v: impl Fn(f64) -> f64,
    lag: impl Fn(f64) -> f64,
) -> (Vec<f64>, Vec<f64>) {
    let n = (duration_s / STEP_S) as usize;
    let mut noisy = |value: f64, sigma: f64, quantum: f64| {
        ((value + sigma * normal(rng)) / quantum).round() * quantum
    };
    let x = (0..n)
        .map(|i| i as f64 * STEP_S)
        .map(|t| noisy(v(t - lag(t)), sigma_m_s[0], 0.01))
        .collect();
    let y = (0..n).map(|i| noisy(v(i as f64 * STEP_S), sigma_m_s[1], 1.0 / 256.0)).collect();
    (x, y)
}

fn tracked(x: &[f64], y: &[f64]) -> Option<ClockTrack> {
    let signal = |samples| Signal { samples, kind: Kind::Value };
    track(&Rates::new(signal(x), signal(y), STEP_S))
}

#[test]
fn offset_and_drift_lie_within_their_intervals_as_often_as_these_say() {
    let (mut offsets, mut drifts) = (0, 0);
    for seed in 0..30 {
        let (offset, drift) = (-4.0 + 0.31 * seed as f64, 2e-4 * (seed as f64 - 15.0));
        let (x, y) = pair(seed, 900.0, |t| offset + drift * (t - 450.0));
        let track = tracked(&x, &y).unwrap();
        assert_eq!(track.stretches.len(), 1, "seed {seed}: {track:?}");
        let s = track.stretches[0];
        assert!((s.lag_s - offset).abs() < 4.5 * s.lag_sigma_s, "seed {seed}: {s:?}");
        offsets += usize::from((s.lag_s - offset).abs() < 2.0 * s.lag_sigma_s);
        drifts += usize::from((s.drift_s_s - drift).abs() < 2.0 * s.drift_sigma_s_s);
    }
    assert!(offsets >= 25 && drifts >= 25, "{offsets} and {drifts} of 30 within two sigma");
}

/// A truck under cruise control on a flat road with one hill: its clock was seconds off at the start and
/// late at the end, each by several standard deviations, from the noise of steady speeds.
#[test]
fn steady_speeds_say_little_of_a_clock() {
    let mut drifts = 0;
    for seed in 60..160 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let hill_s = 150.0 + 450.0 * rng.random::<f64>();
        let v = |t: f64| 22.0 - 3.0 * (-((t - hill_s) / 20.0).powi(2)).exp();
        let (x, y) = noisy(&mut rng, [0.032, 0.01], 750.0, v, |_| 0.0);
        let Some(track) = tracked(&x, &y) else { continue };
        let drifting = |s: &ClockStretch| {
            let over_s = s.to_s - s.from_s;
            s.drift_s_s.abs() * over_s > 0.25_f64.max(CERTAIN * s.drift_sigma_s_s * over_s)
        };
        drifts += usize::from(track.stretches.iter().any(drifting));
    }
    // 29, and 44 where steady speeds are fitted as well: one hill is too short a lever for a line.
    assert!(drifts < 35, "{drifts} of 100 drift");
}

#[test]
fn a_clock_that_jumps_is_found_with_the_time_and_size_of_the_jump() {
    for seed in 40..46 {
        let at = 500.0 + 60.0 * (seed - 40) as f64;
        let (x, y) = pair(seed, 1400.0, |t| if t < at { 5.0 } else { 9.0 });
        let track = tracked(&x, &y).unwrap();
        assert_eq!(track.stretches.len(), 2, "seed {seed}: {track:?}");
        let [a, b] = [track.stretches[0], track.stretches[1]];
        let (before, after, sigma) = ClockStretch::jump(&a, &b);
        assert!((a.to_s - at).abs() < 10.0, "seed {seed}: jump at {} s, not {at} s", a.to_s);
        assert!((after - before - 4.0).abs() < 4.5 * sigma, "{before} {after} {sigma}");
        let moved = track.aligned(&x, STEP_S);
        let late = |v: &[f64]| v.iter().zip(&y).map(|(a, b)| (a - b).abs()).sum::<f64>();
        assert!(late(&moved) < 0.2 * late(&x));
    }
}

#[test]
fn an_acceleration_is_compared_with_the_change_of_speed() {
    let (x, y) = pair(7, 900.0, |_| 1.5);
    let rate: Vec<f64> =
        (0..x.len()).map(|i| if i == 0 { 0.0 } else { (x[i] - x[i - 1]) / STEP_S }).collect();
    let s = Rates::new(
        Signal { samples: &rate, kind: Kind::Rate },
        Signal { samples: &y, kind: Kind::Value },
        STEP_S,
    );
    // A backward difference is half a sample late.
    let lag = track(&s).unwrap().stretches[0].lag_s;
    assert!((lag - 1.5 - 0.5 * STEP_S).abs() < 0.05, "{lag}");
}

#[test]
fn a_held_signal_is_late_by_half_its_hold_time() {
    let (x, y) = pair(3, 900.0, |_| 0.0);
    let held: Vec<f64> = (0..x.len()).map(|i| x[i / 20 * 20]).collect();
    let lag = tracked(&held, &y).unwrap().stretches[0].lag_s;
    assert!((lag - hold_delay_s(&held, STEP_S)).abs() < 0.05, "{lag}");
    assert!((hold_delay_s(&held, STEP_S) - 0.475).abs() < 1e-9);
}

#[test]
fn channels_that_do_not_belong_together_have_no_lag() {
    assert_eq!(tracked(&pair(1, 900.0, |_| 0.0).0, &pair(2, 900.0, |_| 0.0).1), None);
    assert_eq!(tracked(&vec![20.0; 18_000], &pair(2, 900.0, |_| 0.0).1), None);
    assert_eq!(tracked(&[], &[]), None);
}
