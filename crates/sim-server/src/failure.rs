//! How a command ends when it does not succeed.

use std::error::Error;
use std::path::Path;

use recording::{RecordingError, Torn};

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

    /// A file or folder cannot be written: a full disk is failed work, a place where nothing can be
    /// written is bad input.
    pub(crate) fn writing(path: &Path, error: &(dyn Error + 'static)) -> Self {
        use std::io::ErrorKind as K;
        let (at, why) = (path.display(), with_causes(error));
        match io_kind(error) {
            Some(K::StorageFull | K::QuotaExceeded | K::FileTooLarge | K::WriteZero) => {
                Self::Work(format!("{at}: the disk is full ({why})"))
            }
            Some(
                K::AlreadyExists
                | K::InvalidFilename
                | K::IsADirectory
                | K::NotADirectory
                | K::NotFound
                | K::PermissionDenied
                | K::ReadOnlyFilesystem,
            ) => Self::Input(format!("{at}: {why}")),
            _ => Self::Work(format!("{at}: {why}")),
        }
    }

    /// A recording without an end, and what of it can be saved.
    pub(crate) fn of_torn(torn: Torn) -> Self {
        let failure = Self::from(torn.why);
        if torn.kept_s <= 0.0 {
            return failure;
        }
        let (path, kept_s) = (torn.path.display(), torn.kept_s);
        failure.hint(&format!("its first {kept_s:.0} s are saved by `sim-server recover {path}`"))
    }

    /// The failure of something that could be done when the work began.
    #[must_use]
    pub(crate) fn under_way(self) -> Self {
        match self {
            Self::Input(why) | Self::Work(why) => Self::Work(why),
        }
    }

    /// The same failure with what helps.
    #[must_use]
    pub(crate) fn hint(self, what: &str) -> Self {
        match self {
            Self::Input(why) => Self::Input(format!("{why}; {what}")),
            Self::Work(why) => Self::Work(format!("{why}; {what}")),
        }
    }

    /// A file that the user named cannot be read.
    pub(crate) fn file(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::Input(format!("{}: {error}", path.display()))
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
        tractrix_core::words::with_short_numbers(&one_line(&self.to_string()))
    }
}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Read { path, why } => Self::file(&path, why),
            RecordingError::Write { path, source } => Self::writing(&path, &*source),
            other => Self::work(other),
        }
    }
}

impl From<diagnosis::DiagnosisError> for Failure {
    fn from(error: diagnosis::DiagnosisError) -> Self {
        Self::input(error)
    }
}

/// Folds line breaks and indentation into single spaces.
pub(crate) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// An error's message and those of its causes.
fn with_causes(error: &(dyn Error + 'static)) -> String {
    let mut text = error.to_string();
    for cause in causes(error).skip(1).map(ToString::to_string) {
        if !text.ends_with(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
    }
    text
}

/// What the operating system said, wherever in the chain of causes.
fn io_kind(error: &(dyn Error + 'static)) -> Option<std::io::ErrorKind> {
    causes(error).find_map(|e| e.downcast_ref::<std::io::Error>()).map(std::io::Error::kind)
}

/// An error and its causes.
fn causes<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&e| e.source())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn a_full_disk_is_failed_work_and_a_wrong_place_is_bad_input() {
        let write = |kind: io::ErrorKind| {
            let source = Box::new(io::Error::from(kind));
            Failure::from(RecordingError::Write { path: "out/run.mcap".into(), source })
        };
        for full in [io::ErrorKind::StorageFull, io::ErrorKind::FileTooLarge] {
            let failure = write(full);
            assert_eq!(failure.exit_code(), 1);
            let line = failure.hint("`sim-server recover`").line();
            assert!(line.starts_with("out/run.mcap: the disk is full (") && line.ends_with("ver`"));
        }
        assert_eq!(write(io::ErrorKind::PermissionDenied).exit_code(), 2);
        assert_eq!(write(io::ErrorKind::BrokenPipe).exit_code(), 1);
    }
}
