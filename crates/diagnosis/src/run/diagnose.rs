//! The diagnosis as a whole: drives in, [`Diagnosis`] out.

use crate::answer::gain::{DriveError, gain};
use crate::answer::named::{Named, causes};
use crate::answer::observable::observable;
use crate::answer::wrong::wrong;
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::sentence;
use crate::outside::sure::{Sure, beyond, describe, judge, without};
use crate::outside::unknown::Shape;
use crate::problem::Problem;
use crate::problem::baseline::Baseline;
use crate::problem::course::Point;
use crate::replay::{Module, Prepared};
use crate::run::drive_use::{DriveRole, drive_uses};
use crate::run::report_models::Models;
use crate::search::decisions::{MIN_EVIDENCE, STRONG_NATS};
use crate::search::weights::{log_odds, outweighed};
use crate::{
    Action, Diagnosis, DiagnosisError, DriveSet, Executor, Finding, FindingKind, Plant, Verdict,
};

/// Choices of the caller.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Names of drives to hold out; empty: the last quarter of the drives, if there are four.
    pub hold_out: Vec<String>,
    /// Cause ids that the search must not use.
    pub excluded: Vec<String>,
    /// Most causes in a set.
    pub max_causes: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { hold_out: Vec::new(), excluded: Vec::new(), max_causes: 4 }
    }
}

/// How far a diagnosis is.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Progress {
    /// Learning noise and tolerances.
    Baseline,
    /// Searching for the next cause, with so many found.
    Search {
        /// Causes found so far.
        found: usize,
    },
    /// Looking outside the catalogue.
    Unknown,
    /// Rollouts on held-out drives.
    Gain,
    /// Figures of the report.
    Report,
}

/// Finds what the simulation of `plant` gets wrong on `drives` and names the cause.
///
/// `baseline` are drives of the same truck and logger that are in order.
///
/// # Errors
/// No drive to learn from, or drives of another truck.
pub fn diagnose(
    plant: &Plant,
    drives: &DriveSet,
    baseline: Option<&DriveSet>,
    options: &Options,
    executor: &dyn Executor,
    progress: &mut dyn FnMut(Progress),
) -> Result<Diagnosis, DiagnosisError> {
    split(drives, &options.hold_out)?;
    crate::data::plausible::check_length(drives)?;
    progress(Progress::Baseline);
    let learned = baseline.map(|b| Baseline::learn(plant, b, executor)).transpose()?;
    diagnose_with(plant, drives, learned.as_ref(), options, executor, progress)
}

