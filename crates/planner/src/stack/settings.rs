//! What may be set while the stack drives.

use alloc::sync::Arc;

use super::{OutsideDemand, SpeedPlannerKind, Stack};
use crate::decider::{DeciderKind, LaneChoice, Policy};
use crate::{PlannerError, SpeedProfile};

impl Stack {
    /// Sets the driver's set speed, m/s, clamped to 0..40; a non-finite value is ignored.
    pub fn set_speed(&mut self, speed_m_s: f64) {
        if speed_m_s.is_finite() {
            self.tactics.config.set_speed_m_s = speed_m_s.clamp(0.0, 40.0);
        }
    }

    /// Gives the stack a speed profile that was planned ahead of time (speed planner `predictive`,
    /// the paper's way); it replaces the former one and planning while driving. Where it has no
    /// speed the set speed is the reference and the plan's status is
    /// [`tractrix_core::PlanStatus::Fallback`]. `None` goes back to planning while driving.
    pub fn set_speed_profile(&mut self, profile: Option<SpeedProfile>) {
        self.tactics.profile = profile;
    }

    /// Wishes a lane change from outside (decider `external`); it is looked at in the next tick.
    pub fn request_lane_change(&mut self, wish: LaneChoice) {
        self.tactics.request_lane_change(wish);
    }

    /// Another decider from here on; a change under way is driven to its end. `policy` is the
    /// learned decider's: with none it keeps the one that it has.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key that cannot be used; [`PlannerError::NoPolicy`] if
    /// the decider is the learned one and there is no policy. The decider is what it was then.
    pub fn set_decider(
        &mut self,
        decider: DeciderKind,
        policy: Option<Arc<Policy>>,
    ) -> Result<(), PlannerError> {
        self.tactics.set_decider(decider, policy)
    }

    /// Another source of the reference speed from here on. A plan of the speed ahead is made anew.
    pub fn set_speed_planner(&mut self, kind: SpeedPlannerKind) {
        self.tactics.set_speed_planner(kind);
    }

    /// Somebody else drives from here on, or nobody else. A demand holds until the next one, and no
    /// longer than [`crate::safety::GuardConfig::demand_age_max_s`]; then the minimal-risk manoeuvre
    /// stops the truck in its lane. The guard looks at demands as at plans of its own.
    pub fn obey_outside(&mut self, demand: Option<OutsideDemand>) {
        self.demand = demand;
    }

    /// What who drives from outside asked for last.
    #[must_use]
    pub fn outside_demand(&self) -> Option<&OutsideDemand> {
        self.demand.as_ref()
    }
}
