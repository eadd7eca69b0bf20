//! What the programs and the Python package share of the computer that they run on: its threads, and
//! the revision of the sources that they were built from.

mod threads;

pub use threads::Threads;

/// Git revision of the sources; `TRACTRIX_GIT_REVISION` of the build where it was set, `unknown`
/// outside a repository.
pub const GIT_REVISION: &str = env!("TRACTRIX_GIT_REVISION");
