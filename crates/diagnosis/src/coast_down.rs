//! Mass, drag area and rolling resistance from coast-downs in both directions and from driving
//! under a measured torque.
//!
//! ```text
//! (m + m_rot) v' = -(F_roll(v) + F_air(v + d w) + m g d (i + i_k))     d = +-1, the direction
//! E_engine(window) = E_wheel / eta + P_aux T
//! ```
//! A coast-down alone knows forces per mass only: its mass is the one of the truck file, to a
//! per cent. The torque gives the mass at which the truck was driven, which may be another. Grade i and wind w of
//! the road, a rest of grade i_k for each run, the growth of rolling resistance with speed, the
//! density on the day of the coast-downs, the engine's power for its own use and the scale of the
//! torque with the driveline's efficiency are nuisances with priors ([`Priors`]); their
//! uncertainty is in the intervals. Left out: cross wind, warm-up of the tyres.

use crate::balance::{Body, EnergyWindow};
use crate::fit::{Estimate, Parameter, least_squares};
use tractrix_core::GRAVITY_M_S2;

/// One coast-down in neutral.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CoastDown {
    /// +1 or -1: direction on the road.
    pub direction: f64,
    /// Times, s, from 0.
    pub time_s: Vec<f64>,
    /// Speeds, m/s.
    pub speed_m_s: Vec<f64>,
    /// Standard deviation of the times, s.
    pub time_sigma_s: f64,
    /// Standard deviation of the speeds, m/s.
    pub speed_sigma_m_s: f64,
}

/// Driving under power: a window and the work that the engine is said to have done in it, J.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// The window.
    pub window: EnergyWindow,
    /// Work at the crank by the torque signal, J.
    pub engine_work_j: f64,
}

/// What is known of the nuisances: (mean, standard deviation).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Priors {
    /// Grade of the coast-down road, rise over run, uphill in direction +1.
    pub grade: (f64, f64),
    /// Wind against direction +1, m/s.
    pub wind_m_s: (f64, f64),
    /// Rest of the grade of a single run, rise over run.
    pub run_grade: (f64, f64),
    /// Growth of rolling resistance with speed over its value at rest, s/m.
    pub rolling_growth_s_m: (f64, f64),
    /// Density of the air in the coast-downs over that in the driving.
    pub density_ratio: (f64, f64),
    /// Efficiency of the driveline times the scale of the torque signal.
    pub efficiency: (f64, f64),
    /// Power for the engine's own use, W.
    pub own_power_w: (f64, f64),
    /// Error of the altitude that a window gains, m.
    pub altitude_sigma_m: f64,
    /// Error of the engine's work in a window, J.
    pub work_sigma_j: f64,
}

/// Places of the parameters in the estimate.
pub mod place {
    /// Mass of the truck when it was driven under power, kg.
    pub const MASS: usize = 0;
    /// Drag area, m².
    pub const DRAG_AREA: usize = 1;
    /// Rolling resistance coefficient at rest.
    pub const ROLLING: usize = 2;
    /// Growth of rolling resistance over its value at rest, s/m.
    pub const GROWTH: usize = 3;
    /// Grade of the road.
    pub const GRADE: usize = 4;
    /// Wind against direction +1, m/s.
    pub const WIND: usize = 5;
    /// Density ratio.
    pub const DENSITY: usize = 6;
    /// Efficiency times torque scale.
    pub const EFFICIENCY: usize = 7;
    /// Own power, W.
    pub const OWN_POWER: usize = 8;
    /// Mass of the truck when it coasted, kg.
    pub const COAST_MASS: usize = 9;
    /// First of the runs' rests of grade, followed by the runs' initial speeds, m/s.
    pub const RUNS: usize = 10;
}

/// Uncertainty of the mass when driven before the torque is looked at, relative: half the load.
const LOAD_FRAC: f64 = 0.5;
/// Uncertainty of the mass on the scales, relative.
const SCALES_FRAC: f64 = 0.01;

/// Speeds of a coast-down, m/s, at its times: classical Runge-Kutta, steps up to half a second.
fn coast(body: &Body, run: &CoastDown, start_m_s: f64, grade: f64, wind_m_s: f64) -> Vec<f64> {
    let rate = |v: f64| {
        if v <= 0.0 {
            return 0.0;
        }
        let slope = body.mass_kg * GRAVITY_M_S2 * run.direction * grade;
        -(body.resistance_n(v, run.direction * wind_m_s) + slope)
            / (body.mass_kg + body.rotating_mass_kg)
    };
    let (mut v, mut t) = (start_m_s, 0.0);
    run.time_s
        .iter()
        .map(|&end| {
            let steps = ((end - t) / 0.5).ceil().max(0.0);
            let h = (end - t) / steps.max(1.0);
            for _ in 0..steps as usize {
                let k1 = rate(v);
                let k2 = rate(v + 0.5 * h * k1);
                let k3 = rate(v + 0.5 * h * k2);
                let k4 = rate(v + h * k3);
                v = (v + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)).max(0.0);
            }
            t = end;
            v
        })
        .collect()
}

