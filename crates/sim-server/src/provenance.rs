//! What produced an output: version and git revision.

use serde::Serialize;

/// Version of the JSON objects that this program writes.
pub(crate) const SCHEMA: u32 = 1;

/// The keys that open every JSON object.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(transparent)]
pub(crate) struct Provenance(tractrix_core::Provenance);

impl Provenance {
    /// The provenance of an output that this seed determines; 0 for work without randomness.
    pub(crate) const fn of_seed(seed: u64) -> Self {
        Self(tractrix_core::Provenance {
            schema: SCHEMA,
            version: VERSION,
            git_revision: GIT_REVISION,
            seed,
        })
    }

    /// The seed.
    pub(crate) const fn seed(self) -> u64 {
        self.0.seed
    }
}

impl From<Provenance> for tractrix_core::Provenance {
    fn from(provenance: Provenance) -> Self {
        provenance.0
    }
}

/// Version of the workspace.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");
pub(crate) use shell::GIT_REVISION;
