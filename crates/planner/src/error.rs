//! What can be wrong with what the planner is built from. Refused manoeuvres and failed plans are
//! values ([`tractrix_core::LaneChangeRefusal`], [`tractrix_core::PlanStatus`]), not errors.

use alloc::string::String;
use tractrix_core::CoreError;

/// Errors of this crate, all raised while something is being built or loaded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlannerError {
    /// A configuration value is outside its range.
    #[error("stack configuration: {field} = {value} is outside {low} to {high}")]
    Config {
        /// Key with unit.
        field: &'static str,
        /// The value found.
        value: f64,
        /// Lowest allowed value.
        low: f64,
        /// Highest allowed value.
        high: f64,
    },
    /// The vehicle limits cannot be planned with.
    #[error("vehicle limits: {0}")]
    Limits(#[from] CoreError),
    /// The lateral controller has no stabilising gain for this handling data.
    #[error(
        "lateral controller: no stabilising gain at {speed_m_s} m/s with {trailer_mass_kg} kg of trailer"
    )]
    Riccati {
        /// Speed of the grid point, m/s.
        speed_m_s: f64,
        /// Trailer mass of the grid point, kg.
        trailer_mass_kg: f64,
    },
    /// A learned policy cannot be used.
    #[error("policy: {0}")]
    Policy(String),
    /// The learned decider was chosen without a policy.
    #[error("decider `dqn` needs a policy (policy.safetensors and policy.json)")]
    NoPolicy,
}

/// Checks `low <= value <= high`; NaN fails.
pub(crate) fn config_in(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), PlannerError> {
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(PlannerError::Config { field, value, low, high })
    }
}
