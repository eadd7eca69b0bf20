//! Many environments at once, for learning and for evaluation, written into the caller's arrays.
//!
//! | file | holds |
//! |---|---|
//! | `mod` | the batch: shapes, threads, episodes that begin again |
//! | `shared` | what the environments of a spec have in common; where an episode begins |
//! | `env` | one environment: decision, observation, mask |
//! | `kinematic` | the ego as a point on its path ([`Fidelity::Kinematic`]) |
//! | `contacts` | whom the truck touches, and who is the cause |
//! | `reward` | what a decision earns |
//! | `stats` | what an episode came to |
//! | `advantages` | what a change now is worth over keeping, by rollouts |
//!
//! An action is looked at by the safety gate like any wish; the mask says before what the gate will
//! do. Threads share out whole environments: no result depends on their number. An episode that has
//! ended begins again in the same step (`autoreset_mode` `SAME_STEP` of Gymnasium), its last
//! observation is in [`Views::final_obs`].

mod advantages;
mod contacts;
mod env;
mod kinematic;
mod reward;
mod shared;
mod stats;

use std::sync::Arc;

use planner::decider::LaneChoice;
use planner::decider::observation::ObservationSpec;
use tractrix_core::{LaneChangeRefusal, Maneuver};
use traffic_client::native::WindowConfig;

pub use advantages::{BasePolicy, Drivers, RolloutSpec};
use env::Env;
pub use env::EnvSnapshot;
pub use reward::RewardConfig;
use shared::Shared;
pub use stats::EpisodeStats;

use crate::{Scenario, SimError, World};

/// A step of a kinematic ego, and of every reward, s.
pub const SUBSTEP_S: f64 = 0.1;
/// What an action asks for: the paper's -1, 0, 1.
pub const ACTIONS: [LaneChoice; 3] = [LaneChoice::Left, LaneChoice::Keep, LaneChoice::Right];

/// How the ego moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fidelity {
    /// A point on its planned path: tactics without controllers and plant, steps of 0.1 s.
    Kinematic,
    /// The full truck and the full stack: a [`World`].
    Truck,
}

/// One environment.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvSpec {
    /// Road, truck, start, stack and traffic; its decider is replaced by the actions.
    pub scenario: Scenario,
    /// What is observed.
    pub observation: ObservationSpec,
    /// What a decision earns.
    pub reward: RewardConfig,
    /// Time between two decisions, s: 0.1, 0.2, 0.5 or 1.
    pub decision_s: f64,
    /// An episode is truncated after this time, s.
    pub episode_s: f64,
    /// How the ego moves.
    pub fidelity: Fidelity,
    /// The ego starts up to so far beyond the scenario's start, m, as the episode's seed says.
    pub start_spread_m: f64,
    /// Beyond it vehicles act less often; `None`: as the scenario says.
    pub window: Option<WindowConfig>,
}

impl EnvSpec {
    /// Decisions of 1 s under the mask, our observation and reward, episodes of 600 s; a kinematic
    /// ego with a window.
    #[must_use]
    pub fn new(scenario: Scenario, fidelity: Fidelity) -> Self {
        Self {
            scenario,
            observation: ObservationSpec::Tractrix1,
            reward: RewardConfig::default(),
            decision_s: 1.0,
            episode_s: 600.0,
            fidelity,
            start_spread_m: 0.0,
            window: (fidelity == Fidelity::Kinematic).then(WindowConfig::default),
        }
    }

    /// The paper's: 216 numbers, Eq. 17, decisions at 10 Hz, the mask not to be used.
    #[must_use]
    pub fn paper(scenario: Scenario, fidelity: Fidelity) -> Self {
        Self {
            observation: ObservationSpec::Paper216,
            reward: RewardConfig::paper(),
            decision_s: SUBSTEP_S,
            ..Self::new(scenario, fidelity)
        }
    }
}

/// The caller's arrays, row by row of an environment.
#[derive(Debug)]
pub struct Views<'a> {
    /// Observations, [`Batch::observation_size`] each.
    pub obs: &'a mut [f32],
    /// 1 where the gate passes the action; 3 each.
    pub mask: &'a mut [u8],
    /// Rewards, s at the reference speed.
    pub reward: &'a mut [f32],
    /// 1 where a collision has ended the episode.
    pub terminated: &'a mut [u8],
    /// 1 where time or road has ended the episode.
    pub truncated: &'a mut [u8],
    /// Last observations of ended episodes; other rows stay as they are.
    pub final_obs: &'a mut [f32],
    /// Figures of the episode, of the one that has just ended where one has.
    pub episodes: &'a mut [EpisodeStats],
}

