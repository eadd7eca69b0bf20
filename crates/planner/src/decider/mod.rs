//! Who wishes lane changes. A decider only wishes; the safety gate decides whether it is driven.
//!
//! | file | holds |
//! |---|---|
//! | `keep_right` | back to the right lane when it serves |
//! | `rules` | the paper's rule with a distance |
//! | `mobil` | MOBIL over the intelligent driver model |
//! | `rollout` | what gets furthest, driven ahead on board |
//! | `policy` | a learned policy's forward pass |
//! | [`observation`] | what a learned policy sees |

mod keep_right;
mod mobil;
pub mod observation;
mod policy;
mod rollout;
mod rules;
#[cfg(test)]
mod tests;

use keep_right::STAY_S;
pub(crate) use keep_right::keep_right;
pub use mobil::MobilConfig;
pub(crate) use mobil::{leaving_gap_m, mobil};
pub use policy::{Policy, Scratch};
pub use rollout::RolloutConfig;
pub(crate) use rollout::rollout;
pub(crate) use rules::rules;

use crate::PlannerError;
use crate::error::config_in;
use crate::safety::{EgoExtent, ahead, behind, in_lane};
use road::{LaneEnd, LaneKind, Road};
use serde::{Deserialize, Serialize};
pub use tractrix_core::LaneChoice;
use tractrix_core::{EgoState, Geometry, Neighbour, Scene};

/// Which decider to use.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DeciderKind {
    /// Never wishes a change.
    #[default]
    KeepLane,
    /// The paper's rule-based state machine; 50 m is its aggressive, 100 m its neutral, 150 m its
    /// conservative driver.
    Rules {
        /// The paper's `d`, m.
        distance_m: f64,
    },
    /// Minimising overall braking induced by lane changes (Kesting et al. 2007).
    Mobil(MobilConfig),
    /// What gets furthest by driving keeping and each change ahead, from the scene alone.
    Rollout(RolloutConfig),
    /// A learned policy, given to [`crate::Stack::with_policy`].
    Dqn,
    /// Wishes come from outside: [`crate::Stack::request_lane_change`].
    External,
}

impl DeciderKind {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        match self {
            Self::Rules { distance_m } => {
                config_in("decider.rules.distance_m", *distance_m, 5.0, 500.0)
            }
            Self::Mobil(config) => config.check(),
            Self::Rollout(config) => config.check(),
            Self::KeepLane | Self::Dqn | Self::External => Ok(()),
        }
    }
}

/// What a decider looks at.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    /// The truck.
    pub ego: &'a EgoState,
    /// Its extent.
    pub extent: EgoExtent,
    /// The others.
    pub scene: &'a Scene,
    /// The road.
    pub road: &'a Road,
    /// The lane that the truck keeps.
    pub lane: u16,
    /// The speed that the truck would drive here without others, m/s.
    pub wish_speed_m_s: f64,
}

impl<'a> View<'a> {
    /// A view from the truck.
    #[must_use]
    pub(crate) fn new(
        ego: &'a EgoState,
        geometry: &Geometry,
        scene: &'a Scene,
        road: &'a Road,
        lane: u16,
        wish_speed_m_s: f64,
    ) -> Self {
        let extent = EgoExtent::new(ego, geometry);
        Self { ego, extent, scene, road, lane, wish_speed_m_s }
    }

    /// The through lane on a side, if there is one here.
    #[must_use]
    pub(crate) fn beside(&self, choice: LaneChoice) -> Option<u16> {
        let id = match choice {
            LaneChoice::Left => self.road.left_of(self.lane, self.ego.s_m),
            LaneChoice::Right => self.road.right_of(self.lane, self.ego.s_m),
            LaneChoice::Keep => None,
        }?;
        let through = self.road.lanes().get(usize::from(id))?.kind == LaneKind::Driving;
        through.then_some(id)
    }

    /// The through lane on a side that serves for a while. Whoever changes into one that ends must
    /// soon leave it again, and waits at its end for a gap.
    #[must_use]
    pub(crate) fn lasting_beside(&self, choice: LaneChoice) -> Option<u16> {
        let lane = self.beside(choice)?;
        let track = self.road.lanes().get(usize::from(lane))?;
        let wish_m_s = self.wish_speed_m_s.max(self.ego.speed_m_s);
        let lasts = track.end == LaneEnd::Continues
            || track.s_end_m - self.ego.s_m >= LEAVE_WITHIN_M + STAY_S * wish_m_s;
        lasts.then_some(lane)
    }

    /// The nearest vehicle ahead in a lane and the gap to it, m.
    #[must_use]
    pub(crate) fn ahead(&self, lane: u16) -> Option<(&'a Neighbour, f64)> {
        let width = self.extent.width_m;
        let n = ahead(self.scene, &self.extent, |n| in_lane(self.road, lane, n, width))?;
        Some((n, n.rear_s_m - self.extent.front_s_m))
    }

    /// The nearest vehicle behind in a lane and the gap from its front to the trailer's rear, m;
    /// negative alongside.
    #[must_use]
    pub(crate) fn behind(&self, lane: u16) -> Option<(&'a Neighbour, f64)> {
        let width = self.extent.width_m;
        let n = behind(self.scene, &self.extent, |n| in_lane(self.road, lane, n, width))?;
        Some((n, self.extent.rear_s_m - n.front_s_m))
    }
}

/// A lane that ends within this distance must be left, whatever the decider wishes, m.
const LEAVE_WITHIN_M: f64 = 800.0;

/// How far ahead of a station a lane ends that must be left by then, m.
#[must_use]
pub(crate) fn lane_ends_in_m(road: &Road, lane: u16, s_m: f64) -> Option<f64> {
    let track = road.lanes().get(usize::from(lane))?;
    let rest_m = track.s_end_m - s_m;
    (track.end != LaneEnd::Continues && rest_m < LEAVE_WITHIN_M).then_some(rest_m)
}

/// Whether the truck's lane ends soon.
#[must_use]
pub(crate) fn lane_ends(view: &View<'_>) -> bool {
    lane_ends_in_m(view.road, view.lane, view.ego.s_m).is_some()
}

/// The side on which a through lane goes on, left first.
#[must_use]
pub(crate) fn leave_ending_lane(view: &View<'_>) -> LaneChoice {
    [LaneChoice::Left, LaneChoice::Right]
        .into_iter()
        .find(|&choice| view.beside(choice).is_some())
        .unwrap_or(LaneChoice::Keep)
}
