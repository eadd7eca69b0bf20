//! What a report shows: overlays of a drive before and after, where the residuals are large, and
//! the gain with intervals. Figures only; the shell draws them.
//!
//! Everything is computed from the drives and the two models of a [`Diagnosis`] by the same
//! modular replay that the search used. "Before" is the truck file, "after" the extended truck.

mod advice;
mod effects;
mod intervals;
mod maps;
mod rows;
mod traces;

use serde::Serialize;

pub use advice::advice;
pub use effects::Effect;
pub use intervals::{GainInterval, Interval};
pub use maps::{Bin, ResidualMap};
pub use traces::Trace;

use crate::replay::Prepared;
use crate::run::diagnose::split;
use crate::run::report_models::Models;
use crate::{Diagnosis, DiagnosisError, DriveRole, DriveSet, Options, Plant};
use rows::Rows;

/// A drive that a report shows before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shown {
    /// Its name.
    pub name: String,
    /// What it was used for.
    pub role: DriveRole,
    /// Why it is shown.
    pub why: &'static str,
    /// Overlays, the quantities with the largest gain first.
    pub traces: Vec<Trace>,
}

/// The figures of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Drives before and after: where the extension helps most, where the model is still worst, and
    /// one in order.
    pub shown: Vec<Shown>,
    /// What every named cause does on these drives.
    pub effects: Vec<Effect>,
    /// Residuals over what they may depend on, over all drives.
    pub maps: Vec<ResidualMap>,
    /// Errors on held-out drives before and after, with intervals; losses first.
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
    let rows_of = |set: &DriveSet, i: usize, models: &Models| {
        Rows::new(Prepared::new(&set.drives[i], plant), plant, models)
    };
    let rows = |set: &DriveSet, i: usize| rows_of(set, i, &found.models);
    let learned: Vec<Rows> = learn.iter().map(|i| rows(drives, *i)).collect();
    let held_out = held;
    let held: Vec<Rows> = held_out.iter().map(|i| rows(drives, *i)).collect();
    let clean: Vec<Rows> =
        baseline.map_or_else(Vec::new, |b| (0..b.drives.len()).map(|i| rows(b, i)).collect());
    let all: Vec<&Prepared> = learned.iter().chain(&held).map(|r| &r.drive).collect();
    let mut gains = intervals::gains(&held, found, seed);
    intervals::blame(&mut gains, found, seed, &|models| {
        held_out.iter().map(|i| rows_of(drives, *i, models)).collect()
    });
    gains.sort_by_key(|g| !g.lost);
    Ok(Report {
        shown: shown(&learned, &held, &clean, !found.causes.is_empty())?,
        effects: effects::effects(&all, plant, found),
        maps: maps::maps(&learned, &held, &clean),
        gains,
    })
}

/// The drives that a report shows.
fn shown(
    learned: &[Rows],
    held: &[Rows],
    clean: &[Rows],
    extended: bool,
) -> Result<Vec<Shown>, DiagnosisError> {
    use DriveRole::{Baseline, HeldOut, Learned};
    let (seen, role) = if held.is_empty() { (learned, Learned) } else { (held, HeldOut) };
    let most = |of: fn(&Rows) -> f64| {
        seen.iter().enumerate().max_by(|a, b| of(a.1).total_cmp(&of(b.1))).map(|m| m.0)
    };
    let best = most(if extended { Rows::relief } else { Rows::left })
        .ok_or_else(|| DiagnosisError::NoDrives { what: "no drive to show".into() })?;
    let worst = most(Rows::left).filter(|worst| *worst != best);
    let show = |r: &Rows, role, why| Shown {
        name: r.drive.name.clone(),
        role,
        why,
        traces: traces::traces(r),
    };
    let why =
        if extended { "the extension helps most here" } else { "the truck file is worst here" };
    let mut out = vec![show(&seen[best], role, why)];
    out.extend(worst.map(|i| show(&seen[i], role, "the extended truck is still worst here")));
    out.extend(clean.first().map(|r| show(r, Baseline, "a drive that is in order")));
    Ok(out)
}