/// What a step of the ego came to.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Substep {
    speed_m_s: f64,
    reference_m_s: f64,
    maneuver: Maneuver,
    refused: Option<LaneChangeRefusal>,
    /// Somebody is touched; true: by the truck's doing.
    contact: Option<bool>,
}

/// An environment with its rows.
struct Row<'a> {
    env: &'a mut Env,
    obs: &'a mut [f32],
    mask: &'a mut [u8],
    reward: &'a mut f32,
    terminated: &'a mut u8,
    truncated: &'a mut u8,
    final_obs: &'a mut [f32],
    episode: &'a mut EpisodeStats,
}

/// Environments that are stepped together.
pub struct Batch {
    envs: Vec<Env>,
    seed: u64,
    threads: usize,
    observation: ObservationSpec,
}

impl Batch {
    /// Builds the environments; those with equal specs share road, truck and warmed traffic.
    ///
    /// # Errors
    /// [`SimError`] names what cannot be used.
    pub fn new(specs: Vec<EnvSpec>, seed: u64, threads: usize) -> Result<Self, SimError> {
        let bad = |what: &'static str, value: String, why: &str| {
            Err(SimError::Batch { what, value, why: why.to_owned() })
        };
        let Some(first) = specs.first() else {
            return bad("environments", "0".to_owned(), "at least one");
        };
        if !(1..=1024).contains(&threads) {
            return bad("threads", threads.to_string(), "1 to 1024");
        }
        let observation = first.observation;
        if specs.iter().any(|spec| spec.observation != observation) {
            return bad("observation", "several".to_owned(), "the same in all environments");
        }
        let mut kinds: Vec<(EnvSpec, Arc<Shared>)> = Vec::new();
        let mut envs = Vec::with_capacity(specs.len());
        for (index, spec) in specs.into_iter().enumerate() {
            let known = kinds.iter().find(|(other, _)| *other == spec).map(|(_, s)| Arc::clone(s));
            let shared = match known {
                Some(shared) => shared,
                None => {
                    let shared = Arc::new(Shared::new(spec.clone())?);
                    kinds.push((spec, Arc::clone(&shared)));
                    shared
                }
            };
            envs.push(Env::new(shared, index));
        }
        Ok(Self { envs, seed, threads, observation })
    }

    /// Number of environments.
    #[must_use]
    pub fn len(&self) -> usize {
        self.envs.len()
    }

    /// Whether there is none; there is always one.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.envs.is_empty()
    }

    /// Numbers in an observation.
    #[must_use]
    pub const fn observation_size(&self) -> usize {
        self.observation.size()
    }

    /// The world of an environment with [`Fidelity::Truck`] that has begun.
    #[must_use]
    pub fn world(&self, i: usize) -> Option<&World> {
        self.envs.get(i)?.world()
    }

    /// Begins an episode in every environment: with `seeds`, one each, or with the next of the
    /// batch's own. Rewards and ends are written as zero.
    ///
    /// # Errors
    /// [`SimError::Batch`] for arrays of another size; what a start cannot be built from.
    pub fn reset(&mut self, seeds: Option<&[u64]>, out: &mut Views<'_>) -> Result<(), SimError> {
        if let Some(seeds) = seeds {
            self.fits("seeds", seeds.len(), 1)?;
        }
        let which = |i: usize| seeds.map_or(Some(None), |s| Some(s.get(i).copied()));
        self.begin(which, out)
    }

    /// As [`Self::reset`] for those environments alone that `which` names, with their seed or the
    /// next of their own; the rows of the others stay as they are.
    ///
    /// # Errors
    /// As [`Self::reset`].
    pub fn begin(
        &mut self,
        which: impl Fn(usize) -> Option<Option<u64>> + Sync,
        out: &mut Views<'_>,
    ) -> Result<(), SimError> {
        let batch_seed = self.seed;
        self.each(out, |i, row| {
            let Some(seed) = which(i) else { return Ok(()) };
            row.env.reset(batch_seed, seed)?;
            (*row.reward, *row.terminated, *row.truncated) = (0.0, 0, 0);
            *row.episode = EpisodeStats::default();
            row.env.observe(row.obs, row.mask)
        })
    }

    /// Drives one decision in every environment.
    ///
    /// # Errors
    /// [`SimError::Batch`] for an action that is none, arrays of another size, a batch that was not
    /// reset. Nothing has moved then.
    pub fn step(&mut self, actions: &[u8], out: &mut Views<'_>) -> Result<(), SimError> {
        self.fits("actions", actions.len(), 1)?;
        if let Some(action) = actions.iter().find(|&&a| usize::from(a) >= ACTIONS.len()) {
            let why = "0 left, 1 keep, 2 right".to_owned();
            return Err(SimError::Batch { what: "action", value: action.to_string(), why });
        }
        let batch_seed = self.seed;
        self.each(out, |i, row| {
            let ended = row.env.step(actions[i])?;
            *row.reward = ended.reward_s as f32;
            *row.terminated = u8::from(ended.terminated);
            *row.truncated = u8::from(ended.truncated);
            *row.episode = row.env.state.as_ref().map(|state| state.stats).unwrap_or_default();
            row.env.observe(row.obs, row.mask)?;
            if ended.terminated || ended.truncated {
                row.final_obs.copy_from_slice(row.obs);
                row.env.reset(batch_seed, None)?;
                row.env.observe(row.obs, row.mask)?;
            }
            Ok(())
        })
    }

    /// Keeps the state of an environment; an index beyond the last keeps nothing.
    pub fn save(&self, i: usize, to: &mut EnvSnapshot) {
        if let Some(env) = self.envs.get(i) {
            env.save(to);
        }
    }

    /// Puts a kept state back into an environment of the same spec.
    pub fn restore(&mut self, i: usize, from: &EnvSnapshot) {
        if let Some(env) = self.envs.get_mut(i) {
            env.restore(from);
        }
    }

    /// Whether an array has a row of `width` per environment.
    fn fits(&self, what: &'static str, is: usize, width: usize) -> Result<(), SimError> {
        let wants = width * self.envs.len();
        if is == wants {
            return Ok(());
        }
        let why = format!("{wants} numbers, {width} for each of {} environments", self.envs.len());
        Err(SimError::Batch { what, value: format!("{is} numbers"), why })
    }

    /// Does something with every environment and its rows, shared out to the threads.
    fn each(
        &mut self,
        out: &mut Views<'_>,
        work: impl Fn(usize, Row<'_>) -> Result<(), SimError> + Sync,
    ) -> Result<(), SimError> {
        let size = self.observation.size();
        for (what, is, width) in [
            ("obs", out.obs.len(), size),
            ("mask", out.mask.len(), ACTIONS.len()),
            ("reward", out.reward.len(), 1),
            ("terminated", out.terminated.len(), 1),
            ("truncated", out.truncated.len(), 1),
            ("final_obs", out.final_obs.len(), size),
            ("episodes", out.episodes.len(), 1),
        ] {
            self.fits(what, is, width)?;
        }
        let rows = self
            .envs
            .iter_mut()
            .zip(out.obs.chunks_mut(size).zip(out.final_obs.chunks_mut(size)))
            .zip(out.mask.chunks_mut(ACTIONS.len()).zip(out.episodes.iter_mut()))
            .zip(out.terminated.iter_mut().zip(out.truncated.iter_mut()))
            .zip(out.reward.iter_mut())
            .map(|((((env, (obs, final_obs)), (mask, episode)), ends), reward)| {
                let (terminated, truncated) = ends;
                Row { env, obs, mask, reward, terminated, truncated, final_obs, episode }
            })
            .enumerate();
        share_out(self.threads, rows, |(i, row)| work(i, row))
    }
}

