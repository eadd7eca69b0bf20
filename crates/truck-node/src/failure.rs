//! How the program ends when it does not end in good order.

use std::path::Path;
use std::process::ExitCode;

/// Why the program ended; one line.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// Something broke while running: exit code 1.
    #[error("{0}")]
    Work(String),
    /// What was given cannot be used, or the bus, truck or road is not what it should be: 2.
    #[error("{0}")]
    Input(String),
    /// The truck did not become ready to be driven in time: 3.
    #[error("not ready after {after_s:.0} s: {waiting}")]
    NotReady {
        /// How long it was waited for.
        after_s: f64,
        /// What is missing.
        waiting: String,
    },
    /// The truck still moved when the time for its stop was over: 4.
    #[error(
        "the truck still drives {speed_m_s:.1} m/s after {after_s:.0} s of braking; it was let go"
    )]
    StillMoving {
        /// Its speed, m/s.
        speed_m_s: f64,
        /// How long it was braked.
        after_s: f64,
    },
}

impl Failure {
    /// What was given cannot be used.
    pub(crate) fn input(why: impl std::fmt::Display) -> Self {
        Self::Input(one_line(&why.to_string()))
    }

    /// Something broke.
    pub(crate) fn work(why: impl std::fmt::Display) -> Self {
        Self::Work(one_line(&why.to_string()))
    }

    /// A file that cannot be read or written.
    pub(crate) fn file(path: &Path, why: &std::io::Error) -> Self {
        Self::Input(format!("{}: {why}", path.display()))
    }

    /// The exit code of the program.
    pub(crate) fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Work(_) => 1,
            Self::Input(_) => 2,
            Self::NotReady { .. } => 3,
            Self::StillMoving { .. } => 4,
        })
    }
}

fn one_line(text: &str) -> String {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}
