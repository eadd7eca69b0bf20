//! Errors of the contract types.

use alloc::string::String;
use alloc::vec::Vec;

/// What can be wrong with a contract value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoreError {
    /// A number is NaN or infinite.
    #[error("{field} is not finite: {value}")]
    NonFinite {
        /// Field name with unit.
        field: &'static str,
        /// The value found.
        value: f64,
    },
    /// A number is outside the range that can be planned with.
    #[error("{field} = {value} is outside {low} to {high}")]
    OutOfRange {
        /// Key with unit, and index where it is an element.
        field: String,
        /// The value found.
        value: f64,
        /// Lowest allowed value.
        low: f64,
        /// Highest allowed value.
        high: f64,
    },
    /// A truck's data sheet cannot be used.
    #[error("{file}: {}", wrong.join("; "))]
    Sheet {
        /// The file as it was named.
        file: String,
        /// Everything that is wrong with it.
        wrong: Vec<String>,
    },
    /// A table's abscissa does not increase strictly, or its sizes do not match.
    #[error("table {name}: {why}")]
    BadTable {
        /// Name of the table.
        name: String,
        /// What is wrong with it.
        why: String,
    },
}

/// Checks that named numbers are finite.
pub(crate) fn finite(
    numbers: impl IntoIterator<Item = (&'static str, f64)>,
) -> Result<(), CoreError> {
    for (field, value) in numbers {
        if !value.is_finite() {
            return Err(CoreError::NonFinite { field, value });
        }
    }
    Ok(())
}
