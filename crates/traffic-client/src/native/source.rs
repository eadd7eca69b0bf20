//! Native traffic as a [`TrafficSource`]: ticks of 0.1 s inside, any instant outside.

use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Geometry, Scene, Time, TrafficSource};

use super::boundary::Boundary;
use super::config::TrafficConfig;
use super::engine::{Engine, State, TICK_S};
use super::lanes::LaneMap;
use super::publish::publish;
use super::workers::Workers;
use crate::TrafficError;

/// No vehicle with its gap is shorter, m.
const SHORTEST_M: f64 = 5.0;
/// Length of a tick, ns.
const TICK_NS: i64 = 100_000_000;

/// IDM + MOBIL traffic on a road. `clone_from` copies into the memory that is there.
#[derive(Debug)]
pub struct NativeTraffic {
    engine: Engine,
    road: Arc<Road>,
    geometry: Geometry,
    /// Start of the current tick; `None` before the first call.
    tick_start: Option<Time>,
    scene: Scene,
    /// Vehicles so near have map poses in scenes, m.
    poses_within_m: f64,
}

impl Clone for NativeTraffic {
    fn clone(&self) -> Self {
        let mut scene = self.scene.clone();
        let kept = &self.scene.neighbours;
        scene.neighbours.reserve(kept.capacity() - kept.len());
        Self { engine: self.engine.clone(), road: Arc::clone(&self.road), scene, ..*self }
    }

    fn clone_from(&mut self, from: &Self) {
        let Self { engine, road, geometry, tick_start, scene, poses_within_m } = from;
        self.engine.clone_from(engine);
        self.road.clone_from(road);
        self.scene.time = scene.time;
        self.scene.neighbours.clone_from(&scene.neighbours);
        (self.geometry, self.tick_start) = (*geometry, *tick_start);
        self.poses_within_m = *poses_within_m;
    }
}

/// Everything that changes in a [`NativeTraffic`]: save it, restore it, the same bits go on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NativeSnapshot {
    state: State,
    tick_start: Option<Time>,
}

/// Counts over a run of native traffic.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NativeCounts {
    /// Vehicles on the road.
    pub vehicles: usize,
    /// Vehicles that have entered since the start, the first fill included.
    pub entered: u64,
    /// Vehicles that came to an entry of the road, those that wait before it included.
    pub arrived: u64,
    /// Vehicles that wait before the road for room on it.
    pub waiting: u64,
    /// Distance driven by all vehicles, km.
    pub driven_km: f64,
    /// Lane changes begun.
    pub lane_changes: u64,
}

impl NativeTraffic {
    /// Traffic on `road` around an ego of the given geometry, filled and warmed up.
    ///
    /// # Errors
    /// [`TrafficError::Config`] for values out of range, [`TrafficError::Road`] for a road without
    /// lanes.
    pub fn new(
        road: Arc<Road>,
        geometry: Geometry,
        config: TrafficConfig,
    ) -> Result<Self, TrafficError> {
        let map = Arc::new(super::from_road::lane_map(&road)?);
        Self::with_map(map, road, geometry, config)
    }

    /// As [`NativeTraffic::new`] with the tables of the road that other traffic on it has already
    /// ([`NativeTraffic::map`]).
    ///
    /// # Errors
    /// As [`NativeTraffic::new`].
    pub fn with_map(
        map: Arc<LaneMap>,
        road: Arc<Road>,
        geometry: Geometry,
        config: TrafficConfig,
    ) -> Result<Self, TrafficError> {
        config.validate()?;
        config.schedule.validate(Some(&road))?;
        if config.window.is_some_and(|window| window.awake_m.is_some()) && !map.is_even() {
            let why =
                format!("window.awake_m: not on {}, which is not the same all along", road.name());
            return Err(TrafficError::Config { why });
        }
        let warm_up = (config.warm_up_s / TICK_S) as u64;
        let mut engine = Engine::new(Arc::new(config), map);
        engine.fill();
        engine.state.plot.begin(warm_up, 0.0, &engine.config.schedule);
        for _ in 0..warm_up {
            engine.decide();
            engine.commit();
        }
        let scene = Scene::default();
        Ok(Self { engine, road, geometry, tick_start: None, scene, poses_within_m: f64::INFINITY })
    }

