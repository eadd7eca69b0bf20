//! Where the truck is: the localiser, with fixes of the bus or of a receiver of our own.

use planner::localise::{LocaliseError, Localiser};
use tractrix_core::{Fix, Motion, Pose, PoseSource, Stamped, Time};

use crate::nmea::Fixes;

/// The pose source.
pub(crate) struct NodePose {
    localiser: Localiser,
    /// A receiver of our own; none: fixes come over the bus.
    receiver: Option<Fixes>,
    fixes: u64,
}

impl NodePose {
    pub(crate) const fn new(localiser: Localiser, receiver: Option<Fixes>) -> Self {
        Self { localiser, receiver, fixes: 0 }
    }

    /// Takes what our own receiver has said.
    pub(crate) fn poll(&mut self) {
        while let Some(fix) = self.receiver.as_ref().and_then(Fixes::next) {
            self.fixes += 1;
            self.localiser.fixed(&fix);
        }
    }

    /// Fixes so far.
    pub(crate) const fn fixes(&self) -> u64 {
        self.fixes
    }

    /// Standard deviation of the position, m.
    pub(crate) fn deviation_m(&self) -> f64 {
        let [position_m, _] = self.localiser.deviation();
        position_m
    }
}

impl PoseSource for NodePose {
    type Error = LocaliseError;

    fn pose(&mut self, now: Time) -> Result<Stamped<Pose>, LocaliseError> {
        self.localiser.pose(now)
    }

    fn moved(&mut self, motion: &Stamped<Motion>) {
        self.localiser.moved(motion);
    }

    fn fixed(&mut self, fix: &Stamped<Fix>) {
        if self.receiver.is_none() {
            self.fixes += 1;
            self.localiser.fixed(fix);
        }
    }
}
