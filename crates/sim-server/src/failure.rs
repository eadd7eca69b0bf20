//! How a command ends when it does not succeed.

use std::path::Path;

/// Why a command failed. The message is one line that names the key, file or value.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// Wrong usage or bad input: exit code 2.
    #[error("{0}")]
    Input(String),
    /// The input was fine, the work failed (disk full, a model that stopped being finite): 1.
    #[error("{0}")]
    Work(String),
}

impl Failure {
    /// Wrong usage or bad input, from any error.
    pub(crate) fn input(error: impl std::fmt::Display) -> Self {
        Self::Input(error.to_string())
    }

    /// An option that cannot be used, named as on the command line.
    pub(crate) fn of_option(error: sim::SimError) -> Self {
        match error {
            sim::SimError::Override { option, value, why } => {
                Self::Input(format!("--{} {value}: {why}", option.replace('_', "-")))
            }
            other => Self::input(other),
        }
    }

    /// Failed work, from any error.
    pub(crate) fn work(error: impl std::fmt::Display) -> Self {
        Self::Work(error.to_string())
    }

    /// Failed work on a file, with all causes of the error.
    pub(crate) fn work_on(path: &Path, error: &dyn std::error::Error) -> Self {
        Self::Work(format!("{}: {}", path.display(), with_causes(error)))
    }

    /// A file that the user named cannot be read or written.
    pub(crate) fn file(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::Input(format!("{}: {error}", path.display()))
    }

    /// Something that the contract names but this version does not do.
    pub(crate) fn unsupported(what: &str) -> Self {
        Self::Input(format!("{what} is not supported in this version"))
    }

    /// The process exit code.
    pub(crate) const fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Work(_) => 1,
        }
    }

    /// The message on one line.
    pub(crate) fn line(&self) -> String {
        one_line(&self.to_string())
    }
}

/// Folds line breaks and indentation into single spaces.
pub(crate) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// An error's message and those of its causes.
fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text.push_str(": ");
        text.push_str(&inner.to_string());
        cause = inner.source();
    }
    text
}
