//! Drivers from recordings: parameters of the native engine, so that its traffic has the measured
//! distributions of speed, gap, headway and acceleration, and the measured rate of lane changes.
//!
//! First the drivers (desired speed, headway, standstill gap, acceleration, braking, MOBIL's
//! politeness, threshold and bias) are searched in *bounded* traffic, which begins with the vehicles
//! of a recording and gets its arrivals from it ([`Boundary`]). Then, with these drivers, the speed
//! beyond the end of the stretch in *free* traffic, which has the measured flow and density only: it
//! is where its congestion comes from, and what a scenario gets. Both searches are differential
//! evolution; the measure is a weighted sum of Kolmogorov-Smirnov distances and, for the drivers,
//! the rate of lane changes. Same recordings, same seed, same result.
//!
//! Left out: differences between classes beyond their share and length, wishes that change in time.

use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource, VehicleClass};

use crate::TrafficError;
use crate::native::{Boundary, ClassConfig, NativeTraffic, TrafficConfig};
use crate::replay::Recording;
use crate::search;
use crate::stats::{Observer, Quantity, Samples, kolmogorov_smirnov};

/// Weights of the distances.
const WEIGHTS: [(Quantity, f64); 4] = [
    (Quantity::Speed, 1.0),
    (Quantity::Gap, 0.3),
    (Quantity::Headway, 0.1),
    (Quantity::Accel, 0.1),
];
/// Weight of the rate of lane changes: its difference over its sum, 0 to 1.
const LANE_CHANGE_WEIGHT: f64 = 0.2;
/// Searched quantities with their bounds, in the order of [`Knobs`].
const BOUNDS: [(&str, f64, f64); 12] = [
    ("max_speed_m_s", 5.0, 40.0),
    ("speed_factor_sigma_frac", 0.01, 0.24),
    ("headway_s", 0.5, 3.0),
    ("min_gap_m", 1.0, 6.0),
    ("accel_m_s2", 0.4, 3.0),
    ("decel_m_s2", 0.8, 4.0),
    ("politeness_frac", 0.0, 1.0),
    ("threshold_m_s2", 0.02, 1.5),
    ("right_bias_m_s2", -0.3, 0.5),
    ("outflow_speed_m_s", 0.5, 35.0),
    ("outflow_sigma_m_s", 0.0, 8.0),
    ("outflow_period_s", 3.0, 25.0),
];
type Knobs = [f64; BOUNDS.len()];
/// The last of them say how fast the traffic beyond the end is, the others are the drivers'.
const BEYOND: usize = 3;
const DRIVERS: usize = BOUNDS.len() - BEYOND;
/// Drives of the free traffic per trial, each with a seed of its own.
const DRIVES: u64 = 2;
/// Drives of each recording's bounded traffic per trial.
const BOUNDED_DRIVES: u64 = 2;
/// Between two looks of the observer, ticks.
const LOOK_TICKS: u64 = 5;

/// How thoroughly is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Generations of the search.
    pub generations: usize,
    /// Simulated time per drive of the free traffic after its warm-up, s; a trial has two.
    pub trial_s: f64,
    /// Seed of the search and of its traffic.
    pub seed: u64,
}

impl Default for Effort {
    fn default() -> Self {
        Self { generations: 25, trial_s: 400.0, seed: 1 }
    }
}

/// A result.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Traffic with the parameters found.
    pub config: TrafficConfig,
    /// Weighted distance of the bounded traffic to the recordings.
    pub distance: f64,
    /// Trials driven.
    pub trials: usize,
}

/// A recording to learn from.
#[derive(Debug, Clone, Copy)]
pub struct Lesson<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// A road that it lies on.
    pub road: &'a Arc<Road>,
    /// Its samples, taken on that road.
    pub samples: &'a Samples,
}

