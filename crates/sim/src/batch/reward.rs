//! What a decision earns, in seconds at the reference speed.
//!
//! Over the steps of a decision: `sum((1 - |v - v_ref| / 20 m/s) dt)`, less what a change, a refused
//! wish and a collision cost. The paper's Eq. 17 (with the sign of its speed term right) is a tenth
//! of its figures, as its steps of 0.1 s earn 1 each.

use serde::{Deserialize, Serialize};

use super::SUBSTEP_S;

/// Speed error that takes a step's whole reward, m/s.
const WORTHLESS_M_S: f64 = 20.0;

/// Costs, s at the reference speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RewardConfig {
    /// Of an action that is not keep, whatever comes of it.
    pub wish_s: f64,
    /// Of a change that begins.
    pub change_s: f64,
    /// Of a wish that is refused.
    pub refused_s: f64,
    /// Of a collision.
    pub collision_s: f64,
}

impl Default for RewardConfig {
    /// A change costs 4 m at 60 km/h: enough against changes that bring nothing, too little to make
    /// never changing the best policy.
    fn default() -> Self {
        Self { wish_s: 0.0, change_s: 0.25, refused_s: 0.0, collision_s: 100.0 }
    }
}

impl RewardConfig {
    /// The paper's Eq. 17: 10 steps for a wish, 20 for one that is not safe.
    #[must_use]
    pub const fn paper() -> Self {
        Self { wish_s: 1.0, change_s: 0.0, refused_s: 2.0, collision_s: 0.0 }
    }

    /// What one step of [`SUBSTEP_S`] earns at a speed and a reference speed, m/s.
    #[must_use]
    pub fn of_step(speed_m_s: f64, reference_m_s: f64) -> f64 {
        (1.0 - (speed_m_s - reference_m_s).abs() / WORTHLESS_M_S) * SUBSTEP_S
    }

    /// What a decision costs.
    pub(super) fn cost(&self, wished: bool, begun: u32, refused: bool, collided: bool) -> f64 {
        let if_so = |so: bool, cost_s: f64| if so { cost_s } else { 0.0 };
        if_so(wished, self.wish_s)
            + f64::from(begun) * self.change_s
            + if_so(refused, self.refused_s)
            + if_so(collided, self.collision_s)
    }
}
