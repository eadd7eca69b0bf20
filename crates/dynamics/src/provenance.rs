//! Where the figures of a truck file come from, figure by figure: `[provenance]` of the file.
//!
//! Left out: figures without an entry, whose block's `source` says it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// How a figure is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KnownBy {
    /// A data sheet says it.
    Sheet,
    /// Nobody said it: it is what such trucks usually have.
    Estimate,
    /// Measured drives say it.
    Drives,
}

/// Where one figure comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FigureOrigin {
    /// How it is known.
    pub known_by: KnownBy,
    /// Standard deviation, in the unit of the figure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Interval that holds the truth with 90 %, in the unit of the figure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval_90: Option<[f64; 2]>,
    /// Where from, in words.
    pub source: String,
}

/// Origins by the dotted path of the figure or of a list of figures, e.g. `driveline.gear_ratios`.
pub type Provenance = BTreeMap<String, FigureOrigin>;

/// What is wrong with origins; `names` says whether a path names a figure or a list of them.
pub(crate) fn violations(of: &Provenance, names: impl Fn(&str) -> bool) -> Vec<String> {
    let mut out = Vec::new();
    for (path, origin) in of {
        if !names(path) {
            out.push(format!("provenance: the truck has no figure {path:?}"));
        }
        if origin.sigma.is_some_and(|s| !(s.is_finite() && s >= 0.0)) {
            out.push(format!("provenance.{path:?}.sigma must be a number from 0 on"));
        }
        if let Some([low, high]) = origin.interval_90
            && !(low.is_finite() && high.is_finite() && low <= high)
        {
            out.push(format!("provenance.{path:?}.interval_90 = [{low}, {high}] is no interval"));
        }
    }
    out
}
