//! The diagnosis as a whole: drives in, [`Diagnosis`] out.

use crate::causes::{Answer, Named, causes};
use crate::course::Point;
use crate::detectable::detectable;
use crate::drive_use::{DriveRole, DriveUse, drive_uses};
use crate::gain::{DriveError, HORIZON_S, drive_error, rms};
use crate::held_out::gains;
use crate::hypothesis::CATALOGUE;
use crate::problem::{Problem, Reference};
use crate::refit::Fit;
use crate::replay::{Module, Prepared};
use crate::report_models::Models;
use crate::search::MIN_EVIDENCE;
use crate::sentence;
use crate::sure::{Sure, beyond, describe, judge};
use crate::unknown::Shape;
use crate::{
    Action, BeforeAfter, Detectable, Diagnosis, DiagnosisError, Drive, DriveSet, Executor, Finding,
    FindingKind, Gain, NotObservable, Plant, Verdict, Wrong,
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

/// Probability above which a cause is stated as the explanation.
const EXPLAINED: f64 = 0.95;
/// Timing, noise and tolerances of a truck and its logger, learned from drives that are in order.
#[derive(Debug, Clone)]
pub struct Baseline {
    reference: Reference,
    floor: Vec<DriveError>,
    used: Vec<DriveUse>,
}

impl Baseline {
    /// Error of the speed of drives over free runs of 60 s with the truck file and the timing of
    /// this baseline, m/s.
    #[must_use]
    pub fn speed_rmse_m_s<'d>(
        &self,
        plant: &Plant,
        drives: impl Iterator<Item = &'d crate::Drive>,
    ) -> f64 {
        let of = |d| drive_error(&Prepared::new(d, plant), plant, &self.reference.theta).speed;
        rms(drives.map(of))
    }

    /// Learns from `drives` of the truck of `plant`; serves any number of diagnoses.
    ///
    /// # Errors
    /// Drives that are too short or hold values that are no numbers.
    pub fn learn(
        plant: &Plant,
        drives: &DriveSet,
        executor: &dyn Executor,
    ) -> Result<Self, DiagnosisError> {
        crate::plausible::check_length(drives)?;
        let clean = drives.drives.iter().map(|d| Prepared::new(d, plant)).collect();
        let problem = Problem::learn(plant, clean, true, executor)?;
        let zero = problem.reference.theta;
        let floor: Vec<_> = problem.drives.iter().map(|d| drive_error(d, plant, &zero)).collect();
        let used = problem.drives.iter().zip(&floor).map(|(d, e)| DriveUse::baseline(d, e));
        let used = used.collect();
        Ok(Self { reference: problem.reference, floor, used })
    }
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
    crate::plausible::check_length(drives)?;
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
    crate::plausible::check_length(drives)?;
    crate::plausible::check_truck(plant, drives)?;
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
    let fitted = problem.evidence().search(&open, options.max_causes, most, &mut |found| {
        progress(Progress::Search { found });
    });
    let Some((empty, fit)) = fitted else {
        return Err(DiagnosisError::Numerics("no evidence can be computed".into()));
    };
    let fit = problem.evidence().gate(fit, &empty);
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
    let Answer { mut causes, instead } = causes(&problem, &fit, &empty, &open, &bare);
    let weak = |c: &Named| c.rivalled && c.cause.evidence < MIN_EVIDENCE;
    let faint = shape.is_none() && causes.len() == 1 && causes.iter().all(weak);
    let fit = if faint { empty } else { fit };
    causes.retain(|_| !faint);
    // What may be there in place of a cause is said as far as it makes the cause unsure.
    let likely: Vec<Shape> =
        instead.into_iter().filter(|(_, p)| *p > 1.0 - EXPLAINED).map(|(s, _)| s).collect();
    let shape = shape.or_else(|| if faint { None } else { describe(&likely) });
    if sure == Sure::Not {
        causes.iter_mut().for_each(|c| c.cause.sentence.push_str(sentence::NOT_SURE));
    }
    let verdict = if sure == Sure::Outside {
        Verdict::Unknown
    } else if fit.set.is_empty() {
        Verdict::NothingToExplain
    } else if sure == Sure::Not || causes.iter().any(|c| c.cause.probability < EXPLAINED) {
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

/// Hypotheses that the drives can show, those that they cannot, and what they would have shown.
fn observable(
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

fn gain(plant: &Plant, problem: &Problem<'_>, fit: &Fit) -> Gain {
    let reference = &problem.reference;
    let errors = |t| problem.drives.iter().map(|d| drive_error(d, plant, t)).collect::<Vec<_>>();
    let (before, after) = (errors(&reference.theta), errors(&fit.theta));
    let gains = gains(problem, &reference.theta, &fit.theta);
    let both = |f: fn(&DriveError) -> [f64; 2]| BeforeAfter {
        before: rms(before.iter().map(f)),
        after: rms(after.iter().map(f)),
    };
    let fuel = |e: &[DriveError]| {
        let (d, m) = e.iter().fold((0.0, 0.0), |a, e| (a.0 + e.fuel[0], a.1 + e.fuel[1]));
        if m > 0.0 { f64::abs(d) / m } else { 0.0 }
    };
    let total: f64 = gains.iter().sum();
    Gain {
        held_out: problem.drives.iter().map(|d| d.name.clone()).collect(),
        speed_rmse_m_s: both(|e| e.speed),
        yaw_rate_rmse_rad_s: both(|e| e.yaw),
        fuel_error_frac: BeforeAfter { before: fuel(&before), after: fuel(&after) },
        log_score_nats: total,
        significant: total > 3.0 && gains.iter().all(|g| *g > -3.0),
    }
}

/// Root mean square of the measured signal of a module over its rows.
fn signal_rms(problem: &Problem<'_>, m: Module) -> f64 {
    let step = m.row_step();
    if m == Module::Shift {
        return rms(problem.drives.iter().flat_map(|d| &d.shifts).map(|s| {
            let duration_s = s.1 as f64 * Drive::STEP_S;
            [duration_s * duration_s, 1.0]
        }));
    }
    rms(problem.drives.iter().map(|d| {
        let x = d.measured(m);
        d.valid[m as usize]
            .iter()
            .enumerate()
            .filter(|(k, ok)| **ok && k * step < x.len())
            .fold([0.0, 0.0], |a, (k, _)| [a[0] + x[k * step] * x[k * step], a[1] + 1.0])
    }))
}

fn wrong(problem: &Problem<'_>, floor: &[DriveError]) -> Vec<Wrong> {
    let zero = problem.reference.theta;
    let errors: Vec<DriveError> =
        problem.drives.iter().map(|d| drive_error(d, problem.plant, &zero)).collect();
    let mut out = Vec::new();
    let samples: f64 = errors.iter().map(|e| e.speed[1]).sum();
    if samples > 0.0 {
        let rmse = rms(errors.iter().map(|e| e.speed));
        let power = (errors.iter().map(|e| e.speed_power).sum::<f64>() / samples).sqrt();
        out.push(Wrong {
            quantity: "speed_m_s",
            horizon_s: HORIZON_S,
            rmse,
            bias: errors.iter().map(|e| e.speed_sum).sum::<f64>() / samples,
            accuracy_frac: 1.0 - rmse / power.max(1e-9),
            r#where: sentence::places(problem, Module::Force),
            noise_floor: rms(floor.iter().map(|e| e.speed)),
        });
    }
    for m in Module::ALL {
        let i = m as usize;
        if m == Module::Force || !problem.drives.iter().any(|d| d.available[i]) {
            continue;
        }
        let (mut chi, mut rows, mut sum) = (0.0, 0.0, 0.0);
        for k in 0..problem.drives.len() {
            let w = problem.whitened(k, &zero);
            for (x, ok) in w[i].iter().zip(&problem.drives[k].valid[i]) {
                if *ok {
                    chi += x * x;
                    sum += x;
                    rows += 1.0;
                }
            }
        }
        let sigma = problem.reference.whiteners[i].sigma;
        let ratio = chi / f64::max(rows, 1.0);
        let floor = problem.reference.ratio[i].max(1.0);
        if ratio > 1.5 * floor {
            out.push(Wrong {
                quantity: m.quantity(),
                horizon_s: 0.0,
                rmse: sigma * ratio.sqrt(),
                bias: -sigma * sum / rows,
                accuracy_frac: 1.0 - sigma * ratio.sqrt() / signal_rms(problem, m).max(1e-12),
                r#where: sentence::places(problem, m),
                noise_floor: sigma * floor.sqrt(),
            });
        }
    }
    out
}
