//! One environment: a body, what it has seen, the figures of its episode.

use std::sync::Arc;

use dynamics::{TruckModel, TruckParameters};
use planner::decider::observation::{Observer, frame};
use planner::decider::{DeciderKind, LaneChoice};
use planner::safety::RssConfig;
use planner::{RatesConfig, Situation, StackConfig, Tactics};
use road::Road;
use tractrix_core::{
    Geometry, LaneChangeRefusal, Maneuver, Recorder, Tick, Vehicle, VehicleLimits,
};
use traffic_client::Mode;
use traffic_client::native::{NativeSnapshot, NativeTraffic};

use super::contacts::Contacts;
use super::kinematic::Kinematic;
use super::reward::RewardConfig;
use super::{ACTIONS, EnvSpec, EpisodeStats, Fidelity, SUBSTEP_S, Substep, mix};
use crate::behind::Behind;
use crate::{EgoStart, SimError, SimTruck, Status, TrafficKind, World};

/// Warmed traffic to begin with; arrivals, drivers to come and the start differ with the seed.
const POOL: u64 = 16;
/// The front comes so near to the end of the road, m.
const END_MARGIN_M: f64 = 10.0;

/// What the environments of a spec have in common.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) spec: EnvSpec,
    road: Arc<Road>,
    model: Arc<TruckModel>,
    /// Substeps of a decision, ticks of a substep.
    substeps: u32,
    ticks: u32,
    /// A kinematic ego to copy, and the traffic that it can begin in.
    kinematic: Option<(Kinematic, Vec<NativeSnapshot>)>,
}

/// What drives.
pub(super) enum Body {
    Kinematic(Box<Kinematic>),
    Truck(Box<World>),
}

/// What changes in an environment.
pub(super) struct State {
    pub(super) body: Body,
    observer: Observer,
    pub(super) stats: EpisodeStats,
    maneuver: Maneuver,
    behind: Behind,
    contacts: Contacts,
    start_s_m: f64,
    /// Where the seeds of the episodes are from, and how many have ended since.
    stream: u64,
    episode: u64,
}

impl Clone for Body {
    fn clone(&self) -> Self {
        match self {
            Self::Kinematic(kinematic) => Self::Kinematic(kinematic.clone()),
            Self::Truck(world) => Self::Truck(world.clone()),
        }
    }

    fn clone_from(&mut self, from: &Self) {
        match (&mut *self, from) {
            (Self::Kinematic(own), Self::Kinematic(other)) => (**own).clone_from(other),
            (own, other) => *own = other.clone(),
        }
    }
}

