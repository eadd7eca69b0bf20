//! Drivers from recordings: one population for all densities, so that the traffic of the native
//! engine has the measured distributions of speed, gap, headway and acceleration, and the measured
//! rate of lane changes.
//!
//! Two searches, apart, each by differential evolution:
//! 1. the *population* (desired speed, headway and how both scatter, standstill gap, acceleration,
//!    braking, MOBIL's politeness, threshold and bias), in *bounded* traffic: it begins with the
//!    vehicles of a recording and gets its arrivals and the speed at its end from it ([`Boundary`]);
//!    drivers stand where they would have to creep (`human.creep_m_s`), as measured ones do;
//! 2. how the drivers of *free* traffic follow, and its *rim*: it gets flow, density, classes and
//!    mean and standard deviation of the speeds at both ends of each recording, and four numbers,
//!    the same for all recordings, say how these become a boundary. Flow over density is the mean
//!    speed: where it is less than at the ends, the stretch begins with a queue. Bounded traffic is
//!    told where a jam is, free traffic has to make it: with one set of drivers for both, both get
//!    worse. It is judged by drives that flow as was counted ([`drives_as_counted`]).
//!
//! The measure is the mean over the recordings of a weighted sum of Kolmogorov-Smirnov distances,
//! each weighing as much as it lasts, and a little for values that no calibration has found before
//! ([`knobs`]): where recordings say nothing, the usual value stays. Same recordings, same seed,
//! same result. Left out: differences between classes beyond their share and length, wishes that
//! change in time.

use std::sync::Arc;

use road::Road;

use crate::TrafficError;
use crate::native::{Boundary, TrafficConfig};
use crate::replay::Recording;
use crate::search;
use crate::stats::{Quantity, Samples, kolmogorov_smirnov};

mod counted;
mod drives;
mod knobs;

pub use counted::{MacroscopicState, RejectionSampling, drives_as_counted};
pub use drives::{drive, drive_bounded, lanes_m};

use knobs::{
    FREE, Knob, POPULATION, bounds, unusual, usual, with_free, with_measured_demand,
    with_population,
};

/// Weights of the distances.
const WEIGHTS: [(Quantity, f64); 4] = [
    (Quantity::Speed, 1.0),
    (Quantity::Gap, 0.3),
    (Quantity::Headway, 0.1),
    (Quantity::Accel, 0.1),
];
/// Weight of the rate of lane changes: its difference over its sum, 0 to 1.
const LANE_CHANGE_WEIGHT: f64 = 0.1;
/// Weight of the mean square of how unusual the values are, in standard deviations.
const UNUSUAL_WEIGHT: f64 = 0.02;
/// Drives of each recording's free traffic per trial, and those of them that are judged.
const FREE_DRIVES: RejectionSampling = RejectionSampling { candidates: 12, accepted: 3 };
/// Drives of each recording's bounded traffic per trial.
const BOUNDED_DRIVES: u64 = 2;

/// How thoroughly is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Generations of each of the two searches.
    pub generations: usize,
    /// Simulated time per drive of the free traffic after its warm-up, s; a trial has twelve of each
    /// recording.
    pub trial_s: f64,
    /// Seed of the search and of its traffic.
    pub seed: u64,
}

impl Default for Effort {
    fn default() -> Self {
        Self { generations: 25, trial_s: 30.0, seed: 1 }
    }
}

