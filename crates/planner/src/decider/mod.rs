//! Who wishes lane changes. A decider only wishes; the safety gate decides whether it is driven.

use crate::PlannerError;
use serde::{Deserialize, Serialize};

/// What a decider wishes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneChoice {
    /// The lane on the left (the paper's -1).
    Left,
    /// This lane (0).
    #[default]
    Keep,
    /// The lane on the right (1).
    Right,
}

/// Which decider to use.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DeciderKind {
    /// Never wishes a change.
    #[default]
    KeepLane,
    /// Wishes come from outside: [`crate::Stack::request_lane_change`].
    External,
}

impl DeciderKind {
    /// Checks the parameters.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        Ok(())
    }
}
