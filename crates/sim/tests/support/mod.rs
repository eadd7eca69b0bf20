//! Jams and a truck that drives behind them.
#![allow(dead_code, clippy::unwrap_used, reason = "shared by a test and an example")]

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use planner::{RatesConfig, Stack, StackConfig, drive_tick};
use road::{Cubics, Line, Road, builtin};
use sim::{Drivability, Drive, EgoStart, LeadVehicle, Metrics, SimTruck, Summary, Weather};
use tractrix_core::{Recorder, Time, Vehicle};

/// Step of the speed profiles, s.
pub(crate) const STEP_S: f64 = 0.5;
/// Length of the synthetic jams, s.
pub(crate) const JAM_S: f64 = 300.0;
const TICK_S: f64 = 0.01;

/// Speeds of a vehicle in a jam, `STEP_S` apart: each written on its own, none recorded.
pub(crate) fn jams() -> Vec<(&'static str, Vec<f64>)> {
    let sampled = |v: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (0..=(JAM_S / STEP_S) as usize).map(|i| v(i as f64 * STEP_S).max(0.0)).collect()
    };
    let wave = |t: f64, period_s: f64, phase: f64| {
        libm::sin(core::f64::consts::TAU * t / period_s + phase)
    };
    vec![
        // one wave a minute between standstill and 29 km/h
        ("sine", sampled(&|t| 4.0 - 4.0 * wave(t, 60.0, 1.57))),
        // a car that races to the next queue: 1.2 m/s2 up, 1.6 down, 12 s of standing
        (
            "race",
            accelerations(0.0, &[(0.0, 6.0), (1.2, 6.0), (0.0, 8.0), (-1.6, 4.5), (0.0, 12.0)]),
        ),
        // waves of dense traffic between 22 and 47 km/h
        ("waves", accelerations(6.0, &[(1.2, 6.0), (0.0, 8.0), (-1.6, 4.5), (0.0, 12.0)])),
        // a queue at a toll gate: 8 m forward every 14 s
        ("creep", accelerations(1.0, &[(0.8, 2.5), (-0.5, 4.0), (0.0, 7.5)])),
        // irregular waves that sometimes stop
        (
            "irregular",
            sampled(&|t| {
                4.2 + 2.6 * wave(t, 47.0, 0.4) + 2.2 * wave(t, 23.0, 1.0) + 1.1 * wave(t, 11.0, 2.0)
            }),
        ),
        // the end of a queue: 20 m/s, hard braking to walking pace, jam, and away again
        (
            "queue",
            accelerations(
                20.0,
                &[
                    (0.0, 20.0),
                    (-3.0, 6.0),
                    (0.0, 60.0),
                    (0.6, 10.0),
                    (-0.7, 10.0),
                    (0.0, 40.0),
                    (0.5, 30.0),
                    (0.0, 1e3),
                ],
            ),
        ),
        // slow traffic that never stops: 10 to 35 km/h
        ("slow", sampled(&|t| 6.2 + 3.4 * wave(t, 75.0, 0.0) + 0.6 * wave(t, 9.0, 0.0))),
    ]
}

/// A speed from a repeated sequence of accelerations, m/s², and their durations, s.
fn accelerations(start_m_s: f64, legs: &[(f64, f64)]) -> Vec<f64> {
    let mut speeds = vec![start_m_s];
    let mut v = start_m_s;
    for &(a, duration_s) in legs.iter().cycle() {
        for _ in 0..(duration_s / STEP_S) as usize {
            v = (v + a * STEP_S).max(0.0);
            speeds.push(v);
            if speeds.len() as f64 * STEP_S > JAM_S {
                return speeds;
            }
        }
    }
    speeds
}

/// A straight two-lane road of one grade.
pub(crate) fn slope(grade_frac: f64) -> Arc<Road> {
    let length_m = 12_000.0;
    let height = Cubics::integral_of_linear(0.0, &[(0.0, grade_frac), (length_m, grade_frac)]);
    let line = Line::from_curvature(0.0, &[(0.0, 0.0), (length_m, 0.0)], height, Cubics::default());
    let lanes = builtin::flat(length_m).lanes().to_vec();
    Arc::new(Road::new("slope", line, lanes, vec![(0.0, 25.0)]).unwrap())
}

/// What a drive behind a lead came to.
pub(crate) struct Followed {
    pub(crate) drive: Drive,
    pub(crate) summary: Summary,
}

/// Drives a truck with this payload behind a lead with these speeds, for as long as they last.
pub(crate) fn follow(
    truck: &str,
    payload_kg: f64,
    road: &Arc<Road>,
    speeds_m_s: &[f64],
    config: &StackConfig,
    recorder: &mut impl Recorder,
) -> Followed {
    let model = TruckModel::new(TruckParameters::load(truck).unwrap(), payload_kg).unwrap();
    let start = EgoStart { s_m: 100.0, lane: Some(0), speed_m_s: speeds_m_s[0].min(22.0) };
    let mut vehicle =
        SimTruck::new(Arc::new(model), Arc::clone(road), &start, &Weather::default()).unwrap();
    let limits = vehicle.limits().clone();
    let config = StackConfig { rates: RatesConfig::for_tick(TICK_S), ..config.clone() };
    let gap_m = 8.0 + 2.5 * start.speed_m_s;
    let rear_s_m = start.s_m + limits.geometry.front_m + gap_m;
    let mut lead = LeadVehicle::new(road, 0, rear_s_m, STEP_S, speeds_m_s);
    let mut stack = Stack::new(config.clone(), &limits).unwrap();
    let mut drive = Drivability::new(&limits, &config.rss);
    let mut metrics = Metrics::new(&limits, &config.rss, Arc::clone(road));
    let ticks = ((speeds_m_s.len() - 1) as f64 * STEP_S / TICK_S) as i64;
    for i in 0..ticks {
        let now = Time::from_seconds(i as f64 * TICK_S);
        let recorders = &mut ((&mut drive, &mut metrics), &mut *recorder);
        drive_tick(now, &mut vehicle, &mut lead, &mut stack, road, recorders).unwrap();
    }
    Followed { drive: drive.figures(), summary: metrics.summary() }
}
