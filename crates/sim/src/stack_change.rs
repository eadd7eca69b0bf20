//! A change of a stack while it drives: what a user or another controller asks for between two
//! ticks. In words it stands in the recording, so that the drive can be repeated.

use std::path::Path;
use std::sync::Arc;

use planner::decider::DeciderKind;
use planner::{OutsideDemand, SpeedPlannerKind, Stack};
use serde::{Deserialize, Serialize};

use crate::{SimError, overrides, read_policy};

/// A change, before the next tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum StackChange {
    /// Another decider.
    Decider {
        /// Which.
        kind: DeciderKind,
        /// File of weights of the learned one.
        policy_file: Option<String>,
    },
    /// Another source of the reference speed.
    SpeedPlanner {
        /// Which.
        kind: SpeedPlannerKind,
    },
    /// Somebody else drives: this is what they ask for.
    Outside {
        /// None: nobody else drives any more.
        demand: Option<OutsideDemand>,
    },
}

impl StackChange {
    /// Another decider by its word, as `--decider` has it. Only the policy that the program brings
    /// along can be named.
    ///
    /// # Errors
    /// [`SimError::Override`] names the word that cannot be used.
    pub fn decider(word: &str) -> Result<Self, SimError> {
        if word.starts_with("dqn:") {
            let why = "a file of weights is named when a run begins; dqn is the built-in policy";
            return Err(overrides::refused("decider", word, why));
        }
        let (kind, policy_file) = overrides::decider_kind(word)?;
        Ok(Self::Decider { kind, policy_file })
    }

    /// Makes the change.
    ///
    /// # Errors
    /// [`SimError`] names the file or key that cannot be used; the stack is as it was then.
    pub fn apply(&self, stack: &mut Stack) -> Result<(), SimError> {
        match self {
            Self::Decider { kind, policy_file } => {
                let policy = policy_file.as_deref().map(|file| read_policy(Path::new(file)));
                stack.set_decider(*kind, policy.transpose()?.map(Arc::new))?;
            }
            Self::SpeedPlanner { kind } => stack.set_speed_planner(*kind),
            Self::Outside { demand } => stack.obey_outside(*demand),
        }
        Ok(())
    }

    /// The change in words, every number with all its bits.
    ///
    /// # Errors
    /// [`SimError::ChangeWords`] if TOML has no words for it: a time beyond 292 years.
    pub fn to_toml(&self) -> Result<String, SimError> {
        toml::to_string(self).map_err(|e| SimError::ChangeWords(e.to_string()))
    }

    /// The change that words are.
    ///
    /// # Errors
    /// [`SimError::ChangeWords`] says what is wrong with them.
    pub fn from_toml(words: &str) -> Result<Self, SimError> {
        toml::from_str(words).map_err(|e| SimError::ChangeWords(e.to_string()))
    }
}
