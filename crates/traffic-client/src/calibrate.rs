//! Drivers from recordings: parameters of the native engine, so that its traffic has the measured
//! distributions of speed, gap, headway and acceleration.
//!
//! The recorded stretch is driven with the measured inflow and density; drivers (desired speed,
//! headway, standstill gap, acceleration, braking) and the speed beyond the end of the stretch,
//! which is where its congestion comes from, are searched by differential evolution (Storn &
//! Price, J. Global Optimization 11, 1997). The measure is a weighted sum of Kolmogorov-Smirnov
//! distances. Same recordings, same seed, same result.
//!
//! Left out: lane-change parameters (short recordings hold too few changes), differences between
//! classes beyond their share and length, wishes that change in time.

use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Geometry, Time, TrafficSource, VehicleClass};

use crate::TrafficError;
use crate::native::{ClassConfig, NativeTraffic, TrafficConfig};
use crate::philox::{Draws, Stream};
use crate::replay::Recording;
use crate::stats::{Observer, Quantity, Samples, kolmogorov_smirnov};

/// Weights of the distances.
const WEIGHTS: [(Quantity, f64); 4] = [
    (Quantity::Speed, 1.0),
    (Quantity::Gap, 0.3),
    (Quantity::Headway, 0.1),
    (Quantity::Accel, 0.1),
];
/// Searched quantities with their bounds, in the order of [`Knobs`].
const BOUNDS: [(&str, f64, f64); 9] = [
    ("max_speed_m_s", 5.0, 40.0),
    ("speed_factor_sigma_frac", 0.01, 0.24),
    ("headway_s", 0.5, 3.0),
    ("min_gap_m", 1.0, 6.0),
    ("accel_m_s2", 0.4, 3.0),
    ("decel_m_s2", 0.8, 4.0),
    ("outflow_speed_m_s", 0.5, 35.0),
    ("outflow_sigma_m_s", 0.0, 8.0),
    ("outflow_period_s", 3.0, 25.0),
];
type Knobs = [f64; BOUNDS.len()];
/// Drives per trial, each with a seed of its own.
const DRIVES: u64 = 4;
/// Members of the population.
const MEMBERS: usize = 18;
/// Range around the first guess in which members begin, as a part of it.
const AROUND: f64 = 0.4;
/// Differential weight and crossover probability.
const SCALE: f64 = 0.6;
const CROSSOVER: f64 = 0.8;
/// Between two looks of the observer, ticks.
const LOOK_TICKS: u64 = 10;

/// How thoroughly is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Generations of the search.
    pub generations: usize,
    /// Simulated time per drive, s; a trial has four.
    pub trial_s: f64,
    /// Seed of the search and of its traffic.
    pub seed: u64,
}

impl Default for Effort {
    fn default() -> Self {
        Self { generations: 25, trial_s: 100.0, seed: 1 }
    }
}

/// A result.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Traffic with the parameters found.
    pub config: TrafficConfig,
    /// Weighted distance to the recordings.
    pub distance: f64,
    /// Trials driven.
    pub trials: usize,
}

/// Finds parameters with which traffic on `road` looks like the recordings: `measured` are their
/// samples, taken on the same road. `base` gives everything that is not searched.
///
/// # Errors
/// [`TrafficError`] for recordings without samples or a road without lanes.
pub fn calibrate(
    road: &Arc<Road>,
    recordings: &[Recording],
    measured: &Samples,
    base: &TrafficConfig,
    effort: Effort,
) -> Result<Calibration, TrafficError> {
    if measured.of(Quantity::Gap).is_empty() || measured.duration_s < 1.0 {
        let why = "the recordings hold no vehicle behind another one".to_owned();
        return Err(TrafficError::Config { why });
    }
    let start = with_measured_demand(base, road, recordings, measured);
    let mut measured = measured.clone();
    measured.sort();
    let measured = &measured;
    // All drives together must look like the recordings, and each of them nearly so: otherwise the
    // search would find what one seed happens to do.
    let cost = |knobs: &Knobs| -> Result<f64, TrafficError> {
        let mut all = Samples::default();
        let mut single = 0.0;
        for k in 0..DRIVES {
            let seed = start.seed.wrapping_add(k);
            let config = TrafficConfig { seed, ..turned(&start, knobs) };
            let samples = drive(road, config, effort.trial_s)?;
            single += distance(&samples, measured) / DRIVES as f64;
            all.append(&samples);
        }
        Ok(0.5 * (distance(&all, measured) + single))
    };
    let draw = |generation: usize, member: usize, number: u32| {
        let index = (generation * MEMBERS + member) as u64;
        Draws::new(effort.seed, Stream::Search, index).uniform(number)
    };
    // One in three begins anywhere, the others around what the samples say.
    let center = guess(&start, measured);
    let mut members: Vec<Knobs> = (0..MEMBERS)
        .map(|m| {
            std::array::from_fn(|k| {
                let (_, low, high) = BOUNDS[k];
                let u = draw(0, m, k as u32);
                match m % 3 {
                    0 if m > 0 => low + (high - low) * u,
                    0 => center[k],
                    _ => (center[k] * (1.0 + AROUND * (2.0 * u - 1.0))).clamp(low, high),
                }
            })
        })
        .collect();
    let mut costs = members.iter().map(cost).collect::<Result<Vec<f64>, _>>()?;
    for generation in 1..=effort.generations {
        for m in 0..MEMBERS {
            let pick = |number: u32| (draw(generation, m, number) * MEMBERS as f64) as usize;
            let best = (0..MEMBERS).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
            // Half of the trials start from the best, the others from anyone.
            let from = if draw(generation, m, 100) < 0.5 { best } else { pick(101) };
            let (a, b, forced) = (pick(102), pick(103), pick(104) % BOUNDS.len());
            let trial: Knobs = std::array::from_fn(|k| {
                let (_, low, high) = BOUNDS[k];
                let crossed = k == forced || draw(generation, m, k as u32) < CROSSOVER;
                let moved = members[from][k] + SCALE * (members[a][k] - members[b][k]);
                if crossed { moved.clamp(low, high) } else { members[m][k] }
            });
            let trial_cost = cost(&trial)?;
            if trial_cost <= costs[m] {
                (members[m], costs[m]) = (trial, trial_cost);
            }
        }
    }
    let best = (0..MEMBERS).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
    let trials = MEMBERS * (effort.generations + 1);
    Ok(Calibration { config: turned(&start, &members[best]), distance: costs[best], trials })
}

