//! What can go wrong in the closed loop.

use std::path::PathBuf;

/// Errors of the closed loop. Messages name the file, key or effect and the value.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// A file could not be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A scenario file does not parse.
    #[error("scenario {name}: {why}")]
    Scenario {
        /// Name or path of the scenario.
        name: String,
        /// What is wrong, with the key.
        why: String,
    },
    /// No such built-in scenario.
    #[error("no built-in scenario {name:?}; the nearest are {nearest}")]
    UnknownScenario {
        /// The name asked for.
        name: String,
        /// The names that are most like it.
        nearest: String,
    },
    /// A change to a scenario that cannot be made.
    #[error("{option} {value}: {why}")]
    Override {
        /// Which word: a field of [`crate::Overrides`].
        option: &'static str,
        /// The value given.
        value: String,
        /// What is wrong with it.
        why: String,
    },
    /// The road cannot be used.
    #[error(transparent)]
    Road(#[from] road::RoadError),
    /// The truck cannot be used, or its state stopped being finite.
    #[error(transparent)]
    Truck(#[from] dynamics::DynamicsError),
    /// The traffic source failed.
    #[error(transparent)]
    Traffic(#[from] traffic_client::TrafficError),
    /// The virtual truck's control units cannot go on.
    #[error(transparent)]
    Ecu(#[from] crate::ecu::EcuError),
    /// Another failure of the loop.
    #[error("{0}")]
    Drive(String),
    /// A batch was asked for what it cannot do.
    #[error("batch: {what} = {value}: {why}")]
    Batch {
        /// Which argument or key.
        what: &'static str,
        /// The value given.
        value: String,
        /// What it must be.
        why: String,
    },
    /// A change of the stack that is not understood, or that cannot be put into words.
    #[error("change of the stack: {0}")]
    ChangeWords(String),
    /// Only a truck on a bus has what is to be broken.
    #[error("fault {fault}: only a truck on a bus has that (--vehicle bus)")]
    NoBus {
        /// The fault's word.
        fault: &'static str,
    },
    /// The trip cannot be planned.
    #[error(transparent)]
    Trip(#[from] planner::pcc::PccError),
    /// The stack cannot be built from its configuration.
    #[error("stack: {0}")]
    Stack(#[from] planner::PlannerError),
}

impl From<planner::DriveError<SimError, traffic_client::TrafficError>> for SimError {
    fn from(e: planner::DriveError<SimError, traffic_client::TrafficError>) -> Self {
        match e {
            planner::DriveError::Ego(e) | planner::DriveError::Command(e) => e,
            planner::DriveError::Traffic(e) => Self::Traffic(e),
            other => Self::Drive(other.to_string()),
        }
    }
}
