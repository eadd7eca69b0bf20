//! What a truck would see of a scene: range, field of view, noise, latency, dropouts, wrong classes.
//!
//! Off by default. Every draw depends on (seed, vehicle, frame of 0.1 s) alone, so the same run
//! gives the same perception whatever else happens. Left out: occlusion, false objects, tracking.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use tractrix_core::{EgoState, Neighbour, Scene, Time, TrafficSource, VehicleClass};

use crate::TrafficError;
use crate::philox::{Draws, Stream};

/// A frame of the sensors, ns: noise holds for one.
const FRAME_NS: i64 = 100_000_000;
/// Scenes kept for the latency.
const KEPT: usize = 4096;

/// What the sensors do to a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PerceptionConfig {
    /// Off: scenes pass unchanged.
    pub enabled: bool,
    /// Seed of the draws.
    pub seed: u64,
    /// Range, m, from the ego's reference point to the nearest end of a vehicle.
    pub range_m: f64,
    /// Field of view, rad, centred ahead; 2π sees all around.
    pub field_of_view_rad: f64,
    /// Standard deviation of the position along the road, m.
    pub position_sigma_m: f64,
    /// Standard deviation of the position across the road, m.
    pub lateral_sigma_m: f64,
    /// Standard deviation of the speed, m/s.
    pub speed_sigma_m_s: f64,
    /// Age of what is seen, s. The scene keeps its true time stamp.
    pub latency_s: f64,
    /// Probability that a vehicle is missing in a frame.
    pub dropout_frac: f64,
    /// Probability that a vehicle is given a wrong class (for as long as it is seen).
    pub wrong_class_frac: f64,
}

impl Default for PerceptionConfig {
    /// Off; the values are those of a long-range radar with camera, once it is switched on.
    fn default() -> Self {
        Self {
            enabled: false,
            seed: 1,
            range_m: 200.0,
            field_of_view_rad: core::f64::consts::TAU,
            position_sigma_m: 0.3,
            lateral_sigma_m: 0.15,
            speed_sigma_m_s: 0.15,
            latency_s: 0.1,
            dropout_frac: 0.01,
            wrong_class_frac: 0.0,
        }
    }
}

impl PerceptionConfig {
    /// Checks every number.
    ///
    /// # Errors
    /// [`TrafficError::Config`] names all that are out of range.
    pub fn validate(&self) -> Result<(), TrafficError> {
        let bad: Vec<String> = [
            ("range_m", self.range_m, 0.0, 1e4),
            ("field_of_view_rad", self.field_of_view_rad, 0.0, core::f64::consts::TAU),
            ("position_sigma_m", self.position_sigma_m, 0.0, 100.0),
            ("lateral_sigma_m", self.lateral_sigma_m, 0.0, 10.0),
            ("speed_sigma_m_s", self.speed_sigma_m_s, 0.0, 20.0),
            ("latency_s", self.latency_s, 0.0, 5.0),
            ("dropout_frac", self.dropout_frac, 0.0, 1.0),
            ("wrong_class_frac", self.wrong_class_frac, 0.0, 1.0),
        ]
        .into_iter()
        .filter(|&(_, value, low, high)| !(value >= low && value <= high))
        .map(|(key, value, low, high)| {
            format!("perception.{key} = {value} is outside [{low}, {high}]")
        })
        .collect();
        if bad.is_empty() { Ok(()) } else { Err(TrafficError::Config { why: bad.join("; ") }) }
    }
}

/// A source seen through sensors.
#[derive(Debug, Clone)]
pub struct Perceived<S> {
    inner: S,
    config: PerceptionConfig,
    past: VecDeque<Scene>,
    spare: Vec<Scene>,
    scene: Scene,
}

impl<S> Perceived<S> {
    /// Puts sensors before a source.
    ///
    /// # Errors
    /// [`TrafficError::Config`].
    pub fn new(inner: S, config: PerceptionConfig) -> Result<Self, TrafficError> {
        config.validate()?;
        let (past, spare) = (VecDeque::new(), Vec::new());
        Ok(Self { inner, config, past, spare, scene: Scene::default() })
    }

    /// The source inside.
    pub fn inner_mut(&mut self) -> &mut S {
        &mut self.inner
    }

    /// The source inside.
    #[must_use]
    pub fn inner(&self) -> &S {
        &self.inner
    }

    /// The latest scene as it is, while the sensors are on: what a run is judged by. `None` while
    /// they are off, when what is seen is what is there.
    #[must_use]
    pub fn truth(&self) -> Option<&Scene> {
        self.past.back()
    }
}