/// Finds parameters with which traffic looks like the recordings. The free traffic drives on the
/// road of the first one; `base` gives everything that is not searched.
///
/// # Errors
/// [`TrafficError`] for recordings without samples or a road without lanes.
pub fn calibrate(
    lessons: &[Lesson<'_>],
    base: &TrafficConfig,
    effort: Effort,
) -> Result<Calibration, TrafficError> {
    let mut measured = lessons.first().map(|lesson| lesson.samples.clone()).unwrap_or_default();
    lessons.iter().skip(1).for_each(|lesson| measured.append(lesson.samples));
    let Some(first) = lessons
        .first()
        .filter(|_| !measured.of(Quantity::Gap).is_empty() && measured.duration_s >= 1.0)
    else {
        let why = "the recordings hold no vehicle behind another one".to_owned();
        return Err(TrafficError::Config { why });
    };
    measured.sort();
    let start = with_measured_demand(base, lessons, &measured);
    let bounded = lessons
        .iter()
        .map(|lesson| {
            let mut samples = lesson.samples.clone();
            samples.sort();
            Ok((Arc::new(Boundary::of(lesson.road, lesson.recording)?), lesson.road, samples))
        })
        .collect::<Result<Vec<_>, TrafficError>>()?;
    // All free drives together must look like the recordings, and each of them nearly so: otherwise
    // the search would find what one seed happens to do.
    let of_free = |config: &TrafficConfig| -> Result<f64, TrafficError> {
        let (mut all, mut single) = (Samples::default(), 0.0);
        for k in 0..DRIVES {
            let config = TrafficConfig { seed: start.seed.wrapping_add(k), ..config.clone() };
            let samples = drive(first.road, config, effort.trial_s)?;
            single += distance(&samples, &measured) / DRIVES as f64;
            all.append(&samples);
        }
        Ok(0.5 * (distance(&all, &measured) + single))
    };
    let of_drivers = |config: &TrafficConfig| -> Result<f64, TrafficError> {
        let (mut together, mut apart) = (Samples::default(), 0.0);
        for (boundary, road, samples) in &bounded {
            let own = drive_bounded(road, config, boundary, BOUNDED_DRIVES)?;
            apart += distance(&own, samples) / bounded.len() as f64;
            together.append(&own);
        }
        let (rate, wanted) = (together.lane_changes_1_km(), measured.lane_changes_1_km());
        let changes = (rate - wanted).abs() / (rate + wanted).max(1e-9);
        Ok(apart + LANE_CHANGE_WEIGHT * changes)
    };
    let bounds = BOUNDS.map(|(_, low, high)| (low, high));
    let mut knobs = guess(&start, &measured);
    // First the drivers, in the bounded traffic, which does not depend on the rest.
    let with_drivers = |drivers: &[f64; DRIVERS]| -> Knobs {
        std::array::from_fn(|k| drivers.get(k).copied().unwrap_or(knobs[k]))
    };
    let drivers = search::minimum(
        &std::array::from_fn(|k| bounds[k]),
        &std::array::from_fn(|k| knobs[k]),
        effort.generations,
        effort.seed,
        |drivers| of_drivers(&turned(&start, &with_drivers(drivers))),
    )?;
    knobs = with_drivers(&drivers.best);
    // Then, with these drivers, the speed beyond the end of the free traffic.
    let with_beyond = |beyond: &[f64; BEYOND]| {
        let mut all = knobs;
        all[DRIVERS..].copy_from_slice(beyond);
        all
    };
    let beyond = search::minimum(
        &std::array::from_fn(|k| bounds[DRIVERS + k]),
        &std::array::from_fn(|k| knobs[DRIVERS + k]),
        effort.generations / 4,
        effort.seed.wrapping_add(1),
        |beyond: &[f64; BEYOND]| of_free(&turned(&start, &with_beyond(beyond))),
    )?;
    let config = turned(&start, &with_beyond(&beyond.best));
    let distance = of_drivers(&config)?;
    Ok(Calibration { config, distance, trials: drivers.trials + beyond.trials })
}

/// The weighted sum of distances.
#[must_use]
pub fn distance(a: &Samples, b: &Samples) -> f64 {
    WEIGHTS
        .iter()
        .map(|&(q, weight)| weight * kolmogorov_smirnov(a.of(q), b.of(q)).unwrap_or(1.0))
        .sum()
}

/// Native traffic alone on a road for a while after its warm-up, looked at twice a second.
///
/// # Errors
/// [`TrafficError`] for a configuration or road that cannot be used.
pub fn drive(
    road: &Arc<Road>,
    config: TrafficConfig,
    duration_s: f64,
) -> Result<Samples, TrafficError> {
    let config = TrafficConfig { sees_ego: false, scene_radius_m: 1e5, ..config };
    let mut traffic = NativeTraffic::new(Arc::clone(road), Geometry::default(), config)?;
    observe(&mut traffic, road, duration_s)
}

/// Native traffic between the measured start, arrivals and end of a recording, for as long as the
/// recording, `drives` times with seeds of their own; the samples of all drives.
///
/// # Errors
/// As [`drive`].
pub fn drive_bounded(
    road: &Arc<Road>,
    config: &TrafficConfig,
    boundary: &Arc<Boundary>,
    drives: u64,
) -> Result<Samples, TrafficError> {
    let mut all = Samples::default();
    for k in 0..drives {
        let seed = config.seed.wrapping_add(k);
        let config = TrafficConfig { sees_ego: false, scene_radius_m: 1e5, seed, ..config.clone() };
        let (road, geometry) = (Arc::clone(road), Geometry::default());
        let mut traffic =
            NativeTraffic::bounded(Arc::clone(&road), geometry, config, Arc::clone(boundary))?;
        let samples = observe(&mut traffic, &road, boundary.duration_s())?;
        if k == 0 { all = samples } else { all.append(&samples) }
    }
    Ok(all)
}

fn observe(
    traffic: &mut NativeTraffic,
    road: &Road,
    duration_s: f64,
) -> Result<Samples, TrafficError> {
    let ego = EgoState { s_m: 0.5 * road.length_m(), ..EgoState::default() };
    let mut observer = Observer::default();
    for k in 0..=(duration_s * 10.0) as u64 / LOOK_TICKS {
        let now = Time((k * LOOK_TICKS * 100_000_000) as i64);
        observer.look(traffic.advance(now, &ego)?, road);
    }
    Ok(observer.samples)
}

/// Metres of driving lanes of a road.
#[must_use]
pub fn lanes_m(road: &Road) -> f64 {
    let driven = road.lanes().iter().filter(|lane| lane.kind == road::LaneKind::Driving);
    driven.map(|lane| lane.s_end_m - lane.s_start_m).sum()
}

/// Inflow, density, classes and lengths as measured.
fn with_measured_demand(
    base: &TrafficConfig,
    lessons: &[Lesson<'_>],
    measured: &Samples,
) -> TrafficConfig {
    let mut config = base.clone();
    let lanes_m =
        lessons.iter().map(|l| lanes_m(l.road)).sum::<f64>() / lessons.len().max(1) as f64;
    let density_1_km = measured.density_1_km(lanes_m);
    // Demand a little above the measured flow: the queue before the stretch is always there when
    // the flow is set by the congestion beyond it.
    let flow_1_s = 1.05 * measured.flow_1_h(lanes_m) / 3600.0;
    config.spawn_probability = (flow_1_s * config.spawn_interval_s).clamp(0.0, 1.0);
    config.initial_density_1_km = Some(density_1_km.min(120.0));
    // Long enough for the speed beyond the end to reach back over a stretch of a kilometre.
    config.warm_up_s = 150.0;
    let tracks = || lessons.iter().flat_map(|l| &l.recording.tracks);
    let share = |class| {
        tracks().filter(|t| t.class == class).count() as f64 / tracks().count().max(1) as f64
    };
    config.truck_share_frac = share(VehicleClass::Truck);
    config.van_share_frac = share(VehicleClass::Van).min(1.0 - config.truck_share_frac);
    for (class, own) in [
        (VehicleClass::Car, &mut config.car),
        (VehicleClass::Van, &mut config.van),
        (VehicleClass::Truck, &mut config.truck),
    ] {
        let lengths: Vec<f64> = tracks().filter(|t| t.class == class).map(|t| t.length_m).collect();
        if let Some(m) = crate::stats::moments(&lengths) {
            own.length_m = m.mean.clamp(1.0, 40.0);
            own.length_spread_m = (1.7 * m.sigma).min(0.4 * own.length_m);
        }
    }
    config
}

/// Where the search begins: what can be read off the samples.
fn guess(start: &TrafficConfig, measured: &Samples) -> Knobs {
    let speed = crate::stats::moments(measured.of(Quantity::Speed)).unwrap_or_default();
    let wish = [1.2 * speed.p95, 0.12, start.car.headway_s, start.car.min_gap_m];
    let car = start.car;
    let follow = [car.accel_m_s2, car.decel_m_s2];
    let change = [car.politeness_frac, car.threshold_m_s2, car.right_bias_m_s2];
    let beyond = [speed.mean, speed.sigma, 12.0];
    let all: Vec<f64> = wish.into_iter().chain(follow).chain(change).chain(beyond).collect();
    std::array::from_fn(|k| {
        let (_, low, high) = BOUNDS[k];
        all.get(k).copied().unwrap_or(low).clamp(low, high)
    })
}

/// The traffic with these values. Vans and trucks keep their proportions to cars.
fn turned(start: &TrafficConfig, knobs: &Knobs) -> TrafficConfig {
    let [max_speed, sigma, headway, gap, accel, decel, rest @ ..] = *knobs;
    let [politeness, threshold, bias, out_speed, out_sigma, out_period] = rest;
    let mut config = start.clone();
    let car = start.car;
    let change = |c: &mut ClassConfig| {
        c.speed_factor_sigma_frac = sigma.min(0.24 * c.speed_factor_frac);
        c.headway_s = (c.headway_s * headway / car.headway_s).clamp(0.3, 10.0);
        c.min_gap_m = (c.min_gap_m * gap / car.min_gap_m).clamp(0.5, 20.0);
        c.accel_m_s2 = (c.accel_m_s2 * accel / car.accel_m_s2).clamp(0.1, 6.0);
        c.decel_m_s2 = (c.decel_m_s2 * decel / car.decel_m_s2).clamp(0.3, 5.0);
        (c.politeness_frac, c.threshold_m_s2, c.right_bias_m_s2) = (politeness, threshold, bias);
        c.safe_decel_m_s2 = c.safe_decel_m_s2.min(c.max_decel_m_s2);
    };
    for class in [&mut config.car, &mut config.van, &mut config.truck] {
        change(class);
    }
    config.max_speed_m_s = max_speed;
    config.outflow_speed_m_s = Some(out_speed);
    (config.outflow_sigma_m_s, config.outflow_period_s) = (out_sigma, out_period);
    config
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::replay::{Frame, Row};
    use crate::stats::observe_recording;
    use road::builtin;

    #[test]
    fn every_corner_of_the_search_is_a_valid_configuration() {
        let start = TrafficConfig::default();
        for high in [false, true] {
            let corner: Knobs =
                std::array::from_fn(|k| if high { BOUNDS[k].2 } else { BOUNDS[k].1 });
            turned(&start, &corner).validate().unwrap();
        }
    }

    #[test]
    fn a_jam_beyond_the_end_of_the_road_reaches_back_over_it() {
        let road = Arc::new(builtin::flat(1500.0));
        let base = TrafficConfig {
            spawn_probability: 0.05,
            max_speed_m_s: 25.0,
            warm_up_s: 120.0,
            ..TrafficConfig::default()
        };
        let mean = |config: &TrafficConfig| {
            let samples = drive(&road, config.clone(), 120.0).unwrap();
            assert!(samples.min_gap_m > 0.0);
            crate::stats::moments(samples.of(Quantity::Speed)).unwrap().mean
        };
        let free = mean(&base);
        let jammed =
            mean(&TrafficConfig { outflow_speed_m_s: Some(4.0), outflow_sigma_m_s: 2.0, ..base });
        assert!(free > 15.0 && jammed < 10.0, "{free} {jammed}");
    }

    /// A recording of native traffic.
    fn recorded(road: &Arc<Road>, config: TrafficConfig, duration_s: f64) -> Recording {
        let config = TrafficConfig { sees_ego: false, scene_radius_m: 1e5, ..config };
        let mut traffic =
            NativeTraffic::new(Arc::clone(road), Geometry::default(), config).unwrap();
        let mut rows = Vec::new();
        for k in 0..(duration_s * 10.0) as i64 {
            let now = Time(k * 100_000_000);
            for n in &traffic.advance(now, &EgoState::default()).unwrap().neighbours {
                rows.push(Row {
                    id: n.id,
                    time_s: now.seconds(),
                    x_m: 0.5 * (n.front_s_m + n.rear_s_m),
                    y_m: n.d_m,
                    yaw_rad: Some(0.0),
                    speed_m_s: Some(n.speed_m_s),
                    length_m: Some(n.length_m()),
                    width_m: Some(n.width_m),
                    class: Some(n.class),
                });
            }
        }
        Recording::from_rows("native", Frame::Road, rows, 0.1).unwrap()
    }

    #[test]
    fn bounded_traffic_begins_as_the_recording_and_gets_its_vehicles() {
        let road = Arc::new(builtin::flat(800.0));
        let truth = TrafficConfig {
            max_speed_m_s: 14.0,
            outflow_speed_m_s: Some(7.0),
            outflow_sigma_m_s: 1.5,
            spawn_probability: 0.05,
            seed: 5,
            ..TrafficConfig::default()
        };
        let recording = recorded(&road, truth.clone(), 60.0);
        let measured = observe_recording(&road, &recording).unwrap();
        let boundary = Arc::new(Boundary::of(&road, &recording).unwrap());
        assert!(boundary.at_start() > 20 && boundary.later() > 10, "{boundary:?}");
        let speed = |s: &Samples| {
            kolmogorov_smirnov(s.of(Quantity::Speed), measured.of(Quantity::Speed)).unwrap()
        };
        // The drivers that made it, and drivers who want twice the distance.
        let same = drive_bounded(&road, &truth, &boundary, 2).unwrap();
        let mut timid = truth;
        for class in [&mut timid.car, &mut timid.van, &mut timid.truck] {
            class.headway_s *= 3.0;
        }
        let timid = drive_bounded(&road, &timid, &boundary, 2).unwrap();
        assert!(same.min_gap_m > 0.0 && timid.min_gap_m > 0.0);
        assert!(same.vehicles.abs_diff(2 * measured.vehicles) < measured.vehicles / 5);
        let (same, timid) = (speed(&same), speed(&timid));
        assert!(same < 0.25 && timid > 2.0 * same, "{same}, {timid} with timid drivers");
    }

    #[test]
    fn parameters_that_made_a_traffic_are_found_again_as_far_as_its_distributions_go() {
        let road = Arc::new(builtin::flat(800.0));
        let truth = TrafficConfig {
            max_speed_m_s: 12.0,
            outflow_speed_m_s: Some(6.0),
            outflow_sigma_m_s: 2.5,
            spawn_probability: 0.05,
            initial_density_1_km: Some(50.0),
            truck_share_frac: 0.0,
            van_share_frac: 0.0,
            seed: 77,
            ..TrafficConfig::default()
        };
        let recording = recorded(&road, truth.clone(), 40.0);
        let samples = observe_recording(&road, &recording).unwrap();
        let lesson = Lesson { recording: &recording, road: &road, samples: &samples };
        let effort = Effort { generations: 3, trial_s: 40.0, seed: 3 };
        let found = calibrate(&[lesson], &TrafficConfig::default(), effort).unwrap().config;
        // Judged on traffic that was not learned from.
        let other = recorded(&road, TrafficConfig { seed: 78, ..truth }, 40.0);
        let measured = observe_recording(&road, &other).unwrap();
        let boundary = Arc::new(Boundary::of(&road, &other).unwrap());
        let apart = |config: &TrafficConfig| {
            let samples = drive_bounded(&road, config, &boundary, 2).unwrap();
            distance(&samples, &measured)
        };
        let mut strangers = found.clone();
        for class in [&mut strangers.car, &mut strangers.van, &mut strangers.truck] {
            *class = ClassConfig { headway_s: 3.0, accel_m_s2: 0.5, ..*class };
        }
        let (found, strangers) = (apart(&found), apart(&strangers));
        assert!(found < 0.3 && found < 0.6 * strangers, "{found}, {strangers} of strangers");
    }
}
