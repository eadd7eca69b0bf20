//! What can be wrong with a request to the predictive cruise control.

use alloc::string::String;

use tractrix_core::CoreError;

/// A request that cannot be planned. Outcomes of a valid request (solver limits, unreachable trip
/// time) are values: see [`super::TripStatus`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PccError {
    /// The truck reports something that cannot be planned with.
    #[error("vehicle limits: {0}")]
    Limits(#[from] CoreError),
    /// A quantity is not finite or outside what the planner accepts.
    #[error("{quantity} = {value} is not accepted: {why}")]
    BadValue {
        /// Name with unit, and index where it is an element.
        quantity: String,
        /// The value found.
        value: f64,
        /// What is required.
        why: &'static str,
    },
    /// Lengths do not fit together.
    #[error("{quantity}: {why}")]
    BadShape {
        /// Name of the table or list.
        quantity: String,
        /// What is wrong with it.
        why: String,
    },
    /// No gear moves the truck up this grade.
    #[error(
        "grade of {grade_rad:.4} rad at s = {s_m:.0} m: full traction does not move {mass_kg:.0} kg"
    )]
    TooSteep {
        /// Where, m.
        s_m: f64,
        /// Grade, rad.
        grade_rad: f64,
        /// Total mass, kg.
        mass_kg: f64,
    },
    /// The brakes that the planner may use do not hold the truck.
    #[error(
        "grade of {grade_rad:.4} rad at s = {s_m:.0} m: a brake deceleration of {brake_decel_m_s2:.2} m/s2 does not hold the speed limit"
    )]
    BrakesTooWeak {
        /// Where, m.
        s_m: f64,
        /// Grade, rad.
        grade_rad: f64,
        /// Largest planned brake deceleration, m/s².
        brake_decel_m_s2: f64,
    },
}

/// Checks one number against a closed range.
pub(crate) fn check(
    quantity: &str,
    value: f64,
    low: f64,
    high: f64,
    why: &'static str,
) -> Result<(), PccError> {
    if value.is_finite() && value >= low && value <= high {
        Ok(())
    } else {
        Err(PccError::BadValue { quantity: String::from(quantity), value, why })
    }
}
