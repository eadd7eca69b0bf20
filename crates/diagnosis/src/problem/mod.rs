//! Residuals, sensitivities and tolerances of a set of drives in one nuisance-marginal metric.
//!
//! Per drive `M = I - Z (I + Z'Z)^-1 Z'`, the columns of `Z` being the sensitivities to the
//! tolerances of that drive (load sheet, weather, instruments), scaled by their standard
//! deviations. Everything that the search needs is a Gram matrix in `M`, kept per drive.

mod attack;
pub(crate) mod baseline;
mod calibrate;
pub(crate) mod course;
mod gram;
mod hat;
mod means;
mod moved;
pub(crate) mod noise;
mod nuisance;
mod random;
mod second_order;
mod signals;
pub(crate) mod stats;
mod white;

pub(crate) use gram::Gram;
pub(crate) use moved::moves;
pub(crate) use nuisance::Rest;

use means::means_apart;
#[cfg(test)]
pub(crate) use noise::resolution;
use noise::{Noise, fit_whiteners};
use nuisance::{Changed, Nuisance};
use signals::Kept;

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::causes::param::{P, PARAMS, SPECS, Theta};
use crate::problem::course::Point;
use crate::problem::stats::slow::SlowFilter;
use crate::problem::stats::whiten::{Rows, Whitener};
use crate::replay::{GROUPS, MODULES, Module, Prepared, Residuals, replay_group};
use crate::search::decisions::MEAN_PRIOR;
use crate::search::worth::Dispersion;
use crate::{DiagnosisError, Executor, Plant, collect};

/// Tolerances, calibration and noise of a truck and its logger.
#[derive(Debug, Clone)]
pub(crate) struct Reference {
    /// Common calibration, the zero of all causes.
    pub(crate) theta: Theta,
    /// Scatter between drives, per parameter; 0 where none.
    pub(crate) tolerance: [f64; PARAMS],
    /// Factor of the covariance of the tolerances' means, in the scatter between drives; rows in the
    /// order of their columns.
    pub(crate) means: DMatrix<f64>,
    pub(crate) whiteners: Vec<Whitener>,
    /// Mean square of whitened residuals at the calibration, tolerances included, per module.
    pub(crate) ratio: [f64; MODULES],
    /// The same with the tolerances taken out.
    pub(crate) settled: [f64; MODULES],
    /// Evidence of the best free function per module on drives that are in order, nats per drive.
    pub(crate) free_form: [f64; MODULES],
    /// How much more drives in order scatter about the sizes of every hypothesis than their information
    /// says; empty where no baseline has shown it.
    pub(crate) scatter: Vec<Dispersion>,
    /// What the baseline says for another point where side winds act than the truck file's, nats.
    pub(crate) attack_nats: f64,
}

/// Times that the noise is learned: each needs the tolerances of the one before.
const NOISE_ROUNDS: usize = 2;

/// A set of drives ready for the search.
pub(crate) struct Problem<'a> {
    pub(crate) plant: &'a Plant,
    pub(crate) drives: Vec<Prepared>,
    pub(crate) reference: Reference,
    nuisance: Vec<Nuisance>,
    /// Slow noise over the rows of every drive, per module.
    slow: Vec<[Option<SlowFilter>; MODULES]>,
    /// Information of every drive about the means of the tolerances.
    common: Arc<Vec<DMatrix<f64>>>,
    kept: Vec<Kept>,
    shifts: Vec<moved::Shifts>,
    hats: hat::Hats,
    executor: &'a dyn Executor,
}

/// A direction in parameter space: from `base`, a step of `step` along `p`.
#[derive(Debug, Clone)]
pub(crate) struct Direction {
    pub(crate) p: P,
    /// Shape parameters that hold while the direction is taken.
    pub(crate) shape: Vec<(P, f64)>,
    pub(crate) step: f64,
    /// What its rows are multiplied with.
    pub(crate) hat: Option<Hat>,
}

/// One of some hat functions over a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Hat {
    /// Index into [`SIGNALS`](crate::replay::signal::SIGNALS).
    pub(crate) signal: usize,
    /// Its number, and that of the last one.
    pub(crate) knot: usize,
    pub(crate) last: usize,
}

impl Direction {
    pub(crate) fn new(p: P, shape: Vec<(P, f64)>, step: f64) -> Self {
        Self { p, shape, step, hat: None }
    }
}

fn nuisance_directions(tolerance: &[f64; PARAMS]) -> Vec<Direction> {
    SPECS
        .iter()
        .filter(|s| tolerance[s.p as usize] > 0.0)
        .map(|s| Direction::new(s.p, Vec::new(), s.step))
        .collect()
}