/// Does something with every item; each thread takes items that lie side by side. The error is that
/// of the first item that has one.
fn share_out<T: Send>(
    threads: usize,
    mut items: impl ExactSizeIterator<Item = T>,
    work: impl Fn(T) -> Result<(), SimError> + Sync,
) -> Result<(), SimError> {
    if threads == 1 {
        return items.try_for_each(work);
    }
    let share = items.len().div_ceil(threads);
    let work = &work;
    std::thread::scope(|scope| {
        let mut running = Vec::with_capacity(threads);
        loop {
            let part: Vec<_> = items.by_ref().take(share).collect();
            if part.is_empty() {
                break;
            }
            running.push(scope.spawn(move || part.into_iter().try_for_each(work)));
        }
        let mut outcome = Ok(());
        for thread in running {
            let done = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            outcome = outcome.and(done);
        }
        outcome
    })
}

/// Well mixed bits of three numbers (the finaliser of `splitmix64`, Steele et al. 2014).
fn mix(seed: u64, index: u64, number: u64) -> u64 {
    let finish = |z: u64| {
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let step = 0x9e37_79b9_7f4a_7c15_u64;
    let a = finish(seed.wrapping_add(step));
    let b = finish(a ^ index.wrapping_mul(step).wrapping_add(step));
    finish(b ^ number.wrapping_mul(step).wrapping_add(step))
}
