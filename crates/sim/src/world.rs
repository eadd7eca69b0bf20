//! One world: road, truck, traffic, stack and metrics, moved tick by tick.

use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;

use dynamics::TruckModel;
use j1939::BitRate;
use j1939::bus::Bus;
use planner::decider::DeciderKind;
use planner::{RatesConfig, Situation, Stack, StackConfig, Tactics};
use road::Road;
use tractrix_core::{
    Geometry, Recorder, Scene, Tick, Time, TrafficSource, Vehicle, VehicleLimits, VehicleStatus,
};

use crate::ecu::Ahead;
use crate::fault::Faults;
use crate::metrics::touchable_m;
use crate::{
    BusFigures, BusLoop, Fault, Ghost, GhostReport, Metrics, Plant, Scenario, SimError, SimTruck,
    Simulated, StackChange, Summary, Traffic, Truck,
};

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
    plant: Plant<Truck>,
    stack: Stack,
    ghost: Option<Box<Ghost>>,
    /// Sensors change what the stack sees of the traffic.
    sensors: bool,
    faults: Faults,
    /// File of weights of the learned decider.
    policy_file: Option<String>,
}

/// Measures a tick, unless the stack gets another state or scene than the true ones: then
/// [`World::tick`] measures it with these, because what a truck does not see it can still hit.
struct Judge<'a> {
    metrics: &'a mut Metrics,
    measures: bool,
    /// The scene, for who measures afterwards.
    scene: Option<Scene>,
}