    /// Traffic that goes on from the last scene of another source, as seen by an ego at `now`: its
    /// vehicles where they are, with drivers of our own, and our traffic beyond the stretch that a
    /// scene covers, none of it closer to the ego than both can stop. A lane change goes on from
    /// where it is.
    ///
    /// # Errors
    /// As [`NativeTraffic::new`]; [`TrafficError::Ego`] for an ego that is not finite.
    pub fn take_over(
        road: Arc<Road>,
        geometry: Geometry,
        config: TrafficConfig,
        scene: &Scene,
        ego: &EgoState,
        now: Time,
    ) -> Result<Self, TrafficError> {
        ego.check_finite()?;
        let mut traffic = Self::new(road, geometry, config)?;
        let first = traffic.engine.adopt(scene, ego.s_m);
        let engine = &mut traffic.engine;
        let (tick, time_s) = (engine.state.tick, scene.time.seconds());
        engine.state.plot.begin(tick, time_s, &engine.config.schedule);
        traffic.see_ego(ego, now, scene.time);
        traffic.engine.clear_around_ego(first);
        traffic.tick_start = Some(scene.time);
        traffic.engine.decide();
        Ok(traffic)
    }

    /// Traffic that begins with the vehicles of a measured boundary and gets its arrivals from it:
    /// what happens on the road in between is the drivers' own. No warm-up, no window.
    ///
    /// # Errors
    /// As [`NativeTraffic::new`].
    pub fn bounded(
        road: Arc<Road>,
        geometry: Geometry,
        config: TrafficConfig,
        boundary: Arc<Boundary>,
    ) -> Result<Self, TrafficError> {
        let config = TrafficConfig { warm_up_s: 0.0, window: None, ..config };
        let mut traffic = Self::new(road, geometry, config)?;
        traffic.engine.bound(boundary);
        Ok(traffic)
    }

    /// Lets others do the work from now on: the bits stay the same.
    pub fn set_workers(&mut self, workers: Arc<dyn Workers>) {
        self.engine.workers = workers;
    }

    /// Tables of the road, for further traffic on it.
    #[must_use]
    pub fn map(&self) -> Arc<LaneMap> {
        Arc::clone(&self.engine.map)
    }

    /// The latest scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// How near to the ego vehicles have map poses in scenes, station of the front from that of the
    /// ego, m (all by default). Without, `x_m`, `y_m` and `yaw_rad` are NaN and a scene costs less;
    /// road coordinates are the same.
    pub fn set_map_poses_within_m(&mut self, distance_m: f64) {
        self.poses_within_m = distance_m;
    }

    /// Goes on with the draws of another seed: arrivals and drivers to come, what those on the road
    /// judge from now on. Vehicles stay as they are.
    pub fn reseed(&mut self, seed: u64) {
        self.engine.reseed(seed);
    }

    /// Asks for memory now, so that later ticks need none while the number of vehicles stays within
    /// half as many more, and 32.
    pub fn make_room(&mut self) {
        let fleet = &mut self.engine.state.fleet;
        fleet.make_room(fleet.len() / 2 + 32);
        let (lanes, radius_m) = (self.engine.map.lanes.len(), self.engine.config.scene_radius_m);
        let most = lanes * (2.0 * radius_m / SHORTEST_M) as usize;
        self.scene.neighbours.reserve(most.min(fleet.len() + fleet.len() / 2 + 32));
    }

    /// Takes away every vehicle that is not within this stretch of the road, m: less to move where
    /// only the next seconds around a place count. The scene is that of the next call.
    pub fn keep_within(&mut self, from_m: f64, to_m: f64) {
        self.engine.keep_within(from_m, to_m);
    }

    /// Puts the mean of its class in the place of every driver, who wishes the speed that he has:
    /// traffic as it is known to somebody who sees it and does not know who drives.
    pub fn forget_drivers(&mut self) {
        self.engine.forget_drivers();
    }

