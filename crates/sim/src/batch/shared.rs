//! What the environments of a spec have in common, and where their episodes begin.

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use planner::decider::DeciderKind;
use planner::{RatesConfig, StackConfig, Tactics};
use road::Road;
use tractrix_core::{Vehicle, VehicleLimits};
use traffic_client::Mode;
use traffic_client::native::{NativeSnapshot, NativeTraffic};

use super::env::Body;
use super::kinematic::Kinematic;
use super::{EnvSpec, Fidelity, SUBSTEP_S, mix};
use crate::{EgoStart, SimError, SimTruck, TrafficKind, World};

/// Warmed traffic to begin with; arrivals, drivers to come and the start differ with the seed.
const POOL: u64 = 16;

/// What the environments of a spec have in common.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) spec: EnvSpec,
    pub(super) road: Arc<Road>,
    model: Arc<TruckModel>,
    /// Substeps of a decision, ticks of a substep.
    pub(super) substeps: u32,
    pub(super) ticks: u32,
    /// A kinematic ego to copy, and the traffic that it can begin in.
    kinematic: Option<(Kinematic, Vec<NativeSnapshot>)>,
}

impl Shared {
    pub(super) fn new(spec: EnvSpec) -> Result<Self, SimError> {
        let refuse = |what: &'static str, value: String, why: &str| {
            Err(SimError::Batch { what, value, why: why.to_owned() })
        };
        let substeps = spec.decision_s / SUBSTEP_S;
        let per_second = 1.0 / spec.decision_s;
        let whole = |x: f64| (x - x.round()).abs() < 1e-9 && x.round() >= 1.0;
        if !(spec.decision_s <= 1.0 && whole(substeps) && whole(per_second)) {
            return refuse("decision_s", format!("{}", spec.decision_s), "0.1, 0.2, 0.5 or 1 s");
        }
        if !(spec.episode_s >= spec.decision_s && spec.episode_s <= 1e5) {
            let value = format!("{}", spec.episode_s);
            return refuse("episode_s", value, "at least one decision and at most 1e5 s");
        }
        if !(0.0..=1e5).contains(&spec.start_spread_m) {
            return refuse("start_spread_m", format!("{}", spec.start_spread_m), "0 to 1e5 m");
        }
        let mut scenario = spec.scenario.clone();
        scenario.stack.decider = DeciderKind::External;
        scenario.policy_file = None;
        scenario.run.duration_s = spec.episode_s + 1.0;
        scenario.traffic.native.window = spec.window.or(scenario.traffic.native.window);
        scenario.check()?;
        let ticks = SUBSTEP_S / scenario.run.tick_s;
        if !whole(ticks) {
            let value = format!("{}", scenario.run.tick_s);
            return refuse("run.tick_s", value, "a whole part of 0.1 s");
        }
        let traffic = &scenario.traffic;
        let plain = traffic.source == TrafficKind::Native
            && traffic.mode() == Mode::Inter
            && traffic.schedule()? == Default::default()
            && !traffic.perception.enabled;
        if spec.fidelity == Fidelity::Kinematic && !plain {
            let why = "kinematic environments drive in native traffic in mode inter, without \
                       incidents, changing demand and sensors";
            return refuse("scenario", scenario.name, why);
        }
        let road = Arc::new(scenario.load_road()?);
        let params = TruckParameters::load(&scenario.truck.file)?;
        let model = Arc::new(TruckModel::new(params, scenario.truck.payload_kg)?);
        let mut shared = Self {
            substeps: substeps.round() as u32,
            ticks: ticks.round() as u32,
            spec: EnvSpec { scenario, ..spec },
            road,
            model,
            kinematic: None,
        };
        if shared.spec.fidelity == Fidelity::Kinematic {
            shared.kinematic = Some(shared.warm()?);
        }
        Ok(shared)
    }

    /// The kinematic ego and the traffic that it begins in.
    fn warm(&self) -> Result<(Kinematic, Vec<NativeSnapshot>), SimError> {
        let scenario = &self.spec.scenario;
        let weather = &scenario.weather;
        let (model, road) = (Arc::clone(&self.model), Arc::clone(&self.road));
        let truck = SimTruck::new(model, road, &scenario.ego, weather)?;
        let limits = Arc::new(truck.limits().clone());
        let config =
            StackConfig { rates: RatesConfig::for_tick(SUBSTEP_S), ..scenario.stack.clone() };
        let tactics = Tactics::new(config, None)?;
        let with = |seed: u64| scenario.traffic.demand(seed);
        let geometry = limits.geometry;
        let mut traffic = NativeTraffic::new(Arc::clone(&self.road), geometry, with(0))?;
        traffic.set_map_poses_within_m(-1.0);
        let mut pool = vec![traffic.snapshot()];
        for seed in 1..POOL {
            let road = Arc::clone(&self.road);
            let warmed = NativeTraffic::with_map(traffic.map(), road, geometry, with(seed))?;
            pool.push(warmed.snapshot());
        }
        Ok((Kinematic::new(Arc::clone(&self.road), limits, traffic, tactics), pool))
    }

    /// The truck, with these limits, so far behind the scenario's start, m.
    fn truck(&self, further_m: f64, limits: &VehicleLimits) -> Result<SimTruck, SimError> {
        let scenario = &self.spec.scenario;
        let start = EgoStart { s_m: scenario.ego.s_m + further_m, ..scenario.ego.clone() };
        let (model, road) = (Arc::clone(&self.model), Arc::clone(&self.road));
        SimTruck::with_limits(model, road, &start, &scenario.weather, limits.clone())
    }

    /// A body at the start of the episode with this seed, in the arrays of an earlier one.
    pub(super) fn body(&self, seed: u64, former: Option<Body>) -> Result<(Body, f64), SimError> {
        let unit = (mix(seed, 0, 0) >> 11) as f64 / (1_u64 << 53) as f64;
        let further_m = unit * self.spec.start_spread_m;
        let Some((model, pool)) = &self.kinematic else {
            let mut scenario = self.spec.scenario.clone();
            scenario.ego.s_m += further_m;
            let (road, truck) = (Arc::clone(&self.road), Arc::clone(&self.model));
            let start_s_m = scenario.ego.s_m;
            let mut world = World::assemble(&scenario, seed, road, truck)?;
            world.only_collisions();
            return Ok((Body::Truck(Box::new(world)), start_s_m));
        };
        let mut kinematic = match former {
            Some(Body::Kinematic(kinematic)) => kinematic,
            _ => Box::new(model.clone()),
        };
        kinematic.tactics.clone_from(&model.tactics);
        if let Some(start) = pool.get((mix(seed, 0, 1) % POOL) as usize) {
            kinematic.traffic.restore(start);
        }
        kinematic.traffic.reseed(seed);
        kinematic.traffic.make_room();
        let ego = *self.truck(further_m, &model.limits)?.state();
        kinematic.begin(ego)?;
        Ok((Body::Kinematic(kinematic), ego.s_m))
    }
}
