//! Drivers from recordings: parameters of the native engine, so that its traffic has the measured
//! distributions of speed, gap, headway and acceleration, and the measured rate of lane changes.
//!
//! Two kinds of traffic are driven. *Bounded* traffic begins with the vehicles of a recording and
//! gets its arrivals and the speed at its end from it ([`Boundary`]). *Free* traffic has the measured
//! flow, density and classes only, and speeds of the traffic before and beyond the stretch (the
//! *rim*: where its congestion comes from); it is what a scenario gets. In both, a weighted sum of
//! Kolmogorov-Smirnov distances is small where traffic looks like the recordings; what counts is the
//! mean of the distances to each of them, which is how far a further one will be. Differential
//! evolution searches three times:
//! 1. the drivers (desired speed, headway, standstill gap, acceleration, braking, MOBIL's
//!    politeness, threshold and bias), in bounded traffic;
//! 2. how they follow again (desired speed, headway, gap, acceleration), from there, in free traffic
//!    with the rim at its measured speeds, as long as the bounded traffic is hardly worse for it:
//!    what drivers wish for in traffic in which few are hindered shows in free traffic only;
//! 3. the rim, in free traffic.
//!
//! Same recordings, same seed, same result. Left out: differences between classes beyond their share
//! and length, wishes that change in time.

use std::sync::Arc;

use road::Road;

use crate::TrafficError;
use crate::native::{Boundary, TrafficConfig};
use crate::replay::Recording;
use crate::search;
use crate::stats::{Quantity, Samples, kolmogorov_smirnov};

mod drives;
mod knobs;

pub use drives::{drive, drive_bounded, lanes_m};

use knobs::{BOUNDS, DRIVERS, FOLLOWING, Knobs, RIM, guess, turned, with_measured_demand};

/// Weights of the distances.
const WEIGHTS: [(Quantity, f64); 4] = [
    (Quantity::Speed, 1.0),
    (Quantity::Gap, 0.3),
    (Quantity::Headway, 0.1),
    (Quantity::Accel, 0.1),
];
/// Weight of the rate of lane changes: its difference over its sum, 0 to 1.
const LANE_CHANGE_WEIGHT: f64 = 0.2;
/// Drives of the free traffic per trial, each with a seed of its own.
const DRIVES: u64 = 6;
/// Drives of each recording's bounded traffic per trial.
const BOUNDED_DRIVES: u64 = 2;

/// What the bounded traffic may get worse by while the free traffic gets better; more than this is
/// paid for with this weight.
const HARDLY_WORSE: f64 = 0.01;
const WORSE_WEIGHT: f64 = 5.0;

/// How thoroughly is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Generations of the search.
    pub generations: usize,
    /// Simulated time per drive of the free traffic after its warm-up, s; a trial has six.
    pub trial_s: f64,
    /// Seed of the search and of its traffic.
    pub seed: u64,
}

impl Default for Effort {
    fn default() -> Self {
        Self { generations: 25, trial_s: 120.0, seed: 1 }
    }
}

/// A result.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Traffic with the parameters found.
    pub config: TrafficConfig,
    /// Weighted distance of the bounded traffic to the recordings, lane changes included.
    pub distance: f64,
    /// Weighted distance of the free traffic to a recording, mean of them.
    pub free_distance: f64,
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
    let judge = Judge::of(lessons, base, effort.trial_s)?;
    let Effort { generations, seed, .. } = effort;
    let knobs = guess(&judge.start, &judge.together, judge.rims());
    let alone = search::minimum(
        &range_of::<DRIVERS>(0),
        &part_of(&knobs, 0),
        generations,
        seed,
        |drivers: &[f64; DRIVERS]| judge.bounded(&turned(&judge.start, &with(&knobs, 0, drivers))),
    )?;
    let knobs = with(&knobs, 0, &alone.best);
    let reached = judge.bounded(&turned(&judge.start, &knobs))?;
    let both = search::minimum(
        &range_of::<FOLLOWING>(0),
        &part_of(&knobs, 0),
        generations / 2,
        seed.wrapping_add(1),
        |following: &[f64; FOLLOWING]| {
            let config = turned(&judge.start, &with(&knobs, 0, following));
            let worse = (judge.bounded(&config)? - reached - HARDLY_WORSE).max(0.0);
            Ok::<f64, TrafficError>(judge.free(&config)? + WORSE_WEIGHT * worse)
        },
    )?;
    let knobs = with(&knobs, 0, &both.best);
    let rim = search::minimum(
        &range_of::<RIM>(DRIVERS),
        &part_of(&knobs, DRIVERS),
        generations / 2,
        seed.wrapping_add(2),
        |rim: &[f64; RIM]| judge.free(&turned(&judge.start, &with(&knobs, DRIVERS, rim))),
    )?;
    let config = turned(&judge.start, &with(&knobs, DRIVERS, &rim.best));
    let (distance, free_distance) = (judge.bounded(&config)?, judge.free(&config)?);
    let trials = alone.trials + both.trials + rim.trials;
    Ok(Calibration { config, distance, free_distance, trials })
}

