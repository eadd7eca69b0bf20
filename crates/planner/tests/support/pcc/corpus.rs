//! Roads of the corpus: synthetic ones by formula, the built-in ones from the road crate.

use planner::pcc::model::profile_of;
use road::ProfilePoint;
use tractrix_core::{Curve, FuelModel, Grid, LowLoadFuel, RPM_PER_RAD_S};

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
        ("highway", profile_of(&road::builtin::highway(), 12.5)),
    ]
}

/// Fuel map of another engine as a test bench tells it: flow over speed and torque. Losses grow
/// toward both ends of the speed range and with the load, so that the best point lies at middle
/// speed and three quarters of full load; flow at a given speed is convex in torque. Its friction is
/// that of the reference truck.
#[allow(dead_code, clippy::expect_used)]
pub(crate) fn bench_map() -> FuelModel {
    let rad_s: Vec<f64> = (0..13).map(|i| (600.0 + 125.0 * f64::from(i)) / RPM_PER_RAD_S).collect();
    let torque_nm: Vec<f64> = (0..110).map(|i| 24.0 * f64::from(i)).collect();
    let flow = |w: f64, t: f64| {
        let lost = 120.0 + 0.09 * w * RPM_PER_RAD_S + 100.0 * (w / 120.0 - 1.0).powi(2);
        0.0485e-3 * w * (t + lost + 60.0 * (t / 1300.0).powi(2))
    };
    let g_s = rad_s.iter().flat_map(|&w| torque_nm.iter().map(move |&t| flow(w, t))).collect();
    let friction_nm = rad_s.iter().map(|w| 95.0 + 0.085 * w * RPM_PER_RAD_S).collect();
    FuelModel::Map {
        flow_g_s: Grid::new("flow", rad_s.clone(), torque_nm, g_s).expect("increasing axes"),
        friction_nm: Curve::new("friction", rad_s, friction_nm).expect("an increasing axis"),
        low_load: LowLoadFuel::default(),
    }
}