/// Speeds, m/s, that a fit gives for a run, at `count` times from its begin to its end.
#[must_use]
pub fn speeds(
    base: &Body,
    runs: &[CoastDown],
    run: usize,
    fitted: &[f64],
    count: usize,
) -> Vec<f64> {
    let Some(measured) = runs.get(run) else { return Vec::new() };
    let end = measured.time_s.last().copied().unwrap_or(0.0);
    let times = (0..count).map(|i| i as f64 * end / (count.max(2) - 1) as f64).collect();
    let dense = CoastDown { time_s: times, ..measured.clone() };
    let b = body(base, fitted, fitted[place::COAST_MASS], fitted[place::DENSITY]);
    let grade = fitted[place::GRADE] + fitted[place::RUNS + run];
    let start = fitted[place::RUNS + runs.len() + run];
    coast(&b, &dense, start, grade, fitted[place::WIND])
}

/// The body with the masses and resistances of a parameter vector.
fn body(base: &Body, p: &[f64], mass_kg: f64, density_ratio: f64) -> Body {
    let mut b = base.clone();
    b.mass_kg = mass_kg;
    b.density_kg_m3 *= density_ratio;
    b.resistance.drag_area_m2 = p[place::DRAG_AREA];
    b.resistance.rolling_coeff = p[place::ROLLING];
    b.resistance.rolling_per_speed_s_m = p[place::ROLLING] * p[place::GROWTH];
    b
}

fn coast_residuals(base: &Body, runs: &[CoastDown], p: &[f64]) -> Vec<f64> {
    let b = body(base, p, p[place::COAST_MASS], p[place::DENSITY]);
    runs.iter()
        .enumerate()
        .flat_map(|(k, run)| {
            let grade = p[place::GRADE] + p[place::RUNS + k];
            let start = p[place::RUNS + runs.len() + k];
            let v = coast(&b, run, start, grade, p[place::WIND]);
            let slope = |i: usize| {
                let (a, c) = (i.saturating_sub(1), (i + 1).min(run.time_s.len() - 1));
                (run.speed_m_s[c] - run.speed_m_s[a]) / (run.time_s[c] - run.time_s[a]).max(1e-9)
            };
            (0..v.len())
                .map(|i| {
                    let sigma = run.speed_sigma_m_s.hypot(run.time_sigma_s * slope(i));
                    (v[i] - run.speed_m_s[i]) / sigma
                })
                .collect::<Vec<f64>>()
        })
        .collect()
}

/// Work that the engine should have given minus what it is said to have given, over the error
/// that torque and altimeter leave, `scale` times the one expected (Deming's regression: the
/// altimeter's share grows with the mass).
fn work_residuals(
    base: &Body,
    driven: &[Driven],
    priors: &Priors,
    scale: f64,
    p: &[f64],
) -> Vec<f64> {
    let b = body(base, p, p[place::MASS], 1.0);
    let efficiency = p[place::EFFICIENCY];
    let altitude_j = b.mass_kg * GRAVITY_M_S2 * priors.altitude_sigma_m / efficiency;
    let sigma = scale * priors.work_sigma_j.hypot(altitude_j);
    driven
        .iter()
        .map(|d| {
            let own = p[place::OWN_POWER] * d.window.duration_s();
            let needed = d.window.wheel_energy_j(&b, 0.0) / efficiency + own;
            (needed - d.engine_work_j) / sigma
        })
        .collect()
}

