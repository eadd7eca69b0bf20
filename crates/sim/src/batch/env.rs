//! One environment: a body, what it has seen, the figures of its episode.

use std::sync::Arc;

use planner::decider::LaneChoice;
use planner::decider::observation::{Observer, frame};
use planner::safety::RssConfig;
use planner::{Situation, Tactics};
use tractrix_core::{Geometry, LaneChangeRefusal, Maneuver, Recorder, Tick, Vehicle};

use super::contacts::Contacts;
use super::kinematic::Kinematic;
use super::reward::RewardConfig;
use super::shared::Shared;
use super::{ACTIONS, EpisodeStats, SUBSTEP_S, Substep, mix};
use crate::behind::Behind;
use crate::{SimError, Status, World};

/// The front comes so near to the end of the road, m.
const END_MARGIN_M: f64 = 10.0;

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
