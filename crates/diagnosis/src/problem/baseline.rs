//! What drives that are in order teach.

use crate::answer::gain::{DriveError, drive_error, rms};
use crate::causes::hypothesis::{CATALOGUE, Hypothesis};
use crate::problem::noise::NoiseOfSums;
use crate::problem::{Problem, Reference};
use crate::replay::Prepared;
use crate::run::drive_use::DriveUse;
use crate::search::decisions::DISPERSION_PRIOR;
use crate::search::worth::Dispersion;
use crate::{DiagnosisError, DriveSet, Executor, Plant};

/// Timing, noise and tolerances of a truck and its logger, learned from drives that are in order.
#[derive(Debug, Clone)]
pub struct Baseline {
    pub(crate) reference: Reference,
    pub(crate) floor: Vec<DriveError>,
    pub(crate) used: Vec<DriveUse>,
}

/// How much drives in order scatter about the sizes of a hypothesis.
#[derive(Debug, Clone, Copy)]
pub struct ScatterOfSize {
    /// Its cause.
    pub id: &'static str,
    /// Variance over that which their information says, at least 1; the mean over its forms.
    pub ratio: f64,
    /// Drives that say something of the size, by what they say (Kish's effective number).
    pub drives: f64,
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

    /// How sums over `rows` rows scatter in `drives` that are in order, per quantity; those without as
    /// many are left out.
    ///
    /// # Errors
    /// Drives whose tolerances cannot be told.
    pub fn noise_of_sums(
        &self,
        plant: &Plant,
        drives: &DriveSet,
        rows: usize,
        executor: &dyn Executor,
    ) -> Result<Vec<NoiseOfSums>, DiagnosisError> {
        let drives = drives.drives.iter().map(|d| Prepared::new(d, plant)).collect();
        let problem = Problem::with(plant, drives, self.reference.clone(), executor)?;
        Ok(problem.noise_of_sums(rows))
    }

    /// How much drives in order scatter about the sizes of every hypothesis of the catalogue.
    #[must_use]
    pub fn scatter_of_sizes(&self) -> Vec<ScatterOfSize> {
        let of = |(h, s): (&Hypothesis, &Dispersion)| ScatterOfSize {
            id: h.id,
            ratio: s.ratio,
            drives: s.freedom - DISPERSION_PRIOR,
        };
        CATALOGUE.iter().zip(&self.reference.scatter).map(of).collect()
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
        crate::data::plausible::check_length(drives)?;
        let clean = drives.drives.iter().map(|d| Prepared::new(d, plant)).collect();
        let problem = Problem::learn(plant, clean, true, executor)?;
        let zero = problem.reference.theta;
        let floor: Vec<_> = problem.drives.iter().map(|d| drive_error(d, plant, &zero)).collect();
        let used = problem.drives.iter().zip(&floor).map(|(d, e)| DriveUse::baseline(d, e));
        let used = used.collect();
        Ok(Self { reference: problem.reference, floor, used })
    }
}
