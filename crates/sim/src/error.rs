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
    #[error("no built-in scenario {name:?}; there are {known}")]
    UnknownScenario {
        /// The name asked for.
        name: String,
        /// The names that exist.
        known: String,
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
    /// The stack cannot be built from its configuration.
    #[error("stack: {0}")]
    Stack(String),
}
