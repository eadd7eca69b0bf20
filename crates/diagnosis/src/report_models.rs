//! The two models that a report compares: the truck file as calibrated, and the extended truck.

use crate::param::{PARAMS, Theta};
use crate::replay::MODULES;

/// Parameters before and after, with the noise that the search assumed. Opaque to callers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Models {
    /// Calibrated truck file.
    pub(crate) before: Theta,
    /// With the named causes.
    pub(crate) after: Theta,
    /// Standard deviation of the innovations of each module.
    pub(crate) sigma: [f64; MODULES],
}

impl Default for Models {
    fn default() -> Self {
        Self { before: [0.0; PARAMS], after: [0.0; PARAMS], sigma: [1.0; MODULES] }
    }
}