impl<S: TrafficSource<Error = TrafficError>> TrafficSource for Perceived<S> {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        if !self.config.enabled {
            return self.inner.advance(now, ego);
        }
        let truth = self.inner.advance(now, ego)?;
        let mut copy = self.spare.pop().unwrap_or_default();
        copy.time = truth.time;
        copy.neighbours.clone_from(&truth.neighbours);
        self.past.push_back(copy);
        let due = now.plus_nanos(-(self.config.latency_s * 1e9) as i64);
        // The youngest scene that is old enough stays first; until there is one, nothing is seen.
        while self.past.len() > KEPT || self.past.get(1).is_some_and(|next| next.time <= due) {
            self.spare.extend(self.past.pop_front());
        }
        self.scene.neighbours.clear();
        self.scene.time = due.max(Time::ZERO);
        if let Some(seen) = self.past.front().filter(|scene| scene.time <= due) {
            self.scene.time = seen.time;
            let frame = seen.time.0.div_euclid(FRAME_NS);
            let seen = seen.neighbours.iter().filter_map(|n| look(&self.config, ego, n, frame));
            self.scene.neighbours.extend(seen);
        }
        self.scene
            .neighbours
            .sort_unstable_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m).then(a.id.cmp(&b.id)));
        Ok(&self.scene)
    }
}

