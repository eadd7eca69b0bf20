//! One-step rollouts on board: drives ahead what keeping and each change lead to, and takes what gets
//! furthest (Bertsekas, *Reinforcement Learning and Optimal Control* (2019), ch. 2).
//!
//! What is known is the scene. Others follow by the intelligent driver model of their class, wish the
//! speed that they have and keep their lanes; the truck follows in the lanes that it takes up. Each
//! course is worth the way driven within the horizon, a change must pay its cost. The work is bounded:
//! at most [`NEAR`] vehicles in each of three lanes, [`STEP_S`] over the horizon, no memory asked for.

use super::mobil::{accel_m_s2, driver};
use super::{LaneChoice, View};
use crate::PlannerError;
use crate::error::config_in;
use crate::safety::in_lane;
use driver_models::{Idm, ballistic};
use serde::{Deserialize, Serialize};
use tractrix_core::{Neighbour, VehicleClass};

/// Parameters of the rollouts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RolloutConfig {
    /// Time that is driven ahead, s.
    pub horizon_s: f64,
    /// Way that a change must gain, m.
    pub change_cost_m: f64,
    /// Time during which the truck takes up both lanes, s.
    pub change_s: f64,
}

impl Default for RolloutConfig {
    fn default() -> Self {
        Self { horizon_s: 30.0, change_cost_m: 5.0, change_s: 5.0 }
    }
}

impl RolloutConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("decider.rollout.horizon_s", self.horizon_s, 5.0, 60.0)?;
        config_in("decider.rollout.change_cost_m", self.change_cost_m, 0.0, 500.0)?;
        config_in("decider.rollout.change_s", self.change_s, 0.0, 20.0)
    }
}

/// Step of the rollouts, s.
const STEP_S: f64 = 0.5;
/// Vehicles that count in a lane: the nearest ahead and the nearest behind.
const AHEAD: usize = 8;
const BEHIND: usize = 3;
const NEAR: usize = AHEAD + BEHIND;

/// Another vehicle.
#[derive(Debug, Clone, Copy)]
struct Other {
    idm: Idm,
    speed_m_s: f64,
    front_s_m: f64,
    length_m: f64,
}

/// A lane as it is seen: the vehicles from the front to the back, and how many are ahead.
#[derive(Debug, Clone, Copy)]
struct Lane {
    others: [Option<Other>; NEAR],
    ahead: usize,
}

/// The truck.
#[derive(Debug, Clone, Copy)]
struct Ego {
    idm: Idm,
    speed_m_s: f64,
    front_s_m: f64,
    length_m: f64,
}

impl Lane {
    fn seen(view: &View<'_>, lane: u16) -> Self {
        let extent = view.extent;
        let middle = |n: &Neighbour| 0.5 * (n.front_s_m + n.rear_s_m);
        let ego_m = 0.5 * (extent.front_s_m + extent.rear_s_m);
        let there = |n: &&Neighbour| in_lane(view.road, lane, n, extent.width_m);
        let mut others = [None; NEAR];
        // Nearest first outwards from the truck, whatever the scene's order is.
        let mut take = |count: usize, is_ahead: bool, slot: &dyn Fn(usize) -> usize| {
            let mut last_m = ego_m;
            for found in 0..count {
                let beyond = |n: &&Neighbour| {
                    let m = middle(n);
                    if is_ahead { m >= ego_m && m > last_m } else { m < last_m }
                };
                let candidates = view.scene.neighbours.iter().filter(there).filter(beyond);
                let nearest = candidates
                    .min_by(|a, b| (middle(a) - ego_m).abs().total_cmp(&(middle(b) - ego_m).abs()));
                let Some(n) = nearest else { return found };
                last_m = middle(n);
                others[slot(found)] = Some(Other {
                    idm: driver(n.class, n.speed_m_s.max(1.0)),
                    speed_m_s: n.speed_m_s,
                    front_s_m: n.front_s_m,
                    length_m: n.front_s_m - n.rear_s_m,
                });
            }
            count
        };
        let ahead = take(AHEAD, true, &|found| AHEAD - 1 - found);
        take(BEHIND, false, &|found| AHEAD + found);
        others[..AHEAD].rotate_left(AHEAD - ahead);
        others.copy_within(AHEAD.., ahead);
        others[ahead + BEHIND..].fill(None);
        Self { others, ahead }
    }

