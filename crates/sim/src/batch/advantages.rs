//! What a change now is worth over keeping the lane now, by driving both to the end from the same
//! state.
//!
//! For every action that the gate passes the environment's state is copied, the action taken, and a
//! base policy goes on over the horizon: `A(a) = mean(G(a) - G(keep))`, `G` the sum of the rewards,
//! each multiplied by `discount_frac_s` to the power of its time in seconds. All actions of a rollout meet the
//! same draws of the traffic (common random numbers). To act by the largest advantage is one step of
//! policy iteration over the base policy (Bertsekas, *Reinforcement Learning and Optimal Control*
//! (2019), ch. 2: rollout). With the true drivers the copies know what nobody on the road can see: a
//! teacher or an upper bound, never a decider to be compared.

use std::path::Path;
use std::sync::Arc;

use planner::decider::observation::ObservationSpec;
use planner::decider::{LaneChoice, Policy, Scratch};
use planner::{DeciderKind, Situation, Tactics};

use super::env::{Body, Env, State, not_begun};
use super::{ACTIONS, Batch, Fidelity, mix, share_out};
use crate::SimError;
use crate::overrides::decider_kind;
use crate::world::read_policy;

/// Traffic further behind and ahead of the ego does not reach it within the horizon, m.
const BEHIND_M: f64 = 300.0;
const AHEAD_M: f64 = 600.0;
/// Where `keep` stands among the actions.
const KEEP: usize = 1;

/// Who decides in a rollout after the first action.
#[derive(Debug, Clone, PartialEq)]
pub enum BasePolicy {
    /// A decider that needs the scene alone; others keep the lane.
    Decider(DeciderKind),
    /// A learned policy of the batch's observation.
    Policy(Arc<Policy>),
}

impl BasePolicy {
    /// By the words of [`crate::Overrides::decider`].
    ///
    /// # Errors
    /// [`SimError::Override`] names the word, other errors the file of weights.
    pub fn named(text: &str) -> Result<Self, SimError> {
        Ok(match decider_kind(text)? {
            (_, Some(file)) => Self::Policy(Arc::new(read_policy(Path::new(&file))?)),
            (kind, None) => Self::Decider(kind),
        })
    }
}

/// Who drives the other vehicles in a rollout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drivers {
    /// Those who drive: privileged.
    True,
    /// The means of their classes, who wish the speeds that they have.
    Forgotten,
}

/// How advantages are worked out.
#[derive(Debug, Clone, PartialEq)]
pub struct RolloutSpec {
    /// Who decides after the first action.
    pub base: BasePolicy,
    /// Length of a rollout, s: 1 to 300.
    pub horizon_s: f64,
    /// Rollouts per action, 1 to 1000, each with other draws of the traffic to come.
    pub rollouts: u32,
    /// A reward is worth this part a second later, above 0 to 1.
    pub discount_frac_s: f64,
    /// Who drives the others.
    pub drivers: Drivers,
}

impl Default for RolloutSpec {
    /// One rollout of 30 s to an action, keeping after it, with the true drivers.
    fn default() -> Self {
        Self {
            base: BasePolicy::Decider(DeciderKind::KeepLane),
            horizon_s: 30.0,
            rollouts: 1,
            discount_frac_s: 0.99,
            drivers: Drivers::True,
        }
    }
}

impl RolloutSpec {
    fn check(&self, observation: ObservationSpec) -> Result<(), SimError> {
        let refuse = |what: &'static str, value: String, why: &str| {
            Err(SimError::Batch { what, value, why: why.to_owned() })
        };
        if !(1.0..=300.0).contains(&self.horizon_s) {
            return refuse("horizon_s", self.horizon_s.to_string(), "1 to 300 s");
        }
        if !(1..=1000).contains(&self.rollouts) {
            return refuse("rollouts", self.rollouts.to_string(), "1 to 1000");
        }
        if !(self.discount_frac_s > 0.0 && self.discount_frac_s <= 1.0) {
            return refuse("discount_frac_s", self.discount_frac_s.to_string(), "above 0 to 1");
        }
        match &self.base {
            BasePolicy::Policy(policy) if policy.spec() != observation => {
                let why = "the policy was trained on another observation than the batch makes";
                refuse("base", format!("{:?}", policy.spec()), why)
            }
            BasePolicy::Policy(_) => Ok(()),
            BasePolicy::Decider(kind) => kind.check().map_err(SimError::Stack),
        }
    }
}

impl Batch {
    /// Writes for every environment what each action is worth over keeping, s at the reference
    /// speed: 0 for keep, NaN for an action that the gate does not pass and where the road ends
    /// within the horizon. The environments stay as they are.
    ///
    /// # Errors
    /// [`SimError::Batch`] for a specification out of range, an array that has not 3 numbers per
    /// environment, environments with the full truck or without an episode.
    pub fn advantages(&mut self, spec: &RolloutSpec, out: &mut [f32]) -> Result<(), SimError> {
        spec.check(self.observation)?;
        self.fits("advantages", out.len(), ACTIONS.len())?;
        let items = self.envs.iter().zip(out.chunks_mut(ACTIONS.len()));
        share_out(self.threads, items, |(env, out)| env.advantages(spec, out))
    }

