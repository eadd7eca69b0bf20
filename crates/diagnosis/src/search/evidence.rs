//! What the search compares explanations by: residuals and sensitivities of a set of drives in one
//! metric, whatever they come from. The replay is one source; a few given matrices are another
//! (`linear`, for tests of microseconds).

#[cfg(test)]
pub(crate) mod linear;

use crate::causes::param::Theta;
use crate::problem::{Direction, Gram, Problem};
use crate::search::worth::Dispersion;

/// Drives seen through their tolerances. Search, fit, screen and gates speak to this alone.
pub(crate) trait Evidence {
    /// No cause: where all sizes count from.
    fn zero(&self) -> &Theta;

    /// How many drives there are.
    fn drives(&self) -> usize;

    /// How much more drives in order scatter about the sizes of a hypothesis than their information
    /// says; [`Dispersion::NONE`] where no baseline has shown it.
    fn scatter_of(&self, hypothesis: usize) -> Dispersion;

    /// Gram matrix of the residual at `theta` and the directions from `from`.
    fn gram_along(&self, theta: &Theta, from: &Theta, directions: &[Direction]) -> Gram;

    /// The Gram matrix of the residual at `theta` with what tolerances do beyond their first order in it.
    fn gram_as_driven(&self, theta: &Theta, directions: &[Direction]) -> Gram;

    /// The Gram matrix with residual and directions at the same point.
    fn gram(&self, theta: &Theta, directions: &[Direction]) -> Gram {
        self.gram_along(theta, theta, directions)
    }
}

impl Evidence for Problem<'_> {
    fn zero(&self) -> &Theta {
        &self.reference.theta
    }

    fn drives(&self) -> usize {
        self.drives.len()
    }

    fn scatter_of(&self, hypothesis: usize) -> Dispersion {
        self.reference.scatter.get(hypothesis).copied().unwrap_or(Dispersion::NONE)
    }

    fn gram_along(&self, theta: &Theta, from: &Theta, directions: &[Direction]) -> Gram {
        Problem::gram_along(self, theta, from, directions)
    }

    fn gram_as_driven(&self, theta: &Theta, directions: &[Direction]) -> Gram {
        Problem::gram_as_driven(self, theta, directions)
    }
}

impl Problem<'_> {
    /// This problem as the search sees it.
    pub(crate) fn evidence(&self) -> &(dyn Evidence + '_) {
        self
    }
}
