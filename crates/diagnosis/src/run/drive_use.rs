//! What every drive was used for, and the sizes that it alone would choose.

use serde::Serialize;

use crate::answer::gain::{DriveError, drive_error};
use crate::causes::hypothesis::CATALOGUE;
use crate::causes::param::Theta;
use crate::problem::Problem;
use crate::replay::Prepared;
use crate::search::evidence::Evidence;
use crate::search::refit::Fit;
use crate::{Channel, Drive};

/// What a drive was used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveRole {
    /// The causes were sought on it.
    Learned,
    /// The gain was measured on it.
    HeldOut,
    /// In order: noise and tolerances were learned from it.
    Baseline,
}

/// The size of a cause that one drive alone would choose, the other sizes as found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SizeAlone {
    /// Cause.
    pub id: &'static str,
    /// Its size, as in [`crate::Cause::parameters`].
    pub parameter: &'static str,
    /// What this drive would choose, without a prior.
    pub value: f64,
    /// Standard deviation of it, from noise and tolerances of this drive.
    pub sigma: f64,
}

/// A drive and its part in a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveUse {
    /// Name of the drive.
    pub name: String,
    /// What it was used for.
    pub role: DriveRole,
    /// Length, s.
    pub duration_s: f64,
    /// Length, m.
    pub distance_m: f64,
    /// Mass of the combination that the load sheet says, kg.
    pub mass_kg: f64,
    /// Mean temperature of the air, degC, if it was measured.
    pub air_mean_degc: Option<f64>,
    /// Error of the speed over free runs of 60 s with the truck file, rms, m/s.
    pub speed_rmse_before_m_s: Option<f64>,
    /// The same with the causes found.
    pub speed_rmse_after_m_s: Option<f64>,
    /// Sizes that it alone would choose, of the causes that it says something about.
    pub alone: Vec<SizeAlone>,
}

impl DriveUse {
    pub(crate) fn baseline(drive: &Prepared, error: &DriveError) -> Self {
        let before = rmse(error);
        Self { speed_rmse_before_m_s: before, ..Self::plain(drive, DriveRole::Baseline) }
    }

    fn plain(d: &Prepared, role: DriveRole) -> Self {
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
        Self {
            name: d.name.clone(),
            role,
            duration_s: d.n as f64 * Drive::STEP_S,
            distance_m: d.speed.iter().sum::<f64>() * Drive::STEP_S,
            mass_kg: d.mass_kg,
            air_mean_degc: d.has(&[Channel::AmbientTempDegc]).then(|| mean(&d.ambient)),
            speed_rmse_before_m_s: None,
            speed_rmse_after_m_s: None,
            alone: Vec::new(),
        }
    }
}

fn rmse(error: &DriveError) -> Option<f64> {
    let [squares, samples] = error.speed;
    (samples > 0.0).then(|| (squares / samples).sqrt())
}

/// The drives of a problem before and after the causes of a fit.
pub(crate) fn drive_uses(problem: &Problem<'_>, role: DriveRole, after: &Theta) -> Vec<DriveUse> {
    let error = |i: usize, theta| rmse(&drive_error(&problem.drives[i], problem.plant, theta));
    problem.each(|i| DriveUse {
        speed_rmse_before_m_s: error(i, &problem.reference.theta),
        speed_rmse_after_m_s: error(i, after),
        ..DriveUse::plain(&problem.drives[i], role)
    })
}

impl dyn Evidence + '_ {
    /// Per drive, the sizes that it alone would choose: one step of Newton from the common ones,
    /// by the drive's own gradient and information. What a drive says less about than the prior is
    /// left out.
    pub(crate) fn alone(&self, fit: &Fit) -> Vec<Vec<SizeAlone>> {
        let mut sizes = Vec::new();
        for hyp in fit.set.iter().map(|h| &CATALOGUE[*h]) {
            let place = |p| fit.free.iter().position(|q| *q == p);
            sizes.extend(hyp.sizes.iter().filter_map(|p| Some((hyp.id, *p, place(*p)?))));
        }
        let scores = fit.gram.scores(&nalgebra::DVector::zeros(fit.free.len()));
        let drives = fit.gram.per_drive.iter().zip(scores);
        drives
            .map(|(gram, score)| {
                let of = |(id, p, j): &(&'static str, crate::causes::param::P, usize)| {
                    let (spec, information) = (p.spec(), gram[(j + 1, j + 1)]);
                    let sigma = 1.0 / information.max(f64::MIN_POSITIVE).sqrt();
                    let zero = if spec.is_factor() { -1.0 } else { 0.0 };
                    let x = fit.theta[*p as usize] - self.zero()[*p as usize] - zero;
                    let value = x + score[*j] / information;
                    let told = sigma < spec.prior;
                    told.then_some(SizeAlone { id, parameter: spec.key, value, sigma })
                };
                sizes.iter().filter_map(of).collect()
            })
            .collect()
    }
}