    /// Gap ahead of the truck, m, and the speed there, m/s.
    fn lead(&self, ego: &Ego) -> Option<(f64, f64)> {
        let lead = self.others[self.ahead.checked_sub(1)?]?;
        Some((lead.front_s_m - lead.length_m - ego.front_s_m, lead.speed_m_s))
    }

    /// Moves everybody by a step; the truck is in the lane or not.
    fn step(&mut self, ego: Option<&Ego>) {
        let mut before: Option<(f64, f64)> = None;
        for (i, slot) in self.others.iter_mut().enumerate() {
            let Some(other) = slot else { break };
            if let Some(ego) = ego.filter(|_| i == self.ahead) {
                before = Some((ego.front_s_m - ego.length_m, ego.speed_m_s));
            }
            let lead = before.map(|(rear_m, m_s)| (rear_m - other.front_s_m, m_s));
            before = Some((other.front_s_m - other.length_m, other.speed_m_s));
            let accel = accel_m_s2(&other.idm, other.speed_m_s, lead).max(HARDEST_M_S2);
            let (speed_m_s, way_m) = ballistic(other.speed_m_s, accel, STEP_S);
            (other.speed_m_s, other.front_s_m) = (speed_m_s, other.front_s_m + way_m);
        }
    }
}

/// Tyres give no more, m/s².
const HARDEST_M_S2: f64 = -8.0;

/// Way that the truck drives within the horizon, m: in its lane, or into another one.
fn way_m(config: &RolloutConfig, mut ego: Ego, mut from: Lane, to: Option<Lane>) -> f64 {
    let start_m = ego.front_s_m;
    let changes = to.is_some();
    let mut to = to.unwrap_or(from);
    let steps = libm::ceil(config.horizon_s / STEP_S) as u32;
    for step in 0..steps {
        let leaves = changes && f64::from(step) * STEP_S >= config.change_s;
        let in_from = (!leaves).then_some(&ego);
        let in_to = changes.then_some(&ego);
        let following = |lane: &Lane| accel_m_s2(&ego.idm, ego.speed_m_s, lane.lead(&ego));
        let free = accel_m_s2(&ego.idm, ego.speed_m_s, None);
        let accel = [in_from.map(|_| following(&from)), in_to.map(|_| following(&to))]
            .into_iter()
            .flatten()
            .fold(free, f64::min)
            .max(HARDEST_M_S2);
        from.step(in_from);
        if changes {
            to.step(in_to);
        }
        let (speed_m_s, way_m) = ballistic(ego.speed_m_s, accel, STEP_S);
        (ego.speed_m_s, ego.front_s_m) = (speed_m_s, ego.front_s_m + way_m);
    }
    ego.front_s_m - start_m
}

/// The wish: the change that gains most over keeping, its cost paid, among those that the gate
/// passes. A frame of its own: the lanes lie on the stack of a small computer only where this
/// decides.
#[inline(never)]
#[must_use]
pub(crate) fn rollout(
    view: &View<'_>,
    config: &RolloutConfig,
    passes: impl Fn(LaneChoice) -> bool,
) -> LaneChoice {
    let ego = Ego {
        idm: driver(VehicleClass::Truck, view.wish_speed_m_s),
        speed_m_s: view.ego.speed_m_s,
        front_s_m: view.extent.front_s_m,
        length_m: view.extent.front_s_m - view.extent.rear_s_m,
    };
    let own = Lane::seen(view, view.lane);
    // Nobody is in the way: nothing to gain.
    if own.ahead == 0 {
        return LaneChoice::Keep;
    }
    let kept_m = way_m(config, ego, own, None);
    [LaneChoice::Left, LaneChoice::Right]
        .into_iter()
        .filter_map(|choice| {
            let lane = view.lasting_beside(choice).filter(|_| passes(choice))?;
            let gained_m = way_m(config, ego, own, Some(Lane::seen(view, lane))) - kept_m;
            (gained_m > config.change_cost_m).then_some((choice, gained_m))
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(LaneChoice::Keep, |(choice, _)| choice)
}