impl Recorder for Judge<'_> {
    fn record(&mut self, tick: &Tick<'_>) {
        if self.measures {
            self.metrics.record(tick);
        } else {
            self.scene = Some(tick.scene.clone());
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
        Self::with_stack(Plant::build(scenario, seed, folder)?)
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
        Self::with_stack(Plant::assemble(scenario, seed, road, model, None)?)
    }

    /// A stack in front of a plant, as its scenario asks for.
    fn with_stack(plant: Plant<SimTruck>) -> Result<Self, SimError> {
        let scenario = plant.scenario();
        let limits = plant.truck().limits();
        let config = StackConfig {
            rates: RatesConfig::for_tick(scenario.run.tick_s),
            ..scenario.stack.clone()
        };
        let policy = scenario.policy_file.as_deref().map(Path::new);
        let stack = stack_of(config, limits, policy)?;
        let sensors = scenario.traffic.perception.enabled;
        let policy_file = scenario.policy_file.clone();
        Ok(Self {
            plant: plant.map_truck(Truck::Direct),
            stack,
            ghost: None,
            sensors,
            faults: Faults::default(),
            policy_file,
        })
    }

    /// One tick of the loop: reads the truck at the present time, plans, commands, records, and
    /// moves the time on. After the end it does nothing.
    ///
    /// # Errors
    /// [`SimError`] when the plant's state is no longer finite or the traffic source failed.
    pub fn tick(&mut self, recorder: &mut impl Recorder) -> Result<Status, SimError> {
        if self.plant.status() != Status::Running {
            return Ok(self.plant.status());
        }
        let (now, road) = (self.plant.now(), self.plant.limited_road());
        let Plant { truck, traffic, metrics, .. } = &mut self.plant;
        let deceived = self.faults.deceive();
        let measures = !self.sensors && !deceived && !matches!(truck, Truck::Bus(_));
        let mut judge = Judge { metrics, measures, scene: None };
        let there = Cell::new(None);
        let (mut seen_truck, mut seen_traffic) = self.faults.between(truck, traffic, &there);
        let outcome = planner::drive_tick(
            now,
            &mut seen_truck,
            &mut seen_traffic,
            &mut self.stack,
            &road,
            &mut (&mut judge, recorder),
        )
        .map_err(SimError::from)?;
        let seen = judge.scene;
        let real = traffic.truth().or(self.faults.real_scene()).or(seen.as_ref());
        if let Some(scene) = real.filter(|_| !measures) {
            let read = outcome.ego.value;
            let ego = if deceived { *truck.sim().state() } else { *truck.truth().unwrap_or(&read) };
            metrics.record(&Tick { now, ego: &ego, scene, plan: self.stack.plan() });
            truck.see(Ahead::of(&ego, &truck.limits().geometry, scene));
        }
        if let Some(ghost) = &mut self.ghost {
            ghost.follow(now, self.plant.truck().state(), self.stack.plan().held_up);
        }
        Ok(self.plant.end_tick())
    }

    /// Measures nothing but [`Self::collisions`] from here on, which is cheaper: the other figures
    /// of the summary and the fingerprints of the traffic stay where they are. What is driven stays
    /// the same, bit for bit.
    pub fn only_collisions(&mut self) {
        let Plant { metrics, traffic, truck, .. } = &mut self.plant;
        metrics.only_collisions();
        if !self.sensors {
            traffic.only_near(touchable_m(&truck.limits().geometry));
        }
    }

    /// Changes the stack, before the next tick. Who records the run records the change.
    ///
    /// # Errors
    /// As [`StackChange::apply`].
    pub fn change(&mut self, change: &StackChange) -> Result<(), SimError> {
        change.apply(&mut self.stack)?;
        if let StackChange::Decider { policy_file: Some(file), .. } = change {
            self.policy_file = Some(file.clone());
        }
        Ok(())
    }

    /// The scenario with what was changed about the stack since: one that begins here is this one.
    #[must_use]
    pub fn scenario_now(&self) -> Scenario {
        let mut now = self.scenario().clone();
        let config = self.stack.config();
        (now.stack.decider, now.stack.speed_planner) = (config.decider, config.speed_planner);
        let learned = config.decider == DeciderKind::Dqn;
        now.policy_file = self.policy_file.clone().filter(|_| learned);
        now
    }

    /// Breaks something, or mends it, before the next tick.
    ///
    /// # Errors
    /// [`SimError::NoBus`] for what only a truck on a bus has.
    pub fn set_fault(&mut self, fault: Fault, is_on: bool) -> Result<(), SimError> {
        self.faults.set(fault, is_on, &mut self.plant.truck)
    }

    /// What is broken.
    pub fn faults(&self) -> impl Iterator<Item = Fault> {
        self.faults.iter()
    }

    /// What the next tick will see, with tactics that have looked ahead from there: for who decides
    /// outside. Changes nothing in the run.
    pub(crate) fn look<R>(
        &mut self,
        look: impl FnOnce(&Tactics, &Situation<'_>) -> R,
    ) -> Result<R, SimError> {
        let (now, road) = (self.plant.now(), self.plant.limited_road());
        let Plant { truck, traffic, .. } = &mut self.plant;
        let ego = truck.ego(now)?.value;
        let scene = traffic.advance(now, &ego)?;
        let mut tactics = self.stack.tactics().clone();
        let at = Situation { now, ego: &ego, scene, road: &road, limits: truck.limits() };
        tactics.foresee(&at);
        Ok(look(&tactics, &at))
    }

    /// Lets a ghost drive along from here on, before the first tick, unless the scenario wants none
    /// (`run.ghost`). The run stays what it is, bit for bit.
    ///
    /// # Errors
    /// As [`Ghost::new`].
    pub fn attach_ghost(&mut self) -> Result<(), SimError> {
        if self.scenario().run.ghost {
            let ghost = Ghost::new(self.scenario(), self.truck().clone(), self.road())?;
            self.ghost = Some(Box::new(ghost));
        }
        Ok(())
    }

    /// Puts a bus in memory between stack and truck, before the first tick.
    ///
    /// # Errors
    /// As [`BusLoop::loopback`].
    pub fn put_on_loopback(&mut self, rate: BitRate) -> Result<(), SimError> {
        let looped = BusLoop::loopback(self.truck().clone(), rate)?;
        self.plant.truck = Truck::Bus(Box::new(looped));
        Ok(())
    }

    /// Puts a bus that somebody else has between stack and truck, before the first tick: a
    /// connection for each end.
    ///
    /// # Errors
    /// As [`BusLoop::over`].
    pub fn put_on_bus(
        &mut self,
        rate: BitRate,
        ecu: Box<dyn Bus + Send + Sync>,
        driver: Box<dyn Bus + Send + Sync>,
    ) -> Result<(), SimError> {
        let looped = BusLoop::over(self.truck().clone(), rate, ecu, driver)?;
        self.plant.truck = Truck::Bus(Box::new(looped));
        Ok(())
    }

    /// The bus between stack and truck, if there is one.
    pub fn bus_mut(&mut self) -> Option<&mut BusLoop> {
        match &mut self.plant.truck {
            Truck::Bus(looped) => Some(looped),
            Truck::Direct(_) | Truck::Detached(_) => None,
        }
    }

    /// How the bus between stack and truck did so far, if there is one.
    #[must_use]
    pub fn bus(&self) -> Option<BusFigures> {
        match &self.plant.truck {
            Truck::Bus(looped) => Some(looped.figures()),
            Truck::Direct(_) | Truck::Detached(_) => None,
        }
    }

    /// What is wrong with the truck, as the stack sees it.
    #[must_use]
    pub fn vehicle_status(&self) -> VehicleStatus {
        self.plant.truck.status()
    }

    /// The ghost and how the truck compares with it, if one drives along.
    #[must_use]
    pub fn ghost(&self) -> Option<GhostReport> {
        self.ghost.as_ref().map(|ghost| ghost.report(self.now()))
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
        self.plant.summary()
    }

    /// Collisions of the ego so far.
    #[must_use]
    pub const fn collisions(&self) -> u32 {
        self.plant.metrics.collisions()
    }

    /// Time of the next tick.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.plant.now()
    }

    /// Whether the run goes on.
    #[must_use]
    pub const fn status(&self) -> Status {
        self.plant.status()
    }

    /// The road.
    #[must_use]
    pub const fn road(&self) -> &Arc<Road> {
        self.plant.road()
    }

    /// Lengths of the ego.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        self.truck().limits().geometry
    }

    /// The scenario.
    #[must_use]
    pub const fn scenario(&self) -> &Scenario {
        self.plant.scenario()
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
        self.plant.traffic()
    }

    /// The traffic, to reach SUMO's variables.
    pub const fn traffic_mut(&mut self) -> &mut Traffic {
        &mut self.plant.traffic
    }

    /// Whether a wheel is beyond the paved lanes now.
    #[must_use]
    pub const fn is_off_road(&self) -> bool {
        self.plant.is_off_road()
    }

    /// The truck.
    #[must_use]
    pub fn truck(&self) -> &SimTruck {
        self.plant.truck()
    }
}

