//! From all causes to those that are kept: search and gate in turns.

use crate::search::decisions::{AHEAD, UNKNOWN_EVIDENCE};
use crate::search::evidence::Evidence;
use crate::search::refit::Fit;

impl dyn Evidence + '_ {
    /// The set without a cause, and the best set that the gate keeps of what the search finds among
    /// `open`. Where it refuses causes that explain as much as a verdict needs to be `unknown` (the gain
    /// is of one drive, the others disagree), something is there all the same, and the cause that is to be
    /// named may be one that they outdid: the search begins anew without them, once more than there may be
    /// causes at most. `bare` is the evidence of the best free function: where it wins over what was found,
    /// it wins over what is found after that.
    pub(crate) fn kept(
        &self,
        open: &[usize],
        max_causes: usize,
        bare: f64,
        progress: &mut dyn FnMut(usize),
    ) -> Option<(Fit, Fit)> {
        let mut open = open.to_vec();
        let (empty, mut found) = self.search(&open, max_causes, bare, progress)?;
        let mut best = empty.clone();
        for turns_left in (0..=max_causes).rev() {
            let kept = self.gate(found.clone(), &empty);
            let taken = found.log_z - kept.log_z;
            open.retain(|h| !found.set.contains(h) || kept.set.contains(h));
            if kept.log_z > best.log_z {
                best = kept;
            }
            let little = taken < UNKNOWN_EVIDENCE || bare > AHEAD * found.log_z;
            if little || turns_left == 0 {
                break;
            }
            found = self.search(&open, max_causes, bare, progress)?.1;
            if found.log_z <= best.log_z {
                break;
            }
        }
        Some((empty, best))
    }
}