impl Clone for State {
    fn clone(&self) -> Self {
        Self {
            body: self.body.clone(),
            observer: self.observer.clone(),
            behind: self.behind.clone(),
            contacts: self.contacts.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, from: &Self) {
        let Self { body, observer, behind, contacts, .. } = from;
        let Self { stats, maneuver, start_s_m, stream, episode, .. } = from;
        self.body.clone_from(body);
        self.observer.clone_from(observer);
        self.behind.clone_from(behind);
        self.contacts.clone_from(contacts);
        (self.stats, self.maneuver, self.start_s_m) = (*stats, *maneuver, *start_s_m);
        (self.stream, self.episode) = (*stream, *episode);
    }
}

/// A state kept for later; [`super::Batch::save`] fills it.
#[derive(Clone, Default)]
pub struct EnvSnapshot {
    state: Option<State>,
}

/// An environment.
pub(super) struct Env {
    pub(super) shared: Arc<Shared>,
    index: u64,
    pub(super) state: Option<State>,
}

/// How a decision ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ended {
    pub(super) reward_s: f64,
    pub(super) terminated: bool,
    pub(super) truncated: bool,
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
    fn body(&self, seed: u64, former: Option<Body>) -> Result<(Body, f64), SimError> {
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

impl Env {
    pub(super) fn new(shared: Arc<Shared>, index: usize) -> Self {
        Self { shared, index: index as u64, state: None }
    }

    /// Begins an episode: with a seed the first of that seed's, else the next one. What follows hangs
    /// on the seed alone, not on what was driven before it.
    pub(super) fn reset(&mut self, batch_seed: u64, seed: Option<u64>) -> Result<(), SimError> {
        let (stream, episode) = match (seed, &self.state) {
            (Some(seed), _) => (seed, 0),
            (None, Some(state)) => (state.stream, state.episode + 1),
            (None, None) => (mix(batch_seed, self.index, 0), 0),
        };
        let seed = if episode == 0 { stream } else { mix(stream, 1, episode) };
        let former = self.state.take();
        let (body, observer, mut behind, mut contacts) = match former {
            Some(state) => (Some(state.body), Some(state.observer), state.behind, state.contacts),
            None => (None, None, Behind::default(), Contacts::default()),
        };
        let (body, start_s_m) = self.shared.body(seed, body)?;
        let mut observer = observer.unwrap_or_else(|| Observer::new(self.shared.spec.decision_s));
        observer.clear();
        let stats = EpisodeStats { seed, ..EpisodeStats::default() };
        let maneuver = Maneuver::KeepLane;
        behind.clear();
        contacts.clear();
        self.state = Some(State {
            body,
            observer,
            behind,
            contacts,
            stats,
            maneuver,
            start_s_m,
            stream,
            episode,
        });
        Ok(())
    }

    /// Drives one decision.
    pub(super) fn step(&mut self, action: u8) -> Result<Ended, SimError> {
        let shared = Arc::clone(&self.shared);
        let spec = &shared.spec;
        let wish = ACTIONS[usize::from(action)];
        let state = self.state.as_mut().ok_or_else(not_begun)?;
        let (mut reward_s, mut begun, mut refused) = (0.0, 0, false);
        let (mut contact, mut over) = (None, false);
        for k in 0..shared.substeps {
            let wished = if k == 0 { wish } else { LaneChoice::Keep };
            let step = state.substep(wished, &shared)?;
            refused |= wished != LaneChoice::Keep && step.refused.is_some();
            let is_new = step.maneuver != state.maneuver;
            state.maneuver = step.maneuver;
            match step.maneuver {
                Maneuver::ChangeLeft | Maneuver::ChangeRight if is_new => begun += 1,
                Maneuver::AbortChange if is_new => state.stats.aborted += 1,
                _ => {}
            }
            reward_s += RewardConfig::of_step(step.speed_m_s, step.reference_m_s);
            if step.reference_m_s > 0.0 {
                let lacks = (step.reference_m_s - step.speed_m_s) / step.reference_m_s;
                let (sum, number) = state.stats.delta;
                state.stats.delta = (sum + lacks, number + 1);
            }
            state.stats.time_s += SUBSTEP_S;
            contact = step.contact;
            over = state.is_at_end(&shared);
            if contact.is_some() || over {
                break;
            }
        }
        let collided = contact.is_some();
        reward_s -= spec.reward.cost(wish != LaneChoice::Keep, begun, refused, collided);
        let (driven_m, fuel_g) = (state.s_m() - state.start_s_m, state.fuel_g());
        let stats = &mut state.stats;
        stats.decisions += 1;
        stats.reward_s += reward_s;
        stats.lane_changes += begun;
        stats.refused += u32::from(refused);
        (stats.collided, stats.collision_caused) = (collided, contact == Some(true));
        stats.fuel_g = fuel_g;
        over |= stats.time_s + 0.5 * SUBSTEP_S >= spec.episode_s;
        stats.distance_m = driven_m;
        Ok(Ended { reward_s, terminated: collided, truncated: over && !collided })
    }

    /// Looks around: the observation, and which actions the gate passes.
    pub(super) fn observe(&mut self, out: &mut [f32], mask: &mut [u8]) -> Result<(), SimError> {
        let spec = self.shared.spec.observation;
        let State { body, observer, .. } = self.state.as_mut().ok_or_else(not_begun)?;
        body.look(|tactics, at| {
            let reference = |s_m: f64| tactics.reference_speed_m_s(s_m).unwrap_or(0.0);
            observer.push(frame(at.ego, at.scene, at.road, reference));
            let passes = [LaneChoice::Left, LaneChoice::Right]
                .map(|choice| tactics.would_pass(choice, at).is_ok());
            mask.copy_from_slice(&[u8::from(passes[0]), 1, u8::from(passes[1])]);
            match tactics.observed(at, observer, passes) {
                Some(observed) => spec.write(&observed, out),
                None => out.fill(0.0),
            }
        })
    }

    /// The same environment once more.
    pub(super) fn copy(&self) -> Self {
        Self { shared: Arc::clone(&self.shared), index: self.index, state: self.state.clone() }
    }

    /// Whether there is no more road.
    pub(super) fn is_at_end(&self) -> bool {
        self.state.as_ref().is_some_and(|state| state.is_at_end(&self.shared))
    }

    pub(super) fn world(&self) -> Option<&World> {
        match &self.state.as_ref()?.body {
            Body::Truck(world) => Some(world),
            Body::Kinematic(_) => None,
        }
    }

    pub(super) fn save(&self, to: &mut EnvSnapshot) {
        to.state.clone_from(&self.state);
    }

    pub(super) fn restore(&mut self, from: &EnvSnapshot) {
        self.state.clone_from(&from.state);
    }
}

impl Body {
    /// Looks around: what the tactics would do, from here.
    pub(super) fn look<R>(
        &mut self,
        look: impl FnOnce(&Tactics, &Situation<'_>) -> R,
    ) -> Result<R, SimError> {
        match self {
            Self::Kinematic(kinematic) => {
                kinematic.look()?;
                Ok(look(&kinematic.tactics, &kinematic.at()))
            }
            Self::Truck(world) => world.look(look),
        }
    }
}

impl State {
    /// Drives [`SUBSTEP_S`].
    fn substep(&mut self, wish: LaneChoice, shared: &Shared) -> Result<Substep, SimError> {
        let rss = &shared.spec.scenario.stack.rss;
        let Self { body, behind, contacts, stats, .. } = self;
        let world = match body {
            Body::Kinematic(kinematic) => {
                let step = kinematic.step(wish)?;
                let Situation { now, ego, scene, limits, .. } = kinematic.at();
                let geometry = &limits.geometry;
                let brakes = behind.begins_to_brake(now, ego, scene, step.maneuver, geometry, rss);
                stats.hard_braking_caused += u32::from(brakes);
                let contact = contacts.watch(ego, scene, step.maneuver, geometry);
                return Ok(Substep { contact, ..step });
            }
            Body::Truck(world) => world,
        };
        world.stack_mut().request_lane_change(wish);
        let geometry = &world.truck().limits().geometry.clone();
        let mut seen = Seen { last: None, behind, contacts, brake: 0, geometry, rss };
        let mut first: Option<Substep> = None;
        for _ in 0..shared.ticks {
            world.tick(&mut seen)?;
            first = first.or(seen.last);
        }
        stats.hard_braking_caused += seen.brake;
        let (first, last) = match (first, seen.last) {
            (Some(first), Some(last)) => (first, last),
            _ => return Err(not_begun()),
        };
        // Bodies that touch on the map but not yet in road coordinates count against the truck.
        let contact = (world.collisions() > 0).then(|| last.contact.unwrap_or(true));
        Ok(Substep { refused: first.refused, contact, ..last })
    }

    fn fuel_g(&self) -> Option<f64> {
        match &self.body {
            Body::Kinematic(_) => None,
            Body::Truck(world) => Some(world.truck().state().powertrain.fuel_used_g),
        }
    }

    fn s_m(&self) -> f64 {
        match &self.body {
            Body::Kinematic(kinematic) => kinematic.ego.s_m,
            Body::Truck(world) => world.truck().state().s_m,
        }
    }

    /// Whether the road ends, or the truck has left it.
    fn is_at_end(&self, shared: &Shared) -> bool {
        match &self.body {
            Body::Kinematic(kinematic) => {
                let front_m = kinematic.ego.s_m + kinematic.limits.geometry.front_m;
                front_m + END_MARGIN_M >= shared.road.length_m()
            }
            Body::Truck(world) => world.status() != Status::Running,
        }
    }
}

/// The last tick of a world, and how many began to brake behind the truck.
struct Seen<'a> {
    last: Option<Substep>,
    behind: &'a mut Behind,
    contacts: &'a mut Contacts,
    brake: u32,
    geometry: &'a Geometry,
    rss: &'a RssConfig,
}

impl Recorder for Seen<'_> {
    fn record(&mut self, tick: &Tick<'_>) {
        let refused: Option<LaneChangeRefusal> = tick.plan.refusal;
        let Tick { now, ego, scene, plan } = *tick;
        let Self { behind, geometry, rss, .. } = self;
        let brakes = behind.begins_to_brake(now, ego, scene, plan.maneuver, geometry, rss);
        self.brake += u32::from(brakes);
        let contact = self.contacts.watch(ego, scene, plan.maneuver, geometry);
        self.last = Some(Substep {
            speed_m_s: tick.ego.speed_m_s,
            reference_m_s: tick.plan.reference_speed_m_s,
            maneuver: tick.plan.maneuver,
            refused,
            contact: contact.or(self.last.and_then(|last| last.contact)),
        });
    }
}

pub(super) fn not_begun() -> SimError {
    SimError::Batch {
        what: "step",
        value: "an environment without an episode".to_owned(),
        why: "reset begins one".to_owned(),
    }
}
