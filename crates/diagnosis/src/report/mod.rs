//! What a report shows: overlays of a drive before and after, where the residuals are large, and
//! the gain with intervals. Figures only; the shell draws them.
//!
//! Everything is computed from the drives and the two models of a [`Diagnosis`] by the same
//! modular replay that the search used. "Before" is the truck file, "after" the extended truck.

mod advice;
mod intervals;
mod maps;
mod rows;
mod traces;

use serde::Serialize;

pub use advice::advice;
pub use intervals::{GainInterval, Interval};
pub use maps::{Bin, ResidualMap};
pub use traces::Trace;

use crate::diagnosis::split;
use crate::replay::Prepared;
use crate::{Diagnosis, DiagnosisError, DriveSet, Options, Plant};
use rows::Rows;

/// The figures of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The drive that is shown before and after.
    pub shown_drive: String,
    /// It was held out from the search.
    pub shown_drive_was_held_out: bool,
    /// Overlays of that drive, the quantities with the largest gain first.
    pub traces: Vec<Trace>,
    /// Residuals over what they may depend on, over all drives.
    pub maps: Vec<ResidualMap>,
    /// Errors on held-out drives before and after, with intervals.
    pub gains: Vec<GainInterval>,
}

/// Computes the figures of a report. The drives are those that were diagnosed, with the same
/// options; `seed` is that of the bootstrap.
///
/// # Errors
/// A drive to hold out that does not exist, or no drive.
pub fn report(
    plant: &Plant,
    drives: &DriveSet,
    baseline: Option<&DriveSet>,
    options: &Options,
    found: &Diagnosis,
    seed: u64,
) -> Result<Report, DiagnosisError> {
    let (learn, held) = split(drives, &options.hold_out)?;
    let rows =
        |set: &DriveSet, i: usize| Rows::new(Prepared::new(&set.drives[i], plant), plant, found);
    let learned: Vec<Rows> = learn.iter().map(|i| rows(drives, *i)).collect();
    let held: Vec<Rows> = held.iter().map(|i| rows(drives, *i)).collect();
    let clean: Vec<Rows> =
        baseline.map_or_else(Vec::new, |b| (0..b.drives.len()).map(|i| rows(b, i)).collect());
    let shown = held
        .iter()
        .max_by(|a, b| a.relief().total_cmp(&b.relief()))
        .or_else(|| learned.iter().max_by(|a, b| a.relief().total_cmp(&b.relief())))
        .ok_or_else(|| DiagnosisError::NoDrives { what: "no drive to show".into() })?;
    Ok(Report {
        shown_drive: shown.drive.name.clone(),
        shown_drive_was_held_out: !held.is_empty(),
        traces: traces::traces(shown),
        maps: maps::maps(&learned, &held, &clean),
        gains: intervals::gains(&held, found, seed),
    })
}
