//! The two models that a report compares: the truck file as calibrated, and the extended truck.

use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::{PARAMS, Theta};
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

impl Models {
    /// The model with all causes but some.
    pub(crate) fn without(&self, ids: &[&str]) -> Theta {
        let mut theta = self.after;
        for p in CATALOGUE.iter().filter(|h| ids.contains(&h.id)).flat_map(|h| h.params()) {
            theta[p as usize] = self.before[p as usize];
        }
        theta
    }
}

impl Default for Models {
    fn default() -> Self {
        Self { before: [0.0; PARAMS], after: [0.0; PARAMS], sigma: [1.0; MODULES] }
    }
}
