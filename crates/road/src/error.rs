//! What can be wrong with a road.

use alloc::string::String;

/// Errors of reading or building a road. Messages name the file, element, line or column.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RoadError {
    /// A file could not be read.
    #[error("{path}: {why}")]
    Io {
        /// The file.
        path: String,
        /// Why.
        why: String,
    },
    /// A table row or column cannot be used.
    #[error("{path}: line {line}: {why}")]
    Table {
        /// The file.
        path: String,
        /// Line, from 1.
        line: u64,
        /// What is wrong, with column and value.
        why: String,
    },
    /// An OpenDRIVE element cannot be used.
    #[error("{path}: line {line}: <{element}>: {why}")]
    OpenDrive {
        /// The file.
        path: String,
        /// Line of the element, from 1.
        line: u32,
        /// Name of the element.
        element: String,
        /// What is wrong, with attribute and value.
        why: String,
    },
    /// The geometry does not make a road.
    #[error("road {name}: {why}")]
    Invalid {
        /// Name of the road.
        name: String,
        /// What is wrong.
        why: String,
    },
    /// The name or extension is not known.
    #[error(
        "{name}: a road is a .xodr or .csv file, builtin:highway, builtin:highway-sag, \
         builtin:test-site or builtin:flat"
    )]
    UnknownRoad {
        /// What was asked for.
        name: String,
    },
}