    /// Memory of a vehicle, bytes: its state and what is worked out about it in a tick.
    #[must_use]
    pub fn bytes_per_vehicle() -> usize {
        Engine::bytes_per_vehicle()
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &TrafficConfig {
        &self.engine.config
    }

    /// Counts so far.
    #[must_use]
    pub fn counts(&self) -> NativeCounts {
        let state = &self.engine.state;
        NativeCounts {
            vehicles: state.fleet.len(),
            entered: state.next_id,
            arrived: state.arrived,
            waiting: state.waiting.iter().map(|&n| u64::from(n)).sum::<u64>()
                + state.late.len() as u64,
            driven_km: state.driven_m / 1000.0,
            lane_changes: state.lane_changes,
        }
    }

    /// Smallest bumper-to-bumper gap between two vehicles in one lane at the last tick, m; negative
    /// after a collision. The ego is not counted.
    #[must_use]
    pub fn min_gap_m(&self) -> f64 {
        self.engine.min_gap_m()
    }

    /// Saves the state. Allocates; [`NativeTraffic::save_to`] does not.
    #[must_use]
    pub fn snapshot(&self) -> NativeSnapshot {
        NativeSnapshot { state: self.engine.state.clone(), tick_start: self.tick_start }
    }

    /// Saves the state into the arrays of an earlier snapshot.
    pub fn save_to(&self, snapshot: &mut NativeSnapshot) {
        snapshot.state.clone_from(&self.engine.state);
        snapshot.tick_start = self.tick_start;
    }

    /// Goes back to a snapshot of traffic on the same road with the same configuration.
    pub fn restore(&mut self, snapshot: &NativeSnapshot) {
        self.engine.state.clone_from(&snapshot.state);
        self.tick_start = snapshot.tick_start;
    }

    /// A fingerprint of the state (FNV-1a over the bits of station, speed and lane): equal states
    /// give equal fingerprints.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let fleet = &self.engine.state.fleet;
        let mut hash = crate::hash::Fnv::default();
        for i in 0..fleet.len() {
            hash.add(fleet.id[i]);
            hash.add(fleet.s_m[i].to_bits());
            hash.add(fleet.v_m_s[i].to_bits());
            hash.add(u64::from(fleet.lane[i]) << 16 | u64::from(fleet.target[i]));
        }
        hash.value()
    }

    /// Sees the ego as it was at `tick`, moved back along the road from `now`.
    fn see_ego(&mut self, ego: &EgoState, now: Time, tick: Time) {
        self.engine.ego_s_m = Some(ego.s_m);
        if !self.engine.config.sees_ego {
            self.engine.ego.clear();
            return;
        }
        let heading = self.road.line().heading_rad(ego.s_m);
        let shift_m = -ego.speed_m_s * now.seconds_since(tick);
        let Engine { ego: spans, map, .. } = &mut self.engine;
        spans.update(ego, &self.geometry, map, heading, shift_m);
    }
}

impl TrafficSource for NativeTraffic {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        ego.check_finite()?;
        let mut start = match self.tick_start {
            Some(start) => start,
            None => {
                self.see_ego(ego, now, now);
                self.engine.clear_around_ego(0);
                self.engine.state.plot.start = (self.engine.state.tick, now.seconds());
                self.engine.decide();
                now
            }
        };
        if now < start {
            return Err(TrafficError::TimeBackwards {
                asked_s: now.seconds(),
                reached_s: start.seconds(),
            });
        }
        if now.seconds_since(start) > crate::LONGEST_JUMP_S {
            return Err(TrafficError::TimeJump {
                asked_s: now.seconds(),
                reached_s: start.seconds(),
            });
        }
        while now.0 - start.0 >= TICK_NS {
            self.engine.commit();
            start = start.plus_nanos(TICK_NS);
            self.see_ego(ego, now, start);
            self.engine.decide();
        }
        self.tick_start = Some(start);
        let tau_s = now.seconds_since(start);
        publish(&self.engine, &self.road, self.poses_within_m, ego.s_m, tau_s, &mut self.scene);
        self.scene.time = now;
        Ok(&self.scene)
    }
}
