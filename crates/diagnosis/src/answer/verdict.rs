//! What is concluded: the form of `diagnosis.json`.

use serde::Serialize;
use std::collections::BTreeMap;

use crate::CauseKind;
use crate::run::report_models::Models;
use crate::{Detectable, DriveUse, Finding};

/// What the search concludes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Named causes explain what is wrong.
    Explained,
    /// Nothing beyond the tolerances of trucks, loads, weather and instruments.
    NothingToExplain,
    /// Something is wrong that no cause of the catalogue explains.
    Unknown,
    /// Two causes explain the drives equally well, or the named ones leave so much unexplained that
    /// they may stand in for another.
    Ambiguous,
}

/// A quantity that the simulation gets wrong.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Wrong {
    /// Column name.
    pub quantity: &'static str,
    /// Length of the free run, s; 0 for a one-step residual.
    pub horizon_s: f64,
    /// Root mean square error, in the quantity's unit.
    pub rmse: f64,
    /// Mean error, replayed minus measured.
    pub bias: f64,
    /// One minus the root mean square error over the root mean square of the signal.
    pub accuracy_frac: f64,
    /// Where it is large, in words.
    pub r#where: String,
    /// Root mean square error of drives that are in order.
    pub noise_floor: f64,
}

/// A fitted parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Parameter {
    /// Value; a factor for scales, otherwise an addition to the truck file's figure.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Unit, "1" for ratios.
    pub unit: &'static str,
}

/// Another cause that the drives cannot tell apart from the named one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusion {
    /// Its id.
    pub id: &'static str,
    /// Why, and what would separate them.
    pub why: String,
    /// How probable it is in the place of the named one.
    pub probability: f64,
}

/// A named cause.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    /// Fixed word of the catalogue.
    pub id: &'static str,
    /// Kind of error.
    pub kind: CauseKind,
    /// For a truck engineer.
    pub sentence: String,
    /// Size and shape.
    pub parameters: BTreeMap<&'static str, Parameter>,
    /// Log evidence that is lost without it, nats.
    pub evidence: f64,
    /// How probable it is, of the models that were compared.
    pub probability: f64,
    /// What it could be instead.
    pub confused_with: Vec<Confusion>,
}

/// What is left outside the catalogue.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unknown {
    /// Signals that it follows, best first.
    pub signals: Vec<&'static str>,
    /// The quantity in which it shows.
    pub quantity: &'static str,
    /// Its shape in words.
    pub shape: String,
    /// Part of the excess error that a free function of the first signal explains.
    pub explained_frac: f64,
    /// Evidence, nats.
    pub evidence: f64,
    /// Signal and error at the knots of the function; the error is a part of what it scales where it
    /// is a factor, otherwise in the unit of the balance.
    pub table: Vec<(f64, f64)>,
    /// The function is a factor, on the quantity or on a part of its balance (`shape` says which).
    pub is_factor: bool,
    /// The function follows a first-order memory of the signal with this time constant, s; 0: the
    /// signal as it is.
    pub memory_s: f64,
}

/// A cause that these drives cannot show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotObservable {
    /// Its id.
    pub id: &'static str,
    /// Why.
    pub why: String,
    /// Columns without which it cannot be seen, if it is these.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing_channels: Vec<&'static str>,
}

/// A figure before and after the extension.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct BeforeAfter {
    /// With the truck file.
    pub before: f64,
    /// With the extended truck.
    pub after: f64,
}

/// Gain on drives that the search has not seen.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Gain {
    /// Their names.
    pub held_out: Vec<String>,
    /// Speed over 60 s, m/s.
    pub speed_rmse_m_s: BeforeAfter,
    /// Tractor yaw rate, rad/s.
    pub yaw_rate_rmse_rad_s: BeforeAfter,
    /// Error of the fuel used, part of the measured.
    pub fuel_error_frac: BeforeAfter,
    /// Fall of the whitened, tolerance-marginal residual norm on the held-out drives, nats.
    pub log_score_nats: f64,
    /// The gain stands out of the scatter between drives.
    pub significant: bool,
}

/// Where the side force of the wind acts on the truck, as the winds of the baseline's days show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SideForcePoint {
    /// For people.
    pub sentence: String,
    /// Part of it on the tractor, 1: `resistance.side_force_tractor_frac`.
    pub tractor_frac: f64,
    /// How far behind its CG the trailer's part acts, m: `resistance.side_force_trailer_behind_cg_m`.
    pub trailer_behind_cg_m: f64,
    /// What the baseline says for this point against the truck file's, nats.
    pub evidence: f64,
}

/// Everything that was concluded.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Version of the form, 1.
    pub schema: u32,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the truck file.
    pub truck: String,
    /// Conclusion.
    pub verdict: Verdict,
    /// What the simulation gets wrong.
    pub wrong: Vec<Wrong>,
    /// Why, in order of evidence.
    pub causes: Vec<Cause>,
    /// What is left without a name.
    pub unknown: Option<Unknown>,
    /// Causes that these drives cannot show.
    pub not_observable: Vec<NotObservable>,
    /// What these drives would have shown, by id.
    pub detectable: Vec<Detectable>,
    /// Gain on held-out drives.
    pub gain: Option<Gain>,
    /// File name of the extended truck, if there is one.
    pub extended_truck: Option<String>,
    /// Tolerances were learned from a baseline; otherwise they are defaults.
    pub tolerances_from_baseline: bool,
    /// Where side winds act, if the baseline shows another point than the truck file's.
    pub side_force: Option<SideForcePoint>,
    /// The drives and what each was used for.
    pub drives: Vec<DriveUse>,
    /// Defects of the data.
    pub findings: Vec<Finding>,
    /// The models that were compared.
    #[serde(skip)]
    pub models: Models,
}
