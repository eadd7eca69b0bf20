//! What drives that are in order teach.

use crate::answer::gain::{DriveError, drive_error, rms};
use crate::problem::{Problem, Reference};
use crate::replay::Prepared;
use crate::run::drive_use::DriveUse;
use crate::{DiagnosisError, DriveSet, Executor, Plant};

/// Timing, noise and tolerances of a truck and its logger, learned from drives that are in order.
#[derive(Debug, Clone)]
pub struct Baseline {
    pub(crate) reference: Reference,
    pub(crate) floor: Vec<DriveError>,
    pub(crate) used: Vec<DriveUse>,
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