/// Bounds of the knobs from this one on.
fn range_of<const N: usize>(first: usize) -> [(f64, f64); N] {
    std::array::from_fn(|k| {
        let (_, low, high) = BOUNDS[first + k];
        (low, high)
    })
}

fn part_of<const N: usize>(knobs: &Knobs, first: usize) -> [f64; N] {
    std::array::from_fn(|k| knobs[first + k])
}

/// The knobs with others from this one on.
fn with<const N: usize>(knobs: &Knobs, first: usize, part: &[f64; N]) -> Knobs {
    let mut all = *knobs;
    all[first..first + N].copy_from_slice(part);
    all
}

/// A recording as the bounded traffic needs it, and its sorted samples.
struct Measured<'a> {
    boundary: Arc<Boundary>,
    road: &'a Arc<Road>,
    samples: Samples,
}

/// All recordings, and how far traffic is from them.
struct Judge<'a> {
    each: Vec<Measured<'a>>,
    /// Samples of all recordings, sorted.
    together: Samples,
    /// Road of the free traffic.
    road: &'a Arc<Road>,
    /// The measured demand.
    start: TrafficConfig,
    trial_s: f64,
}

impl<'a> Judge<'a> {
    fn of(
        lessons: &[Lesson<'a>],
        base: &TrafficConfig,
        trial_s: f64,
    ) -> Result<Self, TrafficError> {
        let mut together = lessons.first().map(|l| l.samples.clone()).unwrap_or_default();
        lessons.iter().skip(1).for_each(|lesson| together.append(lesson.samples));
        let Some(first) = lessons
            .first()
            .filter(|_| !together.of(Quantity::Gap).is_empty() && together.duration_s >= 1.0)
        else {
            let why = "the recordings hold no vehicle behind another one".to_owned();
            return Err(TrafficError::Config { why });
        };
        together.sort();
        let measured = |lesson: &Lesson<'a>| {
            let mut samples = lesson.samples.clone();
            samples.sort();
            let boundary = Arc::new(Boundary::of(lesson.road, lesson.recording)?);
            Ok(Measured { boundary, road: lesson.road, samples })
        };
        let start = with_measured_demand(base, lessons, &together);
        let each = lessons.iter().map(measured).collect::<Result<Vec<_>, TrafficError>>()?;
        Ok(Self { each, together, road: first.road, start, trial_s })
    }

    fn rims(&self) -> impl Iterator<Item = &Boundary> + Clone {
        self.each.iter().map(|measured| &*measured.boundary)
    }

    /// How far free traffic is from a recording: mean of all pairs of a drive and a recording, so
    /// that a recording that is unlike all others weighs no more than they do, and what one seed
    /// happens to do does not count as found.
    fn free(&self, config: &TrafficConfig) -> Result<f64, TrafficError> {
        let mut sum = 0.0;
        for k in 0..DRIVES {
            let seed = self.start.seed.wrapping_add(k);
            let config = TrafficConfig { seed, ..config.clone() };
            let mut samples = drive(self.road, config, self.trial_s)?;
            samples.sort();
            sum += self.each.iter().map(|p| distance(&samples, &p.samples)).sum::<f64>();
        }
        Ok(sum / (DRIVES as usize * self.each.len()) as f64)
    }

    /// How far bounded traffic is from its own recording, mean of them, and from the rate of lane
    /// changes of all.
    fn bounded(&self, config: &TrafficConfig) -> Result<f64, TrafficError> {
        let (mut together, mut apart) = (Samples::default(), 0.0);
        for p in &self.each {
            let own = drive_bounded(p.road, config, &p.boundary, BOUNDED_DRIVES)?;
            apart += distance(&own, &p.samples) / self.each.len() as f64;
            together.append(&own);
        }
        let (rate, wanted) = (together.lane_changes_1_km(), self.together.lane_changes_1_km());
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
