//! Errors of the contract types.

use alloc::string::String;

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
    /// A table's abscissa does not increase strictly, or its sizes do not match.
    #[error("table {name}: {why}")]
    BadTable {
        /// Name of the table.
        name: String,
        /// What is wrong with it.
        why: String,
    },
}
