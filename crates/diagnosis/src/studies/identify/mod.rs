//! A truck file from measured drives of a truck that is in order.
//!
//! Gear ratios and wheel radius come from engine and road speed ([`ratios`]). Every other figure is a
//! parameter of the replay, fitted by the diagnosis' Gauss-Newton to all drives at once, with what
//! scatters from drive to drive (load, weather, instruments) as random effects:
//!
//! ```text
//! minimise  sum over drives |r(x)|²_M + sum over figures ((x - m) / s)²
//! ```
//! `M`: noise and tolerances (see `problem`); `m`, `s`: the truck file's figure and how well it is
//! known, from its `[provenance]` or else from the catalogue of causes. The truck is moved to the fit
//! and the noise is learned anew until nothing moves: noise learned beside a wrong truck is too large.
//! A figure whose interval the drives hardly narrow stays as it is and says why. A truck that is
//! unstable at the driven speeds is led to a stable one first ([`start`]).
//!
//! Coast-downs come first ([`coast_down`]): what they say of the road load is what the other drives
//! begin with. Columns that a log lacks and others say are worked out ([`columns`]).
//!
//! Left out: forms (fuel map, full load: a factor on them), tyres when cold, wind of the region.

mod coast_down;
mod columns;
mod figures;
mod ratios;
mod start;

use std::borrow::Cow;

use dynamics::TruckParameters;
use serde::Serialize;

use crate::causes::param::P;
use crate::causes::sentence;
use crate::problem::Problem;
use crate::replay::Prepared;
use crate::search::free::Prior;
use crate::search::refit::Fit;
use crate::{DiagnosisError, Drive, DriveSet, Executor, Finding, Plant};
use figures::{FIGURES, Figure, Standing};

/// Standard deviations on either side of the mean that hold 90 %.
pub(crate) const SIGMAS_90: f64 = 1.645;
/// Rounds at most, and the step, in standard deviations, below which another one changes nothing.
const ROUNDS: usize = 4;
const SETTLED: f64 = 0.3;
/// Share of what was not known before that must be left at most for a figure to be told.
const TOLD: f64 = 0.7;
/// Correlation from which a pair is listed.
const LISTED_CORRELATION: f64 = 0.5;
/// Load sheets, as weighed, are right within this, common to all drives.
const LOAD_SHEET_FRAC: f64 = 0.01;

/// One figure of the truck.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identified {
    /// Dotted path in the truck file; of a factor on a table that of the table.
    pub path: String,
    /// Whether `value` is a factor on what the path names, not its value.
    pub is_factor: bool,
    /// What the truck file said, in the unit of the path's last key.
    pub nominal: f64,
    /// What the drives say.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Interval that holds the truth with 90 %.
    pub interval_90: [f64; 2],
    /// Standard deviation that was known before; none for ratios, of which nothing was.
    pub prior_sigma: Option<f64>,
}

impl Identified {
    /// What `[provenance]` says of it.
    fn origin(&self, source: &str) -> dynamics::FigureOrigin {
        dynamics::FigureOrigin {
            known_by: dynamics::KnownBy::Drives,
            sigma: (!self.is_factor).then_some(self.sigma),
            interval_90: (!self.is_factor).then_some(self.interval_90),
            source: if self.is_factor {
                let [low, high] = self.interval_90;
                format!("{source}; times {:.4} ({low:.4} to {high:.4})", self.value)
            } else {
                source.to_owned()
            },
        }
    }
}

/// A figure that the drives do not tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotTold {
    /// Dotted path in the truck file.
    pub path: String,
    /// Why.
    pub why: String,
}

/// Two figures that the drives cannot tell apart well.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correlated {
    /// Paths.
    pub figures: [String; 2],
    /// Correlation coefficient.
    pub correlation: f64,
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The truck with every figure that was told.
    pub truck: TruckParameters,
    /// Figures that were told.
    pub figures: Vec<Identified>,
    /// Figures that were not.
    pub not_told: Vec<NotTold>,
    /// Pairs that move together.
    pub correlated: Vec<Correlated>,
    /// Names of the drives.
    pub drives: Vec<String>,
    /// Defects of the data, and columns that were worked out.
    pub findings: Vec<Finding>,
}

