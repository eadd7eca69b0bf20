//! What can go wrong with a recording.

use std::error::Error;
use std::path::{Path, PathBuf};

/// Why a recording could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// A file cannot be read, is no recording, or is damaged.
    #[error("{}: {why}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A file cannot be written.
    #[error("{}: it cannot be written", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system or the format said.
        source: Box<dyn Error + Send + Sync>,
    },
    /// The road's place on the earth is not known: its projection cannot be used.
    #[error("geoReference {projection:?}: {why}")]
    GeoReference {
        /// The projection as the road gives it (PROJ string).
        projection: String,
        /// What is wrong with it.
        why: String,
    },
    /// A message cannot be encoded.
    #[error("topic {topic}: {why}")]
    Encode {
        /// The message's topic.
        topic: &'static str,
        /// Why.
        why: String,
    },
    /// A file that is being written has been deleted.
    #[error("{}: it was deleted while it was written", path.display())]
    Gone {
        /// The file.
        path: PathBuf,
    },
    /// The disk did not take the end of the recording in time.
    #[error("the disk takes nothing: given up after {after_s:.0} s")]
    Stuck {
        /// How long it was waited for, s.
        after_s: f64,
    },
    /// The writer's thread ended without a result.
    #[error("the recording thread panicked")]
    Panicked,
}

impl RecordingError {
    pub(crate) fn read(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Read { path: path.to_owned(), why: why.to_string() }
    }

    pub(crate) fn write(path: &Path, error: impl Error + Send + Sync + 'static) -> Self {
        Self::Write { path: path.to_owned(), source: Box::new(error) }
    }
}
