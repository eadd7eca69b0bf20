//! One world: road, truck, traffic, stack and metrics, moved tick by tick.

use std::path::Path;
use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use planner::{RatesConfig, Stack, StackConfig};
use road::Road;
use tractrix_core::{Geometry, Recorder, Tick, Time, Vehicle};

use crate::{Ghost, GhostReport, Metrics, OffRoad, Scenario, SimError, SimTruck, Summary, Traffic};

/// Whether a run goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The run goes on.
    Running,
    /// The ego has reached the end of the road.
    RoadEnd,
    /// The scenario's duration is over.
    TimeOver,
    /// A wheel has left the road, and the scenario does not allow it.
    OffRoad,
}

/// The closed loop. `Clone` is a snapshot: a clone continues bit for bit like its original. (Not in
/// SUMO traffic: there is one SUMO, and the clone's next tick is an error that says so.)
#[derive(Clone)]
pub struct World {
    scenario: Scenario,
    road: Arc<Road>,
    /// The road with the limit that holds now beside its own, and that limit, m/s.
    limited: Option<(f64, Arc<Road>)>,
    truck: SimTruck,
    traffic: Traffic,
    stack: Stack,
    metrics: Metrics,
    wheels: OffRoad,
    now: Time,
    tick_ns: i64,
    status: Status,
    ghost: Option<Box<Ghost>>,
    /// Sensors change what the stack sees of the traffic.
    sensors: bool,
}

/// Measures a tick, unless sensors change the scene: then [`World::tick`] measures it with the scene
/// as it is, because what a truck does not see it can still hit.
struct Judge<'a> {
    metrics: &'a mut Metrics,
    sensors: bool,
}

impl Recorder for Judge<'_> {
    fn record(&mut self, tick: &Tick<'_>) {
        if !self.sensors {
            self.metrics.record(tick);
        }
    }
}

impl World {
    /// Builds the world of a scenario. The same scenario and seed give the same bits.
    ///
    /// # Errors
    /// [`SimError`] names the road, truck file, key or value that cannot be used.
    pub fn new(scenario: &Scenario, seed: u64) -> Result<Self, SimError> {
        Self::build(scenario, seed, None)
    }