/// Identifies the truck of `drives`, which must be in order, starting from a truck file.
///
/// # Errors
/// Drives that are too short, whose gears do not fit the truck file's, or a truck that nothing makes
/// of.
pub fn identify(
    truck: &TruckParameters,
    drives: &DriveSet,
    executor: &dyn Executor,
) -> Result<Identification, DiagnosisError> {
    let road_load = coast_down::identify(truck, &drives.drives.iter().collect::<Vec<_>>())?;
    let names = drives.drives.iter().map(|d| d.name.clone()).collect();
    let (drives, findings) = driven(truck, drives);
    let mut start = truck.clone();
    let mut figures: Vec<Identified> = Vec::new();
    let mut not_told = Vec::new();
    if let Some(found) = road_load {
        for f in &found.figures {
            let bad = |e: dynamics::DynamicsError| DiagnosisError::Truck(e.to_string());
            start = start.with_parameter(&f.path, f.value).map_err(bad)?;
            start.provenance.insert(f.path.clone(), f.origin("coast-downs"));
        }
        (figures, not_told) = (found.figures, found.not_told);
    }
    if drives.drives.is_empty() {
        not_told.extend(FIGURES.iter().map(|f| f.path(truck)).filter_map(|path| {
            let told = figures.iter().any(|f| f.path == path);
            let why = "no drive under power".to_owned();
            (!told && !path.is_empty()).then(|| NotTold { path: path.to_owned(), why })
        }));
        let correlated = Vec::new();
        return Ok(Identification {
            truck: start,
            figures,
            not_told,
            correlated,
            drives: names,
            findings,
        });
    }
    crate::data::plausible::check_length(&drives)?;
    let ratios = ratios::identify(&start, &drives)?;
    let mut standing = Standing::new(ratios.truck);
    start::stable(&mut standing, &drives.drives)?;
    let mut round = 0;
    let told = loop {
        let plant = Plant::of_truck(&standing.truck)?;
        let prepared: Vec<Prepared> =
            drives.drives.iter().map(|d| Prepared::new(d, &plant)).collect();
        let weighed = drives.drives.iter().any(|d| d.reported_mass_kg.is_some());
        let (asked, missing): (Vec<_>, Vec<_>) =
            FIGURES.iter().partition(|f| f.missing(&prepared).is_empty());
        let wanted = asked
            .iter()
            .map(|f| (f.p, standing.prior(&start, f, weighed)))
            .collect::<Vec<(P, Prior)>>();
        let known: Vec<P> = asked.iter().map(|f| f.p).collect();
        let problem = Problem::learn_about(&plant, prepared, &known, executor)?;
        let evidence = problem.evidence();
        let fit = evidence
            .fit_figures(&wanted)
            .ok_or_else(|| DiagnosisError::Numerics("identification".into()))?;
        let variances = evidence.variances(&fit);
        let sigma: Vec<f64> = variances.iter().map(|v| v.sqrt()).collect();
        let zero = evidence.zero();
        let size = |j: usize| fit.theta[fit.free[j] as usize] - zero[fit.free[j] as usize];
        let is_told = |j: usize| sigma[j] <= TOLD * wanted[j].1.sigma;
        let moved = (0..asked.len())
            .filter(|j| is_told(*j))
            .map(|j| size(j).abs() / sigma[j])
            .fold(0.0, f64::max);
        round += 1;
        let sizes: Vec<(&Figure, f64)> =
            (0..asked.len()).filter(|j| is_told(*j)).map(|j| (asked[j], size(j))).collect();
        let before = standing.clone();
        standing.apply(&sizes);
        if moved < SETTLED || round == ROUNDS {
            let missing = missing.iter().map(|f| lacks_channels(truck, f, &problem.drives));
            let mut not: Vec<NotTold> = missing.collect();
            not.extend((0..asked.len()).filter(|j| !is_told(*j)).map(|j| {
                NotTold {
                    path: asked[j].path(truck).to_owned(),
                    why: asked[j]
                        .id
                        .map_or("the drives excite it too little", sentence::not_excited)
                        .to_owned(),
                }
            }));
            let refused = |j: usize| standing.refused.get(asked[j].path(truck)).copied();
            not.extend((0..asked.len()).filter(|j| is_told(*j)).filter_map(|j| {
                let why = format!("the drives ask for {:.4}, which no truck has", refused(j)?);
                Some(NotTold { path: asked[j].path(truck).to_owned(), why })
            }));
            let figures = (0..asked.len())
                .filter(|j| is_told(*j) && refused(*j).is_none())
                .map(|j| {
                    let slope = before.slope(asked[j]);
                    let value = standing.value(asked[j]);
                    let sigma = slope.abs() * whole_sigma(&asked, &fit, &variances, j);
                    let half = SIGMAS_90 * sigma;
                    Identified {
                        path: asked[j].path(truck).to_owned(),
                        is_factor: asked[j].is_factor(),
                        nominal: Standing::new(truck.clone()).value(asked[j]),
                        value,
                        sigma,
                        interval_90: [value - half, value + half],
                        prior_sigma: Some((slope * wanted[j].1.sigma).abs()),
                    }
                })
                .collect::<Vec<_>>();
            let pairs = correlated(truck, &asked, &fit, is_told);
            break (figures, not, pairs);
        }
    };
    let (fitted, untold, correlated) = told;
    let of = |path: &str| fitted.iter().any(|f| f.path == path);
    figures.retain(|f| !of(&f.path));
    figures.extend(ratios.figures);
    figures.extend(fitted.iter().cloned());
    not_told.extend(untold);
    not_told.extend(ratios.not_told);
    not_told.retain(|n| !figures.iter().any(|f| f.path == n.path));
    Ok(Identification {
        truck: standing.truck,
        figures,
        not_told,
        correlated,
        drives: names,
        findings,
    })
}

