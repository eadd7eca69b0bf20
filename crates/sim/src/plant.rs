//! What drives on the road, without who drives: truck, traffic and metrics.

use std::path::Path;
use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use j1939::bus::Bus;
use road::Road;
use tractrix_core::{Plan, Recorder, Tick, Time, TrafficSource, Vehicle};

use crate::ecu::{Ahead, EcuConfig, EcuSim};
use crate::{Metrics, OffRoad, Scenario, SimError, SimTruck, Status, Summary, Traffic};

/// A truck of the simulation, however it is commanded.
pub trait Simulated {
    /// The truck itself.
    fn sim(&self) -> &SimTruck;
}

impl Simulated for SimTruck {
    fn sim(&self) -> &SimTruck {
        self
    }
}

/// Truck `T`, traffic and metrics on a road, moved tick by tick by who commands the truck:
/// [`crate::World`] has a stack for that, the virtual truck has a bus.
#[derive(Clone)]
pub struct Plant<T> {
    scenario: Scenario,
    road: Arc<Road>,
    /// The road with the limit that holds now beside its own, and that limit, m/s.
    limited: Option<(f64, Arc<Road>)>,
    pub(crate) truck: T,
    pub(crate) traffic: Traffic,
    pub(crate) metrics: Metrics,
    wheels: OffRoad,
    now: Time,
    tick_ns: i64,
    status: Status,
}

impl Plant<SimTruck> {
    /// The plant of a scenario; working files of a traffic program go into `folder` or, without
    /// one, into a temporary folder.
    pub(crate) fn build(
        scenario: &Scenario,
        seed: u64,
        folder: Option<&Path>,
    ) -> Result<Self, SimError> {
        let road = Arc::new(scenario.load_road()?);
        let params = TruckParameters::load(&scenario.truck.file)?;
        let model = Arc::new(TruckModel::new(params, scenario.truck.payload_kg)?);
        Self::assemble(scenario, seed, road, model, folder)
    }

    /// As [`Self::build`], with the road and the truck already read.
    pub(crate) fn assemble(
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
        let metrics = Metrics::new(truck.limits(), &scenario.stack.rss, Arc::clone(&road));
        Ok(Self {
            metrics,
            wheels,
            scenario: scenario.clone(),
            road,
            limited: None,
            truck,
            traffic,
            now: Time::ZERO,
            tick_ns: Time::from_seconds(scenario.run.tick_s).0,
            status: Status::Running,
        })
    }
}

impl<B: Bus> Plant<EcuSim<B>> {
    /// The virtual truck of a scenario on a bus whose time begins at zero. Truck and traffic are
    /// held until somebody asks the truck to do something.
    ///
    /// # Errors
    /// As [`crate::World::new`].
    pub fn on_bus(scenario: &Scenario, seed: u64, bus: B) -> Result<Self, SimError> {
        let plant = Plant::build(scenario, seed, None)?;
        let ecu = EcuSim::new(plant.truck.clone(), bus, EcuConfig::default(), Time::ZERO, None)?;
        Ok(plant.map_truck(|_| ecu))
    }

    /// One tick in wall time, which is `wall` by now and not before `now`: a tick that is made up
    /// for says nothing. Moves the control units to bus time `now`, and once the truck is let go truck and
    /// traffic by one tick of the scenario. After the end it does nothing.
    ///
    /// # Errors
    /// [`SimError`] when the bus, the truck or the traffic source fails.
    pub fn tick(&mut self, now: Time, wall: Time) -> Result<Status, SimError> {
        self.truck.say_nothing_late(wall);
        let ego = self.truck.advance(now)?.value;
        if self.status != Status::Running || self.truck.let_go().is_none() {
            return Ok(self.status);
        }
        let scene = self.traffic.advance(self.now, &ego)?;
        let plan = Plan::default();
        self.metrics.record(&Tick { now: self.now, ego: &ego, scene, plan: &plan });
        let geometry = self.truck.sim().limits().geometry;
        self.truck.see(Ahead::of(&ego, &geometry, scene));
        Ok(self.end_tick())
    }

    /// The control units.
    pub const fn ecu(&self) -> &EcuSim<B> {
        &self.truck
    }
}

impl<T: Simulated> Plant<T> {
    /// The same plant with another way to the truck.
    pub(crate) fn map_truck<U>(self, change: impl FnOnce(T) -> U) -> Plant<U> {
        Plant {
            scenario: self.scenario,
            road: self.road,
            limited: self.limited,
            truck: change(self.truck),
            traffic: self.traffic,
            metrics: self.metrics,
            wheels: self.wheels,
            now: self.now,
            tick_ns: self.tick_ns,
            status: self.status,
        }
    }

    /// The road with the limits that hold now.
    pub(crate) fn limited_road(&mut self) -> Arc<Road> {
        let limit_m_s = self.traffic.limit_m_s(self.now.seconds());
        if limit_m_s != self.limited.as_ref().map(|(limit_m_s, _)| *limit_m_s) {
            self.limited =
                limit_m_s.map(|limit| (limit, Arc::new(self.road.with_limit_cap(limit))));
        }
        Arc::clone(self.limited.as_ref().map_or(&self.road, |(_, road)| road))
    }

    /// Ends a tick: watches the wheels, moves the time on, and says whether the run does.
    pub(crate) fn end_tick(&mut self) -> Status {
        let truck = self.truck.sim();
        let off = self.wheels.watch(truck.state(), &self.road, self.scenario.run.tick_s);
        self.now = self.now.plus_nanos(self.tick_ns);
        let front_m = truck.state().s_m + truck.limits().geometry.front_m;
        if off && !self.scenario.run.allow_off_road {
            self.status = Status::OffRoad;
        } else if front_m + END_MARGIN_M >= self.road.length_m() {
            self.status = Status::RoadEnd;
        } else if self.now.seconds() >= self.scenario.run.duration_s {
            self.status = Status::TimeOver;
        }
        self.status
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

    /// The scenario.
    #[must_use]
    pub const fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The traffic: its mode, manifest and failure.
    #[must_use]
    pub const fn traffic(&self) -> &Traffic {
        &self.traffic
    }

    /// Whether a wheel is beyond the paved lanes now.
    #[must_use]
    pub const fn is_off_road(&self) -> bool {
        self.wheels.is_off_now()
    }

    /// The truck.
    #[must_use]
    pub fn truck(&self) -> &SimTruck {
        self.truck.sim()
    }
}

/// The run ends when the front bumper is this close to the end of the road, m: the planner still
/// sees road ahead of it.
const END_MARGIN_M: f64 = 5.0;