    /// As [`Self::new`]; the working files of a traffic program (SUMO) go into `folder`, which is
    /// made when it is needed.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn in_folder(scenario: &Scenario, seed: u64, folder: &Path) -> Result<Self, SimError> {
        Self::build(scenario, seed, Some(folder))
    }

    fn build(scenario: &Scenario, seed: u64, folder: Option<&Path>) -> Result<Self, SimError> {
        let road = Arc::new(scenario.load_road()?);
        let params = TruckParameters::load(&scenario.truck.file)?;
        let model = Arc::new(TruckModel::new(params, scenario.truck.payload_kg)?);
        Self::assemble_in(scenario, seed, road, model, folder)
    }

    /// As [`Self::new`], with the road and the truck already read (batches share them).
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn assemble(
        scenario: &Scenario,
        seed: u64,
        road: Arc<Road>,
        model: Arc<TruckModel>,
    ) -> Result<Self, SimError> {
        Self::assemble_in(scenario, seed, road, model, None)
    }

    fn assemble_in(
        scenario: &Scenario,
        seed: u64,
        road: Arc<Road>,
        model: Arc<TruckModel>,
        folder: Option<&Path>,
    ) -> Result<Self, SimError> {
        let wheels = OffRoad::new(&model);
        let truck = SimTruck::new(model, Arc::clone(&road), &scenario.ego, &scenario.weather)?;
        let geometry = truck.limits().geometry;
        let traffic = Traffic::new(scenario, seed, &road, geometry, folder)?;
        let config = StackConfig {
            rates: RatesConfig::for_tick(scenario.run.tick_s),
            ..scenario.stack.clone()
        };
        let metrics = Metrics::new(truck.limits(), &config.rss, Arc::clone(&road));
        let stack = match &scenario.policy_file {
            Some(file) => {
                let policy = Arc::new(read_policy(file.as_ref())?);
                Stack::with_policy(config, truck.limits(), policy)?
            }
            None => Stack::new(config, truck.limits())?,
        };
        Ok(Self {
            metrics,
            wheels,
            ghost: None,
            sensors: scenario.traffic.perception.enabled,
            scenario: scenario.clone(),
            road,
            limited: None,
            truck,
            traffic,
            stack,
            now: Time::ZERO,
            tick_ns: Time::from_seconds(scenario.run.tick_s).0,
            status: Status::Running,
        })
    }

    /// One tick of the loop: reads the truck at the present time, plans, commands, records, and
    /// moves the time on. After the end it does nothing.
    ///
    /// # Errors
    /// [`SimError`] when the plant's state is no longer finite or the traffic source failed.
    pub fn tick(&mut self, recorder: &mut impl Recorder) -> Result<Status, SimError> {
        if self.status != Status::Running {
            return Ok(self.status);
        }
        let limit_m_s = self.traffic.limit_m_s(self.now.seconds());
        if limit_m_s != self.limited.as_ref().map(|(limit_m_s, _)| *limit_m_s) {
            self.limited =
                limit_m_s.map(|limit| (limit, Arc::new(self.road.with_limit_cap(limit))));
        }
        let road = self.limited.as_ref().map_or(&self.road, |(_, road)| road);
        let mut judge = Judge { metrics: &mut self.metrics, sensors: self.sensors };
        let outcome = planner::drive_tick(
            self.now,
            &mut self.truck,
            &mut self.traffic,
            &mut self.stack,
            road,
            &mut (&mut judge, recorder),
        )
        .map_err(SimError::from)?;
        if let (true, Some(scene)) = (self.sensors, self.traffic.truth()) {
            let (ego, plan) = (&outcome.ego.value, self.stack.plan());
            self.metrics.record(&Tick { now: self.now, ego, scene, plan });
        }
        if let Some(ghost) = &mut self.ghost {
            ghost.follow(self.now, self.truck.state(), self.stack.plan().held_up);
        }
        let off = self.wheels.watch(self.truck.state(), &self.road, self.scenario.run.tick_s);
        self.now = self.now.plus_nanos(self.tick_ns);
        let front_m = self.truck.state().s_m + self.truck.limits().geometry.front_m;
        if off && !self.scenario.run.allow_off_road {
            self.status = Status::OffRoad;
        } else if front_m + END_MARGIN_M >= self.road.length_m() {
            self.status = Status::RoadEnd;
        } else if self.now.seconds() >= self.scenario.run.duration_s {
            self.status = Status::TimeOver;
        }
        Ok(self.status)
    }

    /// Lets a ghost drive along from here on, before the first tick, unless the scenario wants none
    /// (`run.ghost`). The run stays what it is, bit for bit.
    ///
    /// # Errors
    /// As [`Ghost::new`].
    pub fn attach_ghost(&mut self) -> Result<(), SimError> {
        if self.scenario.run.ghost {
            let ghost = Ghost::new(&self.scenario, self.truck.clone(), &self.road)?;
            self.ghost = Some(Box::new(ghost));
        }
        Ok(())
    }

    /// The ghost and how the truck compares with it, if one drives along.
    #[must_use]
    pub fn ghost(&self) -> Option<GhostReport> {
        self.ghost.as_ref().map(|ghost| ghost.report(self.now))
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// As [`Self::tick`].
    pub fn run(&mut self, recorder: &mut impl Recorder) -> Result<Summary, SimError> {
        while self.tick(recorder)? == Status::Running {}
        Ok(self.summary())
    }

    /// The figures so far.
    #[must_use]
    pub fn summary(&self) -> Summary {
        Summary {
            off_road_events: self.wheels.events(),
            off_road_time_s: self.wheels.time_s(),
            ..self.metrics.summary()
        }
    }

    /// Collisions of the ego so far.
    #[must_use]
    pub const fn collisions(&self) -> u32 {
        self.metrics.collisions()
    }

    /// Time of the next tick.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.now
    }

    /// Whether the run goes on.
    #[must_use]
    pub const fn status(&self) -> Status {
        self.status
    }

    /// The road.
    #[must_use]
    pub const fn road(&self) -> &Arc<Road> {
        &self.road
    }

    /// Lengths of the ego.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        self.truck.limits().geometry
    }

    /// The scenario.
    #[must_use]
    pub const fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The planning stack.
    #[must_use]
    pub const fn stack(&self) -> &Stack {
        &self.stack
    }

    /// The planning stack (to request a lane change from outside, say).
    pub const fn stack_mut(&mut self) -> &mut Stack {
        &mut self.stack
    }

    /// The traffic: its mode, manifest and failure.
    #[must_use]
    pub const fn traffic(&self) -> &Traffic {
        &self.traffic
    }

    /// The traffic, to reach SUMO's variables.
    pub const fn traffic_mut(&mut self) -> &mut Traffic {
        &mut self.traffic
    }

    /// Whether a wheel is beyond the paved lanes now.
    #[must_use]
    pub const fn is_off_road(&self) -> bool {
        self.wheels.is_off_now()
    }

    /// The truck.
    #[must_use]
    pub const fn truck(&self) -> &SimTruck {
        &self.truck
    }
}

/// The run ends when the front bumper is this close to the end of the road, m: the planner still
/// sees road ahead of it.
const END_MARGIN_M: f64 = 5.0;

/// Weights of the learned decider, with the `.json` beside them.
fn read_policy(file: &Path) -> Result<planner::decider::Policy, SimError> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| SimError::Io { path, source }
    };
    let sidecar = file.with_extension("json");
    let weights = std::fs::read(file).map_err(io(file))?;
    let text = std::fs::read_to_string(&sidecar).map_err(io(&sidecar))?;
    Ok(planner::decider::Policy::from_files(&weights, &text)?)
}
