//! What produced an output.

use serde::Serialize;

/// The keys that open every JSON object that a shell writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Provenance {
    /// Version of the JSON objects.
    pub schema: u32,
    /// Version of the program.
    pub version: &'static str,
    /// Git revision of its sources, `unknown` outside a repository.
    pub git_revision: &'static str,
    /// Seed of the run; 0 for work without randomness.
    pub seed: u64,
}