/// The same with a baseline that was learned before.
///
/// # Errors
/// No drive to learn from, or drives of another truck.
pub fn diagnose_with(
    plant: &Plant,
    drives: &DriveSet,
    baseline: Option<&Baseline>,
    options: &Options,
    executor: &dyn Executor,
    progress: &mut dyn FnMut(Progress),
) -> Result<Diagnosis, DiagnosisError> {
    let (learn, held) = split(drives, &options.hold_out)?;
    crate::data::plausible::check_length(drives)?;
    crate::data::plausible::check_truck(plant, drives)?;
    let prepare = |names: &[usize]| -> Vec<Prepared> {
        names.iter().map(|i| Prepared::new(&drives.drives[*i], plant)).collect()
    };
    progress(Progress::Baseline);
    let (problem, floor) = match baseline {
        Some(b) => {
            let reference = b.reference.clone();
            (Problem::with(plant, prepare(&learn), reference, executor)?, b.floor.as_slice())
        }
        None => (Problem::learn(plant, prepare(&learn), false, executor)?, &[] as &[DriveError]),
    };
    let (open, not_observable, detectable) = observable(&problem, options);
    let bare = beyond(&problem, &Point::bare(problem.reference.theta));
    let most = bare.first().map_or(0.0, |s| s.log_z);
    let kept = problem.evidence().kept(&open, options.max_causes, most, &mut |found| {
        progress(Progress::Search { found });
    });
    let Some((empty, fit)) = kept else {
        return Err(DiagnosisError::Numerics("no evidence can be computed".into()));
    };
    progress(Progress::Unknown);
    let (fit, shape, mut sure) = judge(&problem, &empty, fit, &bare);
    let held = (!held.is_empty())
        .then(|| Problem::with(plant, prepare(&held), problem.reference.clone(), executor))
        .transpose()?;
    let fit = match &held {
        Some(held) => {
            let revised = problem.evidence().revise(held, fit, &empty);
            if revised.opposed && sure == Sure::Yes {
                sure = Sure::Not;
            }
            revised.fit
        }
        None => fit,
    };
    let answer = causes(&problem, &fit, &empty, &open, &bare);
    // What may be there in place of a cause is said as far as it makes the cause unsure.
    let doubts = answer.instead.iter().filter(|(_, p)| log_odds(*p) > -STRONG_NATS);
    let doubts: Vec<Shape> = doubts.map(|(s, _)| s.clone()).collect();
    let functions = answer.instead.iter().map(|(_, p)| p).sum();
    let stated: Vec<_> = answer.causes.iter().map(|c| (c.cause.id, c.cause.probability)).collect();
    let outweighed = outweighed(&stated, functions);
    let (fit, mut causes, shape) = if outweighed.is_empty() {
        (fit, answer.causes, shape)
    } else {
        sure = Sure::Outside;
        let fit = without(&problem, &empty, &fit, |h| outweighed.contains(&CATALOGUE[h].id));
        let left = causes(&problem, &fit, &empty, &open, &bare).causes;
        // What was found before may be about something else, and larger.
        let said = [describe(&doubts), shape].into_iter().flatten();
        (fit, left, said.max_by(|a, b| a.evidence.total_cmp(&b.evidence)))
    };
    let weak = |c: &Named| c.rivalled && c.cause.evidence < MIN_EVIDENCE;
    let faint = shape.is_none() && causes.len() == 1 && causes.iter().all(weak);
    let fit = if faint { empty } else { fit };
    causes.retain(|_| !faint);
    let shape = shape.or_else(|| if faint { None } else { describe(&doubts) });
    if sure == Sure::Not {
        causes.iter_mut().for_each(|c| c.cause.sentence.push_str(sentence::NOT_SURE));
    }
    let verdict = if sure == Sure::Outside {
        Verdict::Unknown
    } else if fit.set.is_empty() {
        Verdict::NothingToExplain
    } else if sure == Sure::Not
        || causes.iter().any(|c| log_odds(c.cause.probability) < STRONG_NATS)
    {
        Verdict::Ambiguous
    } else {
        Verdict::Explained
    };
    let models = Models {
        before: problem.reference.theta,
        after: fit.theta,
        sigma: Module::ALL.map(|m| problem.reference.whiteners[m as usize].sigma),
    };
    progress(Progress::Gain);
    let mut used = drive_uses(&problem, DriveRole::Learned, &fit.theta);
    for (one, alone) in used.iter_mut().zip(problem.evidence().alone(&fit)) {
        one.alone = alone;
    }
    used.extend(held.iter().flat_map(|h| drive_uses(h, DriveRole::HeldOut, &fit.theta)));
    used.extend(baseline.into_iter().flat_map(|b| b.used.clone()));
    let gain = held.filter(|_| !fit.set.is_empty()).map(|held| gain(plant, &held, &fit));
    let wrong = wrong(&problem, floor);
    let mut findings = drives.findings.clone();
    if drives.truck != plant.name {
        findings.push(Finding {
            drive: "all".to_owned(),
            channel: None,
            time_s: None,
            kind: FindingKind::TruckName { index: drives.truck.clone() },
            action: Action::Kept,
        });
    }
    let extended_truck = (!fit.set.is_empty()).then(|| format!("{}.extended.toml", plant.name));
    Ok(Diagnosis {
        schema: 1,
        version: env!("CARGO_PKG_VERSION"),
        truck: plant.name.clone(),
        verdict,
        wrong,
        causes: causes.into_iter().map(|c| c.cause).collect(),
        unknown: shape,
        not_observable,
        detectable,
        gain,
        extended_truck,
        tolerances_from_baseline: baseline.is_some(),
        side_force: baseline.and_then(|b| b.reference.side_force(plant)),
        drives: used,
        findings,
        models,
    })
}

/// Indices of drives to learn from and to hold out.
pub(crate) fn split(
    set: &DriveSet,
    hold_out: &[String],
) -> Result<(Vec<usize>, Vec<usize>), DiagnosisError> {
    let n = set.drives.len();
    for name in hold_out {
        if !set.drives.iter().any(|d| d.name == *name) {
            return Err(DiagnosisError::NoDrives { what: format!("no drive is named {name:?}") });
        }
    }
    let (learn, held): (Vec<usize>, Vec<usize>) = if hold_out.is_empty() {
        let keep = if n >= 4 { n - n / 4 } else { n };
        ((0..keep).collect(), (keep..n).collect())
    } else {
        (0..n).partition(|i| !hold_out.contains(&set.drives[*i].name))
    };
    if learn.is_empty() {
        return Err(DiagnosisError::NoDrives { what: "no drive is left to learn from".into() });
    }
    Ok((learn, held))
}
