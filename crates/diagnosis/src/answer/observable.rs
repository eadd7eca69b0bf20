//! Which causes drives can show at all.

use crate::answer::detectable::detectable;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::sentence;
use crate::problem::Problem;
use crate::{Detectable, NotObservable, Options};

/// Hypotheses that the drives can show, those that they cannot, and what they would have shown.
pub(crate) fn observable(
    problem: &Problem<'_>,
    options: &Options,
) -> (Vec<usize>, Vec<NotObservable>, Vec<Detectable>) {
    let (mut open, mut not) = (Vec::new(), Vec::<NotObservable>::new());
    let information = problem.evidence().information();
    for (i, h) in CATALOGUE.iter().enumerate() {
        if options.excluded.iter().any(|x| x == h.id) {
            continue;
        }
        let missing: Vec<&str> = h
            .channels
            .iter()
            .filter(|c| !problem.drives.iter().any(|d| d.has(&[**c])))
            .map(|c| c.name())
            .collect();
        let why = if missing.is_empty() {
            if 1.0 / information[i].max(1e-300).sqrt() > h.min_size {
                sentence::not_excited(h.id).to_owned()
            } else {
                open.push(i);
                continue;
            }
        } else {
            format!("channels are missing: {}", missing.join(", "))
        };
        not.push(NotObservable { id: h.id, why, missing_channels: missing });
    }
    not.retain(|n| !open.iter().any(|i| CATALOGUE[*i].id == n.id));
    not.dedup_by(|a, b| a.id == b.id);
    let detectable = detectable(&open, &information);
    (open, not, detectable)
}