impl<'a> Problem<'a> {
    /// Learns calibration, tolerances and noise from drives that are in order (`clean`), or only
    /// the noise from drives that need not be.
    pub(crate) fn learn(
        plant: &'a Plant,
        drives: Vec<Prepared>,
        clean: bool,
        executor: &'a dyn Executor,
    ) -> Result<Self, DiagnosisError> {
        let theta = [0.0; PARAMS];
        let residuals: Vec<Residuals> = drives.iter().map(|d| replay(d, plant, &theta)).collect();
        let reference = Reference::start(&drives, &residuals, theta, clean);
        let mut problem = Self::with(plant, drives, reference, executor)?;
        let mut moved = [0.0; PARAMS];
        for round in 0..NOISE_ROUNDS {
            if clean {
                problem.calibrate(round == 0)?;
            } else {
                problem.recentre()?;
            }
            if clean && round > 0 {
                problem.reference.attack_nats = problem.find_attack()?;
                problem.scatter(&mut moved)?;
                problem.rebuild(Changed::Scatter)?;
            }
            problem.learn_noise(if clean { Noise::Slow } else { Noise::Coloured })?;
        }
        if clean {
            // What the baseline calls the mean is known up to its own scatter.
            problem.reference.means = problem.scatter(&mut moved)?;
            problem.rebuild(Changed::Scatter)?;
            problem.reference.scatter = problem.evidence().scatter_in_order();
            problem.reference.ratio = problem.ratios(&problem.reference.theta);
            let bare = Point::bare(problem.reference.theta);
            problem.reference.settled = problem.settled(&bare);
            let count = problem.drives.len() as f64;
            for s in problem.shapes(&bare) {
                let f = &mut problem.reference.free_form[s.module as usize];
                *f = f.max(s.log_z / count);
            }
        }
        Ok(problem)
    }

    /// Learns the noise from drives whose truck is to be identified: the means of `figures` are what
    /// is asked for, no tolerance.
    pub(crate) fn learn_about(
        plant: &'a Plant,
        drives: Vec<Prepared>,
        figures: &[P],
        executor: &'a dyn Executor,
    ) -> Result<Self, DiagnosisError> {
        let theta = [0.0; PARAMS];
        let residuals: Vec<Residuals> = drives.iter().map(|d| replay(d, plant, &theta)).collect();
        let mut reference = Reference::start(&drives, &residuals, theta, false);
        for p in figures {
            reference.tolerance[*p as usize] = p.spec().scatter();
        }
        let spread = |p| if figures.contains(&p) { 0.0 } else { MEAN_PRIOR };
        reference.means = means_apart(&reference.tolerance, spread);
        let mut problem = Self::with(plant, drives, reference, executor)?;
        for _ in 0..NOISE_ROUNDS {
            problem.recentre()?;
            problem.learn_noise(Noise::Coloured)?;
        }
        Ok(problem)
    }

    /// Takes the noise from what the tolerances leave over.
    fn learn_noise(&mut self, kind: Noise) -> Result<(), DiagnosisError> {
        let noise = self.each(|i| self.without_nuisance(i, &self.nuisance_mean(i)));
        self.reference.whiteners = fit_whiteners(&self.drives, &noise, kind);
        self.rebuild(Changed::Noise)
    }

    /// Mean square of whitened residuals per module; 1 where a module has no rows.
    pub(crate) fn ratios(&self, theta: &Theta) -> [f64; MODULES] {
        let mut sums = [(0.0, 0.0); MODULES];
        for (i, d) in self.drives.iter().enumerate() {
            for ((sum, w), ok) in sums.iter_mut().zip(&self.whitened(i, theta)).zip(&d.valid) {
                sum.0 += w.iter().map(|x| x * x).sum::<f64>();
                sum.1 += ok.iter().filter(|x| **x).count() as f64;
            }
        }
        sums.map(|(s, n)| if n > 0.0 && s > 0.0 { s / n } else { 1.0 })
    }

    /// A problem on other drives with a reference learned before.
    pub(crate) fn with(
        plant: &'a Plant,
        drives: Vec<Prepared>,
        reference: Reference,
        executor: &'a dyn Executor,
    ) -> Result<Self, DiagnosisError> {
        let kept = drives.iter().map(|_| Kept::default()).collect();
        let shifts = drives.iter().map(|_| moved::Shifts::default()).collect();
        let mut problem = Self {
            plant,
            drives,
            reference,
            nuisance: Vec::new(),
            slow: Vec::new(),
            common: Arc::default(),
            kept,
            shifts,
            hats: hat::Hats::default(),
            executor,
        };
        problem.rebuild(Changed::Everything)?;
        Ok(problem)
    }

    /// Runs `f` for every drive, by the executor.
    pub(crate) fn each<T: Send>(&self, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
        collect(self.executor, self.drives.len(), f)
    }

    /// Whitened residuals of drive `i` at `theta`.
    pub(crate) fn whitened(&self, i: usize, theta: &Theta) -> [Vec<f64>; MODULES] {
        self.spread(i, &self.at(i, theta))
    }
}

/// All residuals of a drive.
pub(crate) fn replay(d: &Prepared, plant: &Plant, theta: &Theta) -> Residuals {
    let mut out = Residuals::default();
    for g in GROUPS {
        replay_group(d, plant, theta, g, &mut out);
    }
    out
}

/// Rows of a module: what an engine reports of its torque is wrong by a part of it.
fn rows(d: &Prepared, m: usize) -> Rows<'_> {
    let carrier = (m == Module::Torque as usize).then_some(d.torque.as_slice());
    Rows { ok: &d.valid[m], carrier }
}

/// Inner product with eight running sums, so that the compiler may use wide registers.
fn inner(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (mut sums, whole) = ([0.0; 8], n - n % 8);
    for (x, y) in a[..whole].chunks_exact(8).zip(b[..whole].chunks_exact(8)) {
        for (s, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *s += x * y;
        }
    }
    let rest: f64 = a[whole..n].iter().zip(&b[whole..n]).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + rest
}