/// A stack with this configuration; `policy` has the weights of the learned decider.
///
/// # Errors
/// [`SimError`] names the key of the configuration or the file that cannot be used.
pub fn stack_of(
    config: StackConfig,
    limits: &VehicleLimits,
    policy: Option<&Path>,
) -> Result<Stack, SimError> {
    Ok(match policy {
        Some(file) => Stack::with_policy(config, limits, Arc::new(read_policy(file)?))?,
        None => Stack::new(config, limits)?,
    })
}

/// The trained policy that the program brings along (`policies/table2`).
pub(crate) const BUILTIN_POLICY: &str = "builtin:table2";
const BUILTIN_WEIGHTS: &[u8] = include_bytes!("../policies/table2.safetensors");
const BUILTIN_SIDECAR: &str = include_str!("../policies/table2.json");

/// Weights of the learned decider, with the `.json` beside them, or `builtin:table2`.
///
/// # Errors
/// [`SimError`] names the file that cannot be read or used.
pub fn read_policy(file: &Path) -> Result<planner::decider::Policy, SimError> {
    let (weights, sidecar) = policy_files(file)?;
    Ok(planner::decider::Policy::from_files(&weights, &sidecar)?)
}

/// The contents of a file of weights (or `builtin:table2`) and of the `.json` beside it.
///
/// # Errors
/// [`SimError::Io`] names the file that cannot be read.
pub fn policy_files(file: &Path) -> Result<(Vec<u8>, String), SimError> {
    if file == Path::new(BUILTIN_POLICY) {
        return Ok((BUILTIN_WEIGHTS.to_vec(), BUILTIN_SIDECAR.to_owned()));
    }
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| SimError::Io { path, source }
    };
    let sidecar = file.with_extension("json");
    let weights = std::fs::read(file).map_err(io(file))?;
    let text = std::fs::read_to_string(&sidecar).map_err(io(&sidecar))?;
    Ok((weights, text))
}
