//! How loud silence is: the smallest size of a cause that drives would have shown.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::causes::hypothesis::CATALOGUE;
use crate::search::decisions::MIN_EVIDENCE;

/// What drives would have shown of a cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Detectable {
    /// Fixed word of the catalogue.
    pub id: &'static str,
    /// Its size, as in [`crate::Cause::parameters`]; of a factor the part by which it differs from one.
    pub parameter: &'static str,
    /// Smallest size whose expected evidence names it, whatever its sign.
    pub smallest: f64,
    /// Unit of the size, "1" for ratios.
    pub unit: &'static str,
}

/// Size with an expected evidence of `nats` where the information about it is `a` and its prior
/// deviation `sigma`: `1/2 (a x)² / (a + 1/sigma²) - 1/2 ln(1 + sigma² a)` for a size `x`.
fn smallest(nats: f64, a: f64, sigma: f64) -> f64 {
    let needed = 2.0 * nats + (1.0 + sigma * sigma * a).ln();
    (needed * (a + 1.0 / (sigma * sigma))).sqrt() / a
}

/// Of the hypotheses `open`, with the information about each; one entry per cause, by its most visible
/// form. Sizes beyond what the search considers are left out: nothing would have shown those.
pub(crate) fn detectable(open: &[usize], information: &[f64]) -> Vec<Detectable> {
    let mut out = BTreeMap::<&str, (f64, Detectable)>::new();
    for (h, a) in open.iter().filter_map(|i| Some((CATALOGUE.get(*i)?, *information.get(*i)?))) {
        let Some(spec) = h.sizes.first().map(|p| p.spec()) else { continue };
        let size = smallest(MIN_EVIDENCE, a, spec.prior).max(0.5 * h.min_size);
        let visible = size / spec.prior;
        if !size.is_finite() || size > spec.hi.max(-spec.lo) {
            continue;
        }
        let found = Detectable { id: h.id, parameter: spec.key, smallest: size, unit: spec.unit };
        match out.get(h.id) {
            Some((best, _)) if *best <= visible => {}
            _ => drop(out.insert(h.id, (visible, found))),
        }
    }
    out.into_values().map(|d| d.1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::stats::evidence::linear;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn the_smallest_size_has_the_evidence_that_names_a_cause() {
        for (a, sigma) in [(400.0, 0.2), (1e6, 0.15), (3.0, 5.0)] {
            let x = smallest(10.0, a, sigma);
            let gradient = DVector::from_element(1, a * x);
            let (nats, _) = linear(&DMatrix::from_element(1, 1, a), &gradient, &[sigma]).unwrap();
            assert!((nats - 10.0).abs() < 1e-9, "{a} {sigma}: {nats}");
        }
    }

    #[test]
    fn a_cause_is_listed_once_and_not_beyond_its_bounds() {
        let open: Vec<usize> = (0..CATALOGUE.len()).collect();
        let loud = detectable(&open, &vec![1e9; open.len()]);
        let mut ids: Vec<&str> = CATALOGUE.iter().map(|h| h.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(loud.iter().map(|d| d.id).collect::<Vec<_>>(), ids);
        assert!(detectable(&open, &vec![1e-9; open.len()]).is_empty());
    }
}
