//! What an episode came to.

use serde::Serialize;

/// Figures of an episode, so far or at its end.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct EpisodeStats {
    /// Seed that the episode began with.
    pub seed: u64,
    /// Decisions.
    pub decisions: u32,
    /// Duration, s.
    pub time_s: f64,
    /// Sum of the rewards, s at the reference speed.
    pub reward_s: f64,
    /// Distance driven along the road, m.
    pub distance_m: f64,
    /// Sum over the steps of (v_ref - v)/v_ref, and their number.
    pub(super) delta: (f64, u32),
    /// Lane changes begun.
    pub lane_changes: u32,
    /// Changes turned back.
    pub aborted: u32,
    /// Wishes that were refused.
    pub refused: u32,
    /// Vehicles behind that braked hard because of the truck.
    pub hard_braking_caused: u32,
    /// The episode ended by touching another vehicle.
    pub collided: bool,
    /// And the truck was the cause: it ran into somebody who had not just cut in, or changed lanes
    /// into somebody who kept theirs.
    pub collision_caused: bool,
    /// Fuel used, g; none for a kinematic ego, which has no engine.
    pub fuel_g: Option<f64>,
}

impl EpisodeStats {
    /// Mean of (v_ref - v)/v_ref.
    #[must_use]
    pub fn delta_speed_frac(&self) -> f64 {
        self.delta.0 / f64::from(self.delta.1.max(1))
    }
}
