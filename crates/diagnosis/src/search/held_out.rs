//! Causes against drives that the search has not seen.

use crate::causes::param::Theta;
use crate::search::decisions::{MIN_EVIDENCE, STRONG_NATS};
use crate::search::evidence::Evidence;
use crate::search::refit::Fit;

/// Score of every drive at `theta`, nats: the whitened residual that its tolerances cannot take.
fn scores(held: &dyn Evidence, theta: &Theta) -> Vec<f64> {
    let gram = held.gram(theta, &[]);
    gram.per_drive.iter().map(|g| -0.5 * g[(0, 0)]).collect()
}

/// What `with` scores above `without` on every drive held out, nats.
pub(crate) fn gains(held: &dyn Evidence, without: &Theta, with: &Theta) -> Vec<f64> {
    let (before, after) = (scores(held, without), scores(held, with));
    before.iter().zip(after).map(|(b, a)| a - b).collect()
}

/// What the drives held out say about the members of a set.
pub(crate) struct Revised {
    /// The set without members that all drives together do not support.
    pub(crate) fit: Fit,
    /// A member that stays loses on the drives held out.
    pub(crate) opposed: bool,
}

impl dyn Evidence + '_ {
    /// Drops members whose evidence the drives held out take away, the most opposed first. They are
    /// evidence like the drives that were searched: a member needs what a cause needs from both
    /// together.
    pub(crate) fn revise(&self, held: &dyn Evidence, fit: Fit, empty: &Fit) -> Revised {
        let mut fit = fit;
        loop {
            let mut opposed = false;
            let mut worst: Option<(f64, Fit)> = None;
            for i in 0..fit.set.len() {
                let (fewer, theta) = self.without(&fit, i);
                let less = if fewer.is_empty() {
                    Some(empty.clone())
                } else {
                    self.fit(&fewer, &theta, empty.norm)
                };
                let Some(less) = less else { continue };
                let gain: f64 = gains(held, &less.theta, &fit.theta).iter().sum();
                if gain > -STRONG_NATS {
                    continue;
                }
                let total = fit.log_z - less.log_z + gain;
                if total >= MIN_EVIDENCE {
                    opposed = true;
                } else if worst.as_ref().is_none_or(|w| total < w.0) {
                    worst = Some((total, less));
                }
            }
            match worst {
                Some((_, less)) => fit = less,
                None => return Revised { fit, opposed },
            }
        }
    }
}