/// One vehicle as the sensors give it; `None` if they do not.
fn look(config: &PerceptionConfig, ego: &EgoState, n: &Neighbour, frame: i64) -> Option<Neighbour> {
    // The point of the body nearest to the ego along the road.
    let ahead_m = ego.s_m.clamp(n.rear_s_m, n.front_s_m) - ego.s_m;
    let left_m = n.d_m - ego.d_m;
    if libm::hypot(ahead_m, left_m) > config.range_m {
        return None;
    }
    if libm::fabs(libm::atan2(left_m, ahead_m)) > 0.5 * config.field_of_view_rad {
        return None;
    }
    let draws = Draws::new(config.seed ^ n.id.rotate_left(32), Stream::Perception, frame as u64);
    if draws.uniform(0) < config.dropout_frac {
        return None;
    }
    let along_m = config.position_sigma_m * draws.bell(1);
    let across_m = config.lateral_sigma_m * draws.bell(2);
    let speed_m_s = (n.speed_m_s + config.speed_sigma_m_s * draws.bell(3)).max(0.0);
    let (sin, cos) = (libm::sin(n.yaw_rad), libm::cos(n.yaw_rad));
    let life = Draws::new(config.seed, Stream::Perception, n.id | 1 << 63);
    let class = if life.uniform(4) < config.wrong_class_frac {
        match n.class {
            VehicleClass::Car => VehicleClass::Van,
            VehicleClass::Van => VehicleClass::Car,
            VehicleClass::Truck => VehicleClass::Van,
            VehicleClass::Emergency => VehicleClass::Van,
            VehicleClass::Barrier => VehicleClass::Car,
        }
    } else {
        n.class
    };
    Some(Neighbour {
        class,
        front_s_m: n.front_s_m + along_m,
        rear_s_m: n.rear_s_m + along_m,
        d_m: n.d_m + across_m,
        x_m: n.x_m + along_m * cos - across_m * sin,
        y_m: n.y_m + along_m * sin + across_m * cos,
        speed_m_s,
        ..*n
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of cars that stand still, one every 20 m.
    struct Row(Scene);

    impl TrafficSource for Row {
        type Error = TrafficError;
        fn advance(&mut self, now: Time, _ego: &EgoState) -> Result<&Scene, TrafficError> {
            self.0.time = now;
            self.0.neighbours = (-20..=20)
                .map(|k| {
                    let front_s_m = 20.0 * f64::from(k) + 0.001 * now.seconds();
                    Neighbour {
                        id: (k + 100) as u64,
                        front_s_m,
                        rear_s_m: front_s_m - 5.0,
                        speed_m_s: 15.0,
                        ..Neighbour::default()
                    }
                })
                .collect();
            Ok(&self.0)
        }
    }

    fn clear() -> PerceptionConfig {
        PerceptionConfig {
            enabled: true,
            position_sigma_m: 0.0,
            lateral_sigma_m: 0.0,
            speed_sigma_m_s: 0.0,
            latency_s: 0.0,
            dropout_frac: 0.0,
            ..PerceptionConfig::default()
        }
    }

    fn see(config: PerceptionConfig, ticks: i64) -> Vec<Scene> {
        let mut p = Perceived::new(Row(Scene::default()), config).unwrap();
        (0..ticks)
            .map(|k| p.advance(Time(k * 100_000_000), &EgoState::default()).unwrap().clone())
            .collect()
    }

    #[test]
    fn switched_off_it_changes_nothing() {
        let scene = &see(PerceptionConfig::default(), 1)[0];
        assert_eq!(scene.neighbours.len(), 41);
    }

    #[test]
    fn range_and_field_of_view_cut_the_scene() {
        let near = &see(PerceptionConfig { range_m: 52.0, ..clear() }, 1)[0];
        assert!(near.neighbours.iter().all(|n| n.front_s_m > -57.1 && n.rear_s_m < 52.1));
        assert_eq!(near.neighbours.len(), 5);
        let ahead = &see(PerceptionConfig { field_of_view_rad: 1.0, ..clear() }, 1)[0];
        assert!(ahead.neighbours.iter().all(|n| n.front_s_m >= 0.0));
        // The one alongside and the ten within 200 m ahead.
        assert_eq!(ahead.neighbours.len(), 11);
    }

    #[test]
    fn latency_shows_an_old_scene_with_its_old_stamp() {
        let scenes = see(PerceptionConfig { latency_s: 0.3, ..clear() }, 10);
        assert!(scenes[2].neighbours.is_empty());
        assert_eq!(scenes[9].time, Time(600_000_000));
        let front = scenes[9].neighbours.iter().find(|n| n.id == 100).unwrap().front_s_m;
        assert!((front - 0.0006).abs() < 1e-12);
    }

    #[test]
    fn noise_and_dropouts_have_their_sizes_and_repeat_with_the_seed() {
        let config =
            PerceptionConfig { position_sigma_m: 0.5, dropout_frac: 0.2, range_m: 1e4, ..clear() };
        let scenes = see(config.clone(), 500);
        let all: Vec<f64> = scenes
            .iter()
            .flat_map(|s| &s.neighbours)
            .map(|n| n.front_s_m - 20.0 * (n.id as f64 - 100.0))
            .collect();
        assert!((all.len() as f64 / (500.0 * 41.0) - 0.8).abs() < 0.01);
        let sigma = (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt();
        assert!((sigma - 0.5).abs() < 0.03, "{sigma}");
        assert_eq!(see(config.clone(), 500), scenes);
        assert_ne!(see(PerceptionConfig { seed: 2, ..config }, 500), scenes);
    }

    #[test]
    fn speed_and_offset_have_noise_of_their_own_sizes() {
        let config = PerceptionConfig {
            speed_sigma_m_s: 0.4,
            lateral_sigma_m: 0.2,
            range_m: 1e4,
            ..clear()
        };
        let scenes = see(config, 500);
        let sigma = |of: fn(&Neighbour) -> f64| {
            let all: Vec<f64> = scenes.iter().flat_map(|s| &s.neighbours).map(of).collect();
            (all.iter().map(|x| x * x).sum::<f64>() / all.len() as f64).sqrt()
        };
        let (speed, offset) = (sigma(|n| n.speed_m_s - 15.0), sigma(|n| n.d_m));
        assert!((speed - 0.4).abs() < 0.02, "{speed}");
        assert!((offset - 0.2).abs() < 0.01, "{offset}");
        assert!(sigma(|n| n.y_m - n.d_m) < 1e-12, "the map position moves with the offset");
        let along = |n: &Neighbour| n.front_s_m - n.rear_s_m - 5.0;
        assert!(sigma(along) < 1e-12, "the length stays");
    }

    #[test]
    fn a_wrong_class_is_as_frequent_as_asked_for_and_stays_with_its_vehicle() {
        let of = |wrong_class_frac, seed| {
            let config = PerceptionConfig { wrong_class_frac, seed, range_m: 1e4, ..clear() };
            let scenes = see(config, 20);
            let classes = |s: &Scene| s.neighbours.iter().map(|n| n.class).collect::<Vec<_>>();
            let first = classes(&scenes[0]);
            assert!(scenes.iter().all(|s| classes(s) == first), "classes do not flicker");
            first.iter().filter(|&&class| class != VehicleClass::Car).count()
        };
        assert_eq!((of(0.0, 1), of(1.0, 1)), (0, 41));
        let third: usize = (0..50).map(|seed| of(0.3, seed)).sum();
        assert!((third as f64 / (50.0 * 41.0) - 0.3).abs() < 0.03, "{third}");
    }

    #[test]
    fn bad_values_are_named() {
        let e = Perceived::new((), PerceptionConfig { dropout_frac: 2.0, ..clear() }).unwrap_err();
        assert!(e.to_string().contains("perception.dropout_frac = 2"));
    }
}