/// A result.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The given traffic with the population found in bounded traffic.
    pub config: TrafficConfig,
    /// Its values, with their keys and the bounds of the search.
    pub population: Vec<(&'static str, f64, (f64, f64))>,
    /// Values of the free traffic; those of the rim as parts of the measured ones.
    pub free: Vec<(&'static str, f64, (f64, f64))>,
    /// Weighted distance of the bounded traffic to a recording, mean, lane changes included.
    pub distance: f64,
    /// Weighted distance of the free traffic to its recording, mean.
    pub free_distance: f64,
    /// Trials driven.
    pub trials: usize,
    values: ([f64; POPULATION.len()], [f64; FREE.len()]),
}

impl Calibration {
    /// Free traffic with the measured flow, density, classes and speeds at both ends of a recording,
    /// which need not be one of those that were learned from.
    ///
    /// # Errors
    /// [`TrafficError`] if the recording does not lie on its road.
    pub fn free_traffic(&self, lesson: &Lesson<'_>) -> Result<TrafficConfig, TrafficError> {
        let boundary = Boundary::of(lesson.road, lesson.recording)?;
        let measured = with_measured_demand(&self.config, lesson, &boundary);
        Ok(with_free(&measured, &self.values.0, &self.values.1))
    }
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

/// Finds populations and a rim with which traffic looks like the recordings; `base` gives
/// everything that is not searched.
///
/// # Errors
/// [`TrafficError`] for recordings without samples or a road without lanes.
pub fn calibrate(
    lessons: &[Lesson<'_>],
    base: &TrafficConfig,
    effort: Effort,
) -> Result<Calibration, TrafficError> {
    let judge = Judge::of(lessons, effort.trial_s)?;
    let Effort { generations, seed, .. } = effort;
    let people = search::minimum(
        &bounds(&POPULATION),
        &usual(&POPULATION),
        generations,
        seed,
        |x: &[f64; POPULATION.len()]| {
            let cost = judge.bounded(&with_population(base, x))?;
            Ok::<f64, TrafficError>(cost + UNUSUAL_WEIGHT * unusual(&POPULATION, x))
        },
    )?;
    let free = search::minimum(
        &bounds(&FREE),
        &usual(&FREE),
        generations,
        seed.wrapping_add(1),
        |x: &[f64; FREE.len()]| {
            let cost = judge.free(base, &people.best, x)?;
            Ok::<f64, TrafficError>(cost + UNUSUAL_WEIGHT * unusual(&FREE, x))
        },
    )?;
    let config = with_population(base, &people.best);
    Ok(Calibration {
        distance: judge.bounded(&config)?,
        free_distance: judge.free(base, &people.best, &free.best)?,
        config,
        population: named(&POPULATION, &people.best),
        free: named(&FREE, &free.best),
        trials: people.trials + free.trials,
        values: (people.best, free.best),
    })
}

fn named<const N: usize>(
    knobs: &[Knob; N],
    values: &[f64; N],
) -> Vec<(&'static str, f64, (f64, f64))> {
    knobs.iter().zip(values).map(|(k, &x)| (k.key, x, k.bounds())).collect()
}

/// A recording as the searches need it, and its sorted samples.
struct Measured<'a> {
    lesson: Lesson<'a>,
    boundary: Arc<Boundary>,
    samples: Samples,
    /// Its part of the measure.
    weight: f64,
}

/// All recordings, and how far traffic is from them.
struct Judge<'a> {
    each: Vec<Measured<'a>>,
    /// Lane changes of all recordings per vehicle and km.
    changes_1_km: f64,
    trial_s: f64,
}

impl<'a> Judge<'a> {
    fn of(lessons: &[Lesson<'a>], trial_s: f64) -> Result<Self, TrafficError> {
        let has_gaps = |l: &Lesson<'_>| !l.samples.of(Quantity::Gap).is_empty();
        let all_s: f64 = lessons.iter().map(|l| l.samples.duration_s).sum();
        if !lessons.iter().any(has_gaps) || all_s < 1.0 {
            let why = "the recordings hold no vehicle behind another one".to_owned();
            return Err(TrafficError::Config { why });
        }
        let measured = |lesson: &Lesson<'a>| {
            let mut samples = lesson.samples.clone();
            samples.sort();
            let boundary = Arc::new(Boundary::of(lesson.road, lesson.recording)?);
            let weight = lesson.samples.duration_s / all_s;
            Ok(Measured { lesson: *lesson, boundary, samples, weight })
        };
        let each = lessons.iter().map(measured).collect::<Result<Vec<_>, TrafficError>>()?;
        let changes: usize = lessons.iter().map(|l| l.samples.lane_changes).sum();
        let driven_km: f64 = lessons.iter().map(|l| l.samples.driven_km).sum();
        let changes_1_km = changes as f64 / driven_km.max(1e-9);
        Ok(Self { each, changes_1_km, trial_s })
    }

    /// How far free traffic is from its recording, mean of them: those drives that flow as counted,
    /// together, since drivers who are judged by single ones become all alike.
    fn free(
        &self,
        base: &TrafficConfig,
        population: &[f64; POPULATION.len()],
        values: &[f64; FREE.len()],
    ) -> Result<f64, TrafficError> {
        let mut sum = 0.0;
        for m in &self.each {
            let measured = with_measured_demand(base, &m.lesson, &m.boundary);
            let config = with_free(&measured, population, values);
            let driven = drives_as_counted(&m.lesson, &config, self.trial_s, FREE_DRIVES)?;
            let mut all = Samples::pooled(driven.iter().map(|(_, samples)| samples));
            all.sort();
            sum += m.weight * distance(&all, &m.samples);
        }
        Ok(sum)
    }

    /// How far bounded traffic is from its recording, mean of them, and from the rate of lane
    /// changes of all.
    fn bounded(&self, config: &TrafficConfig) -> Result<f64, TrafficError> {
        let (mut changes, mut driven_km, mut apart) = (0, 0.0, 0.0);
        for m in &self.each {
            let own = drive_bounded(m.lesson.road, config, &m.boundary, BOUNDED_DRIVES)?;
            apart += m.weight * distance(&own, &m.samples);
            (changes, driven_km) = (changes + own.lane_changes, driven_km + own.driven_km);
        }
        let (rate, wanted) = (changes as f64 / f64::max(driven_km, 1e-9), self.changes_1_km);
        let changes = (rate - wanted).abs() / (rate + wanted).max(1e-9);
        Ok(apart + LANE_CHANGE_WEIGHT * changes)
    }
}

/// The weighted sum of distances.
#[must_use]
pub fn distance(a: &Samples, b: &Samples) -> f64 {
    WEIGHTS
        .iter()
        .map(|&(q, weight)| weight * kolmogorov_smirnov(a.of(q), b.of(q)).unwrap_or(1.0))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::{ClassConfig, NativeTraffic};
    use crate::replay::{Frame, Row};
    use crate::stats::observe_recording;
    use road::builtin;
    use tractrix_core::{EgoState, Geometry, Time, TrafficSource};

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
    pub(super) fn recorded(road: &Arc<Road>, config: TrafficConfig, duration_s: f64) -> Recording {
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
    fn free_traffic_is_judged_by_all_its_drives_together() {
        // The story: half a minute of free traffic is as far from half a minute of the same traffic
        // with another seed as from the recording. Judged one by one, those drivers won who made all
        // drives alike, smoother than any recording, and no recording came within 0.15.
        let road = Arc::new(builtin::flat(700.0));
        let truth = TrafficConfig {
            max_speed_m_s: 20.0,
            outflow_speed_m_s: Some(6.0),
            outflow_sigma_m_s: 2.0,
            spawn_probability: 0.04,
            seed: 9,
            ..TrafficConfig::default()
        };
        let recording = recorded(&road, truth, 30.0);
        let samples = observe_recording(&road, &recording).unwrap();
        let lesson = Lesson { recording: &recording, road: &road, samples: &samples };
        let base = TrafficConfig { seed: 40, ..TrafficConfig::default() };
        let judge = Judge::of(&[lesson], 30.0).unwrap();
        let (people, values) = (usual(&POPULATION), usual(&FREE));
        let together = judge.free(&base, &people, &values).unwrap();
        let boundary = Boundary::of(&road, &recording).unwrap();
        let config = with_free(&with_measured_demand(&base, &lesson, &boundary), &people, &values);
        let driven = drives_as_counted(&lesson, &config, 30.0, FREE_DRIVES).unwrap();
        let alone = driven.iter().map(|(_, one)| distance(one, &judge.each[0].samples));
        let alone = alone.sum::<f64>() / driven.len() as f64;
        // The distance of a mixture is never more than the mean of the distances.
        assert!(together < alone - 1e-4, "{together} together, {alone} one by one");
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
