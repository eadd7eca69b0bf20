//! Roads of the corpus: synthetic ones by formula, the built-in ones from the road crate; and roads
//! that nobody has tuned to, drawn from a seed.

use planner::pcc::model::profile_of;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use road::ProfilePoint;

/// Length of the synthetic roads, m.
pub(crate) const LENGTH_M: f64 = 15_000.0;

fn by_grade(grade_frac: impl Fn(f64) -> f64) -> Vec<ProfilePoint> {
    (0..=(LENGTH_M / 12.5) as usize)
        .map(|i| {
            let s_m = i as f64 * 12.5;
            ProfilePoint {
                s_m,
                grade_rad: libm::atan(grade_frac(s_m)),
                speed_limit_m_s: 40.0,
                ..ProfilePoint::default()
            }
        })
        .collect()
}

/// Sum of sinusoids with fixed wavelengths and phases, scaled to the standard deviation.
fn random_like(std_frac: f64) -> Vec<ProfilePoint> {
    let parts = [
        (5200.0, 0.3, 0.9),
        (3100.0, 2.1, 1.0),
        (2170.0, 4.4, 1.0),
        (1490.0, 1.2, 0.9),
        (1130.0, 5.6, 0.8),
        (870.0, 3.3, 0.6),
        (610.0, 0.9, 0.4),
        (430.0, 2.7, 0.25),
    ];
    let norm: f64 = parts.iter().map(|(_, _, a)| 0.5 * a * a).sum::<f64>();
    let norm = libm::sqrt(norm);
    by_grade(move |s| {
        let sum: f64 = parts
            .iter()
            .map(|(wave, phase, a)| a * libm::sin(2.0 * core::f64::consts::PI * s / wave + phase))
            .sum();
        std_frac * sum / norm
    })
}

/// Trapezoidal hills: up and down at `grade` over `ramp_m` each way with rounded changes.
fn hills(grade: impl Fn(usize) -> f64, period_m: f64) -> Vec<ProfilePoint> {
    by_grade(move |s| {
        let hill = (s / period_m) as usize;
        let x = (s % period_m) / period_m;
        let g = grade(hill);
        // up for 40 %, crest, down for 40 %, valley: smooth between.
        let shape = |x: f64| {
            let edge = 0.05;
            let bump = |a: f64, b: f64| {
                let up = ((x - a) / edge).clamp(0.0, 1.0);
                let down = ((b - x) / edge).clamp(0.0, 1.0);
                up.min(down)
            };
            bump(0.02, 0.48) - bump(0.52, 0.98)
        };
        g * shape(x)
    })
}

/// Name and profile of every road.
pub(crate) fn roads() -> Vec<(&'static str, Vec<ProfilePoint>)> {
    let tau = 2.0 * core::f64::consts::PI;
    vec![
        ("flat", by_grade(|_| 0.0)),
        (
            "rolling2",
            by_grade(move |s| {
                0.016 * libm::sin(tau * s / 2500.0) + 0.008 * libm::sin(tau * s / 1100.0 + 1.0)
            }),
        ),
        ("random15", random_like(0.015)),
        ("random25", random_like(0.025)),
        (
            "rolling4",
            by_grade(move |s| {
                0.035 * libm::sin(tau * s / 1200.0) + 0.018 * libm::sin(tau * s / 3300.0 + 0.5)
            }),
        ),
        ("hilly5", hills(|i| [0.03, 0.05, 0.04, 0.035, 0.045][i % 5], 1875.0)),
        ("mountain", hills(|i| [0.03, 0.04][i % 2], 5000.0)),
        ("test_site", profile_of(&road::builtin::test_site(), 12.5)),
        ("highway_sag", profile_of(&road::builtin::highway_sag(), 12.5)),
    ]
}

/// Roads that only report: waves of random length and phase (300 m to 6 km, long ones higher) with a
/// grade of 0.8 to 3 % standard deviation, clipped at 6 %, and on every other road a stretch with a
/// lower limit.
pub(crate) fn unseen() -> Vec<(String, Vec<ProfilePoint>)> {
    (0..6_u64)
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(0x70AD + seed);
            let parts: Vec<(f64, f64, f64)> = (0..12)
                .map(|_| {
                    let wave_m = 300.0 * 20.0_f64.powf(rng.random_range(0.0..1.0));
                    let phase = rng.random_range(0.0..core::f64::consts::TAU);
                    (wave_m, phase, wave_m.sqrt())
                })
                .collect();
            let norm = (parts.iter().map(|(_, _, a)| 0.5 * a * a).sum::<f64>()).sqrt();
            let std_frac = rng.random_range(0.008..0.03);
            let slow_from_m = rng.random_range(5_000.0..10_000.0);
            let mut profile = by_grade(|s| {
                let wave = |(wave_m, phase, a): &(f64, f64, f64)| {
                    a * libm::sin(core::f64::consts::TAU * s / wave_m + phase)
                };
                let sum: f64 = parts.iter().map(wave).sum();
                (std_frac * sum / norm).clamp(-0.06, 0.06)
            });
            if seed % 2 == 1 {
                for p in &mut profile {
                    if (slow_from_m..slow_from_m + 800.0).contains(&p.s_m) {
                        p.speed_limit_m_s = 60.0 / 3.6;
                    }
                }
            }
            (format!("unseen{seed}, {:.1} %", 100.0 * std_frac), profile)
        })
        .collect()
}
