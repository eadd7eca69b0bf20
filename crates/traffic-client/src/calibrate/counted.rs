//! Drives of free traffic that flow as it was counted.
//!
//! Half a minute of free traffic is as far from another half minute of it as from a recording: where
//! a queue stands and whether it has dissolved is chance. Flow and density, which free traffic is
//! given anyway, say how that chance fell. So many seeds are driven, and those are kept whose traffic
//! comes nearest to both: rejection sampling (Marin, Pudlo, Robert, Ryder, Stat. Comput. 22 (2012)
//! 1167, algorithm 2). Speeds are compared by their mean alone.

use super::{Lesson, drive, lanes_m};
use crate::TrafficError;
use crate::native::TrafficConfig;
use crate::stats::Samples;

/// How many seeds are driven, and how many of them are accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RejectionSampling {
    /// Driven: the seeds after that of the traffic.
    pub candidates: u64,
    /// Of these the nearest.
    pub accepted: usize,
}

impl Default for RejectionSampling {
    /// With 16, 32, 64, 128 and 256 candidates recordings that were held back are ever nearer.
    fn default() -> Self {
        Self { candidates: 256, accepted: 8 }
    }
}

/// What detectors give of the traffic on a stretch (Edie, Proc. 2nd Int. Symp. on the Theory of Traffic
/// Flow (1963) 139).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MacroscopicState {
    /// Flow over density: space mean speed, m/s.
    pub mean_speed_m_s: f64,
    /// Vehicles per kilometre and lane.
    pub density_1_km: f64,
}

impl MacroscopicState {
    /// That of samples of a road with so many metres of lanes.
    #[must_use]
    pub fn of(samples: &Samples, lanes_m: f64) -> Self {
        let density_1_km = samples.density_1_km(lanes_m);
        let mean_speed_m_s = samples.flow_1_h(lanes_m) / 3.6 / density_1_km.max(1e-9);
        Self { mean_speed_m_s, density_1_km }
    }

    /// How far apart two are: squares of the logarithms of both ratios, summed. A mean below
    /// 0.1 m/s is a standstill, and less than one vehicle in 10 km an empty road.
    #[must_use]
    pub fn apart(&self, other: &Self) -> f64 {
        let log_ratio = |a: f64, b: f64, least: f64| libm::log(a.max(least) / b.max(least));
        let speed = log_ratio(self.mean_speed_m_s, other.mean_speed_m_s, 0.1);
        let density = log_ratio(self.density_1_km, other.density_1_km, 0.1);
        speed * speed + density * density
    }
}

/// Free traffic that flows most nearly as in the recording: seeds and what was seen of each for so
/// long after its warm-up, the nearest first.
///
/// # Errors
/// [`TrafficError`] for a configuration or road that cannot be used.
pub fn drives_as_counted(
    lesson: &Lesson<'_>,
    free: &TrafficConfig,
    duration_s: f64,
    sampling: RejectionSampling,
) -> Result<Vec<(u64, Samples)>, TrafficError> {
    let lanes_m = lanes_m(lesson.road);
    let measured = MacroscopicState::of(lesson.samples, lanes_m);
    let mut nearest: Vec<(f64, u64, Samples)> = Vec::new();
    for k in 1..=sampling.candidates {
        let seed = free.seed.wrapping_add(k);
        let samples = drive(lesson.road, TrafficConfig { seed, ..free.clone() }, duration_s)?;
        let apart = MacroscopicState::of(&samples, lanes_m).apart(&measured);
        let place = nearest.partition_point(|other| other.0 <= apart);
        if place < sampling.accepted {
            nearest.insert(place, (apart, seed, samples));
            nearest.truncate(sampling.accepted);
        }
    }
    Ok(nearest.into_iter().map(|(_, seed, samples)| (seed, samples)).collect())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::calibrate::tests::recorded;
    use crate::stats::{Quantity, kolmogorov_smirnov, observe_recording};
    use road::builtin;

    #[test]
    fn counts_of_a_road_are_far_apart_by_speed_and_by_density() {
        let at = |mean_speed_m_s, density_1_km| MacroscopicState { mean_speed_m_s, density_1_km };
        assert_eq!(at(10.0, 20.0).apart(&at(10.0, 20.0)), 0.0);
        let twice = std::f64::consts::LN_2 * std::f64::consts::LN_2;
        assert!((at(10.0, 20.0).apart(&at(5.0, 40.0)) - 2.0 * twice).abs() < 1e-12);
        assert!(at(0.0, 0.0).apart(&at(10.0, 20.0)).is_finite());
    }

    /// A queue stands here or there by chance: the mean speed of half a minute says more of that half
    /// minute than other seeds of the same traffic do.
    #[test]
    fn traffic_that_flows_as_counted_is_nearer_than_other_traffic_of_the_same_kind() {
        let road = Arc::new(builtin::flat(700.0));
        let jam = TrafficConfig {
            max_speed_m_s: 20.0,
            inflow_speed_m_s: Some(14.0),
            outflow_speed_m_s: Some(8.0),
            outflow_sigma_m_s: 4.0,
            outflow_period_s: 10.0,
            spawn_probability: 0.04,
            initial_density_1_km: Some(35.0),
            warm_up_s: 20.0,
            ..TrafficConfig::default()
        };
        let (mut counted, mut others) = (0.0, 0.0);
        for truth in [5001, 5002, 5003] {
            let truth = TrafficConfig { seed: truth, ..jam.clone() };
            let recording = recorded(&road, truth, 30.0);
            let samples = observe_recording(&road, &recording).unwrap();
            let lesson = Lesson { recording: &recording, road: &road, samples: &samples };
            let apart = |candidates: u64| {
                let sampling = RejectionSampling { candidates, accepted: 8 };
                let drives = drives_as_counted(&lesson, &jam, 30.0, sampling).unwrap();
                assert_eq!(drives.len(), 8);
                let all = Samples::pooled(drives.iter().map(|(_, one)| one));
                kolmogorov_smirnov(all.of(Quantity::Speed), samples.of(Quantity::Speed)).unwrap()
            };
            counted += apart(128);
            others += apart(8);
        }
        assert!(counted < 0.7 * others, "{counted}, others {others}");
    }
}