    /// Writes what a decider would do in every environment now, as an action; a change that the gate
    /// does not pass is wished all the same.
    ///
    /// # Errors
    /// [`SimError::Batch`] for a decider that needs more than the scene, an array that has not a
    /// number per environment, environments without an episode.
    pub fn wishes(&mut self, kind: DeciderKind, out: &mut [u8]) -> Result<(), SimError> {
        if matches!(kind, DeciderKind::Dqn | DeciderKind::External) {
            let why = "a decider that needs the scene alone".to_owned();
            return Err(SimError::Batch { what: "decider", value: format!("{kind:?}"), why });
        }
        kind.check()?;
        self.fits("wishes", out.len(), 1)?;
        share_out(self.threads, self.envs.iter_mut().zip(out), |(env, out)| {
            let state = env.state.as_mut().ok_or_else(not_begun)?;
            *out = action(state.body.look(|tactics, at| tactics.wish_of(kind, at))?);
            Ok(())
        })
    }
}

/// The number of a choice among [`ACTIONS`].
fn action(choice: LaneChoice) -> u8 {
    match choice {
        LaneChoice::Left => 0,
        LaneChoice::Keep => 1,
        LaneChoice::Right => 2,
    }
}

/// Whether the gate passes a change to the left, keeping, a change to the right.
fn passes(tactics: &Tactics, at: &Situation<'_>) -> [bool; ACTIONS.len()] {
    let of = |choice| choice == LaneChoice::Keep || tactics.would_pass(choice, at).is_ok();
    ACTIONS.map(of)
}

/// Memory of a policy.
struct Memory {
    obs: Vec<f32>,
    mask: [u8; ACTIONS.len()],
    scratch: Scratch,
}

impl Env {
    fn advantages(&self, spec: &RolloutSpec, out: &mut [f32]) -> Result<(), SimError> {
        let Some(State { body: Body::Kinematic(_), stats, .. }) = &self.state else {
            let (what, why) = ("fidelity", "rollouts are driven by kinematic environments".into());
            let kinematic = self.shared.spec.fidelity == Fidelity::Kinematic;
            let refused = SimError::Batch { what, value: "truck".into(), why };
            return Err(if kinematic { not_begun() } else { refused });
        };
        out.fill(f32::NAN);
        out[KEEP] = 0.0;
        let mut copy = self.copy();
        let open = copy.state.as_mut().ok_or_else(not_begun)?.body.look(passes)?;
        if open.iter().filter(|&&open| open).count() == 1 {
            return Ok(());
        }
        let mut memory = Memory {
            obs: vec![0.0; self.shared.spec.observation.size()],
            mask: [0; ACTIONS.len()],
            scratch: match &spec.base {
                BasePolicy::Policy(policy) => policy.scratch(),
                BasePolicy::Decider(_) => Scratch::default(),
            },
        };
        let mut sums = [0.0; ACTIONS.len()];
        for number in 0..spec.rollouts {
            let seed = mix(stats.seed, u64::from(stats.decisions), u64::from(number));
            for (first, sum) in sums.iter_mut().enumerate().filter(|(a, _)| open[*a]) {
                copy.state.clone_from(&self.state);
                copy.imagine(spec.drivers, seed);
                let Some(worth_s) = copy.drive_out(first as u8, spec, &mut memory)? else {
                    return Ok(());
                };
                *sum += worth_s;
            }
        }
        for (first, out) in out.iter_mut().enumerate().filter(|(a, _)| open[*a]) {
            *out = ((sums[first] - sums[KEEP]) / f64::from(spec.rollouts)) as f32;
        }
        Ok(())
    }

    /// What the traffic of a rollout is.
    fn imagine(&mut self, drivers: Drivers, seed: u64) {
        let Some(State { body: Body::Kinematic(kinematic), .. }) = &mut self.state else { return };
        let s_m = kinematic.ego.s_m;
        let traffic = &mut kinematic.traffic;
        traffic.keep_within(s_m - BEHIND_M, s_m + AHEAD_M);
        traffic.reseed(seed);
        if drivers == Drivers::Forgotten {
            traffic.forget_drivers();
        }
    }

    /// The discounted rewards of an action and what the base policy does after it, s; `None` where
    /// the road ends before.
    fn drive_out(
        &mut self,
        first: u8,
        spec: &RolloutSpec,
        memory: &mut Memory,
    ) -> Result<Option<f64>, SimError> {
        let decision_s = self.shared.spec.decision_s;
        let decays = libm::pow(spec.discount_frac_s, decision_s);
        let decisions = libm::round(spec.horizon_s / decision_s).max(1.0) as u32;
        let (mut sum, mut worth, mut action) = (0.0, 1.0, first);
        for number in 1..=decisions {
            let ended = self.step(action)?;
            sum += worth * ended.reward_s;
            worth *= decays;
            if ended.terminated {
                break;
            }
            if self.is_at_end() {
                return Ok(None);
            }
            if number < decisions {
                action = self.follow(&spec.base, memory)?;
            }
        }
        Ok(Some(sum))
    }

    /// What the base policy does.
    fn follow(&mut self, base: &BasePolicy, memory: &mut Memory) -> Result<u8, SimError> {
        match base {
            BasePolicy::Decider(kind) => {
                let state = self.state.as_mut().ok_or_else(not_begun)?;
                Ok(action(state.body.look(|tactics, at| tactics.wish_of(*kind, at))?))
            }
            BasePolicy::Policy(policy) => {
                let Memory { obs, mask, scratch } = memory;
                self.observe(obs, mask)?;
                let allowed = |choice| mask[usize::from(action(choice))] == 1;
                Ok(action(policy.choose(obs, scratch, allowed)))
            }
        }
    }
}