/// The weighted sum of distances.
#[must_use]
pub fn distance(a: &Samples, b: &Samples) -> f64 {
    WEIGHTS
        .iter()
        .map(|&(q, weight)| weight * kolmogorov_smirnov(a.of(q), b.of(q)).unwrap_or(1.0))
        .sum()
}

/// Native traffic alone on a road for a while after its warm-up, looked at every second.
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
    road: &Road,
    recordings: &[Recording],
    measured: &Samples,
) -> TrafficConfig {
    let mut config = base.clone();
    let lanes_m = lanes_m(road);
    let density_1_km = measured.density_1_km(lanes_m);
    // Demand a little above the measured flow: the queue before the stretch is always there when
    // the flow is set by the congestion beyond it.
    let flow_1_s = 1.05 * measured.flow_1_h(lanes_m) / 3600.0;
    config.spawn_probability = (flow_1_s * config.spawn_interval_s).clamp(0.0, 1.0);
    config.initial_density_1_km = Some(density_1_km.min(120.0));
    // Long enough for the speed beyond the end to reach back over a stretch of a kilometre.
    config.warm_up_s = 150.0;
    let tracks = || recordings.iter().flat_map(|r| &r.tracks);
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
    let rest = [start.car.accel_m_s2, start.car.decel_m_s2, speed.mean, speed.sigma, 12.0];
    let all: Vec<f64> = wish.into_iter().chain(rest).collect();
    std::array::from_fn(|k| {
        let (_, low, high) = BOUNDS[k];
        all.get(k).copied().unwrap_or(low).clamp(low, high)
    })
}

/// The traffic with these values. Vans and trucks keep their proportions to cars.
fn turned(start: &TrafficConfig, knobs: &Knobs) -> TrafficConfig {
    let [max_speed, sigma, headway, gap, accel, decel, out_speed, out_sigma, out_period] = *knobs;
    let mut config = start.clone();
    let car = start.car;
    let change = |c: &mut ClassConfig| {
        c.speed_factor_sigma_frac = sigma.min(0.24 * c.speed_factor_frac);
        c.headway_s = (c.headway_s * headway / car.headway_s).clamp(0.3, 10.0);
        c.min_gap_m = (c.min_gap_m * gap / car.min_gap_m).clamp(0.5, 20.0);
        c.accel_m_s2 = (c.accel_m_s2 * accel / car.accel_m_s2).clamp(0.1, 6.0);
        c.decel_m_s2 = (c.decel_m_s2 * decel / car.decel_m_s2).clamp(0.3, 5.0);
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
        let measured = drive(&road, truth, 200.0).unwrap();
        let effort = Effort { generations: 6, trial_s: 40.0, seed: 3 };
        let found = calibrate(&road, &[], &measured, &TrafficConfig::default(), effort).unwrap();
        // Judged with traffic that was not driven in the search.
        let other = TrafficConfig { seed: 1234, ..found.config };
        let samples = drive(&road, other, 200.0).unwrap();
        let apart = |a: &Samples| {
            kolmogorov_smirnov(a.of(Quantity::Speed), measured.of(Quantity::Speed)).unwrap()
        };
        let before = drive(&road, TrafficConfig::default(), 200.0).unwrap();
        // A drive of 200 s is a sample itself: ten periods of the speed beyond the end.
        let (found, before) = (apart(&samples), apart(&before));
        assert!(found < 0.3 && found < 0.4 * before, "{found}, {before} before");
    }
}