/// The drives that are no coast-downs, with columns that could be worked out, and all findings.
fn driven<'a>(truck: &TruckParameters, set: &'a DriveSet) -> (Cow<'a, DriveSet>, Vec<Finding>) {
    let mut findings = set.findings.clone();
    let mut drives: Vec<Cow<'_, Drive>> = Vec::new();
    for d in set.drives.iter().filter(|d| d.coast_down.is_none()) {
        let (completed, said) = columns::completed(truck, d);
        drives.push(completed.map_or(Cow::Borrowed(d), Cow::Owned));
        findings.extend(said);
    }
    let as_it_is = drives.iter().all(|d| matches!(d, Cow::Borrowed(_)));
    if as_it_is && drives.len() == set.drives.len() {
        return (Cow::Borrowed(set), findings);
    }
    let drives = drives.into_iter().map(Cow::into_owned).collect();
    (Cow::Owned(DriveSet { truck: set.truck.clone(), drives, findings: Vec::new() }), findings)
}

fn lacks_channels(truck: &TruckParameters, figure: &Figure, drives: &[Prepared]) -> NotTold {
    NotTold {
        path: figure.path(truck).to_owned(),
        why: format!("channels are missing: {}", figure.missing(drives).join(", ")),
    }
}

/// Standard deviation of a figure's size, with what the reference torque adds to it and what no drive
/// tells.
fn whole_sigma(asked: &[&Figure], fit: &Fit, variances: &[f64], j: usize) -> f64 {
    let c = &fit.covariance;
    let share = asked[j].with_torque();
    let torque = asked.iter().position(|f| f.p == P::TorqueScale).filter(|_| share != 0.0);
    let own = torque
        .map_or(c[(j, j)], |t| c[(j, j)] + share * share * c[(t, t)] + 2.0 * share * c[(j, t)]);
    // as far as the drives disagree
    let dispersion = torque.map_or(1.0, |t| variances[t] / c[(t, t)]).max(variances[j] / c[(j, j)]);
    (own * dispersion).sqrt().hypot(asked[j].beyond_drives())
}

fn correlated(
    truck: &TruckParameters,
    asked: &[&Figure],
    fit: &Fit,
    is_told: impl Fn(usize) -> bool,
) -> Vec<Correlated> {
    let mut out = Vec::new();
    for a in (0..asked.len()).filter(|j| is_told(*j)) {
        for b in (a + 1..asked.len()).filter(|j| is_told(*j)) {
            let c = &fit.covariance;
            let correlation = c[(a, b)] / (c[(a, a)] * c[(b, b)]).sqrt();
            if correlation.abs() >= LISTED_CORRELATION {
                let figures = [a, b].map(|j| asked[j].path(truck).to_owned());
                out.push(Correlated { figures, correlation });
            }
        }
    }
    out.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    out
}

impl Identification {
    /// The truck file: every figure that was told with its interval and `source` in `[provenance]`.
    ///
    /// # Errors
    /// [`DiagnosisError::Truck`] if a figure came out that no truck can have.
    pub fn truck_file(&self, name: &str, source: &str) -> Result<String, DiagnosisError> {
        let mut truck = self.truck.clone();
        truck.name = name.to_owned();
        for f in &self.figures {
            truck.provenance.insert(f.path.clone(), f.origin(source));
        }
        let bad = |e: &dyn core::fmt::Display| DiagnosisError::Truck(e.to_string());
        let text = toml::to_string(&truck).map_err(|e| bad(&e))?;
        TruckParameters::from_toml_str(name, &text).map_err(|e| bad(&e))?;
        Ok(text)
    }
}
