//! Failures as Python exceptions.
//!
//! | exception | when |
//! |---|---|
//! | `ValueError` | a word, key, value or file content that cannot be used; a closed world |
//! | `FileNotFoundError`, `OSError` | a file that is not there, or cannot be read |
//! | `RuntimeError` | SUMO fails or is absent, a repeated run differs, the plant's state is not finite |

use std::path::Path;

use pyo3::PyErr;
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyRuntimeError, PyValueError};
use sim::SimError;
use traffic_client::TrafficError;
use traffic_client::replay::ReplayError;
use traffic_client::sumo::SumoError;

/// Why a call fails.
#[derive(Debug, Clone)]
pub(crate) enum Fault {
    /// `ValueError`.
    Value(String),
    /// `FileNotFoundError`.
    NotFound(String),
    /// `OSError`.
    Io(String),
    /// `RuntimeError`.
    Work(String),
}

impl Fault {
    /// A call on a world after its `close()`.
    pub(crate) fn closed() -> Self {
        Self::Value("the world is closed".to_owned())
    }

    /// A scenario from which no world can be made.
    pub(crate) fn of_input(error: &SimError) -> Self {
        let text = error.to_string();
        match error {
            SimError::Io { path, .. } => Self::file(path, text),
            SimError::Road(road::RoadError::Io { path, .. })
            | SimError::Truck(dynamics::DynamicsError::Io { path, .. })
            | SimError::Traffic(
                TrafficError::Replay(ReplayError::File { path, .. })
                | TrafficError::Sumo(SumoError::File { path, .. }),
            ) => Self::file(Path::new(path), text),
            SimError::Traffic(TrafficError::Sumo(_)) => Self::Work(text),
            _ => Self::Value(text),
        }
    }

    /// A run that cannot go on.
    pub(crate) fn of_run(error: &SimError) -> Self {
        Self::Work(error.to_string())
    }

    /// A file that cannot be read: not there, or another reason.
    pub(crate) fn file(path: &Path, text: String) -> Self {
        if path.exists() { Self::Io(text) } else { Self::NotFound(text) }
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        let short = |text: String| tractrix_core::words::with_short_numbers(&text);
        match fault {
            Fault::Value(text) => PyValueError::new_err(short(text)),
            Fault::NotFound(text) => PyFileNotFoundError::new_err(text),
            Fault::Io(text) => PyOSError::new_err(text),
            Fault::Work(text) => PyRuntimeError::new_err(short(text)),
        }
    }
}