/// Fits all parameters; `None` without runs and windows, or if they say nothing.
///
/// The errors of the windows are scaled to their own scatter.
#[must_use]
pub fn fit(
    base: &Body,
    runs: &[CoastDown],
    driven: &[Driven],
    priors: &Priors,
) -> Option<Estimate> {
    let known = |(mean, sigma)| Parameter::known(mean, sigma);
    let mut parameters = vec![
        known((base.mass_kg, LOAD_FRAC * base.mass_kg)),
        Parameter::free(base.resistance.drag_area_m2.max(1.0), 1.0),
        Parameter::free(base.resistance.rolling_coeff.max(0.004), 1e-3),
        known(priors.rolling_growth_s_m),
        known(priors.grade),
        known(priors.wind_m_s),
        known(priors.density_ratio),
        known(priors.efficiency),
        known(priors.own_power_w),
        known((base.mass_kg, SCALES_FRAC * base.mass_kg)),
    ];
    parameters.extend(runs.iter().map(|_| known(priors.run_grade)));
    parameters.extend(runs.iter().map(|r| Parameter::free(r.speed_m_s[0], 1.0)));
    if driven.is_empty() {
        parameters[place::MASS] = known((base.mass_kg, SCALES_FRAC * base.mass_kg));
    }
    let mut scale = 1.0;
    let mut found = None;
    for _ in 0..4 {
        let estimate = least_squares(&parameters, |p| {
            let mut r = coast_residuals(base, runs, p);
            r.extend(work_residuals(base, driven, priors, scale, p));
            r
        })?;
        let first = estimate.residuals.len() - driven.len();
        let mut scatter: Vec<f64> = estimate.residuals[first..].iter().map(|r| r.abs()).collect();
        found = Some(estimate);
        if scatter.len() < 8 {
            break;
        }
        scatter.sort_by(f64::total_cmp);
        scale *= 1.4826 * scatter[scatter.len() / 2];
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynamics::TruckParameters;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    const PRIORS: Priors = Priors {
        grade: (0.0, 0.01),
        wind_m_s: (0.0, 2.0),
        run_grade: (0.0, 5e-4),
        rolling_growth_s_m: (0.01, 0.006),
        density_ratio: (1.0, 0.03),
        efficiency: (0.94, 0.04),
        own_power_w: (2000.0, 1000.0),
        altitude_sigma_m: 0.7,
        work_sigma_j: 10e3,
    };

    #[test]
    fn mass_drag_and_rolling_lie_within_their_intervals_as_often_as_these_say() {
        let truck = TruckParameters::load("reference").unwrap();
        let mut base = Body::of(&truck, 1.15);
        base.mass_kg = 20_000.0;
        let mut inside = [0; 3];
        let cases = 16;
        for seed in 0..cases {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut draw = |(mean, sigma): (f64, f64)| mean + sigma * normal(&mut rng);
            let mut truth = vec![
                draw((20_000.0, 3000.0)),
                draw((6.0, 0.7)),
                draw((0.007, 0.0008)),
                draw(PRIORS.rolling_growth_s_m),
                draw((0.0, 0.004)),
                draw((0.0, 1.5)),
                draw(PRIORS.density_ratio),
                draw(PRIORS.efficiency),
                draw(PRIORS.own_power_w),
                draw((base.mass_kg, SCALES_FRAC * base.mass_kg)),
            ];
            let runs: Vec<CoastDown> = [1.0, -1.0]
                .map(|direction| CoastDown {
                    direction,
                    time_s: (0..12).map(|i| f64::from(i) * 10.0).collect(),
                    speed_m_s: vec![25.0; 12],
                    time_sigma_s: 0.2,
                    speed_sigma_m_s: 0.1,
                })
                .into();
            truth.extend([0.0, 0.0].map(|_| draw(PRIORS.run_grade)));
            truth.extend([25.0, 25.0]);
            let b = body(&base, &truth, truth[place::COAST_MASS], truth[place::DENSITY]);
            let runs: Vec<CoastDown> = runs
                .into_iter()
                .enumerate()
                .map(|(k, mut run)| {
                    let grade = truth[place::GRADE] + truth[place::RUNS + k];
                    run.speed_m_s = coast(&b, &run, 25.0, grade, truth[place::WIND])
                        .into_iter()
                        .map(|v| v + 0.1 * draw((0.0, 1.0)))
                        .collect();
                    run
                })
                .collect();
            let b = body(&base, &truth, truth[place::MASS], 1.0);
            let driven: Vec<Driven> = (0..40)
                .map(|_| {
                    let (v0, gain) = (draw((12.0, 2.0)), draw((1.0, 1.0)));
                    let mut window = EnergyWindow {
                        step_s: 1.0,
                        speed_m_s: (0..11).map(|i| v0 + gain * f64::from(i) / 10.0).collect(),
                        climb_m: draw((1.0, 2.0)),
                        ..EnergyWindow::default()
                    };
                    let engine_work_j = window.wheel_energy_j(&b, 0.0) / truth[place::EFFICIENCY]
                        + truth[place::OWN_POWER] * 10.0
                        + draw((0.0, PRIORS.work_sigma_j));
                    window.climb_m += draw((0.0, PRIORS.altitude_sigma_m));
                    Driven { window, engine_work_j }
                })
                .collect();
            let fit = fit(&base, &runs, &driven, &PRIORS).unwrap();
            for (i, n) in inside.iter_mut().enumerate() {
                *n += usize::from((fit.value[i] - truth[i]).abs() < 1.96 * fit.sigma(i));
            }
        }
        assert!(inside.iter().all(|n| *n >= 13), "of {cases} within 95 %: {inside:?}");
    }

    #[test]
    fn a_coast_down_without_torque_leaves_the_mass_to_the_truck_file() {
        let base = Body::of(&TruckParameters::load("reference").unwrap(), 1.15);
        let run = CoastDown {
            direction: 1.0,
            time_s: vec![0.0, 10.0, 20.0, 40.0, 60.0],
            speed_m_s: vec![25.0, 23.0, 21.2, 18.0, 15.2],
            time_sigma_s: 0.1,
            speed_sigma_m_s: 0.1,
        };
        let fit = fit(&base, &[run], &[], &PRIORS).unwrap();
        assert!((fit.value[place::MASS] / base.mass_kg - 1.0).abs() < 1e-3);
    }
}
