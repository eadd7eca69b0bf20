//! What can go wrong with a truck.

/// Errors of truck files and of the plant. Messages name the file, key, effect and value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DynamicsError {
    /// A file could not be read.
    #[error("{path}: {why}")]
    Io {
        /// The file.
        path: String,
        /// Why.
        why: String,
    },
    /// A truck file does not parse.
    #[error("truck {name}: {why}")]
    Parse {
        /// Name or path.
        name: String,
        /// What is wrong, with line and key.
        why: String,
    },
    /// Values of a truck file are out of bounds: all of them.
    #[error("truck {name}: {}", violations.join("; "))]
    OutOfBounds {
        /// Name of the truck.
        name: String,
        /// One sentence per violation.
        violations: Vec<String>,
    },
    /// No such truck.
    #[error("no truck {name:?}: neither a file nor one of {known}")]
    UnknownTruck {
        /// What was asked for.
        name: String,
        /// Built-in names.
        known: String,
    },
    /// The state is no longer finite: the run stops.
    #[error("{effect}: {quantity} is not finite ({value})")]
    NonFinite {
        /// The effect that produced it.
        effect: &'static str,
        /// The quantity.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// An overlay names a parameter that does not exist.
    #[error("overlay {name}: no parameter {path:?}; the nearest are {nearest}")]
    UnknownParameter {
        /// Name of the overlay.
        name: String,
        /// Dotted path.
        path: String,
        /// The paths that are most like it.
        nearest: String,
    },
}
