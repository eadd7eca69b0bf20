//! Comma-separated tables with a header line.

use std::path::Path;

use super::RawTable;
use crate::DiagnosisError;

pub(super) fn read(path: &Path) -> Result<RawTable, DiagnosisError> {
    let bad = |why: String| DiagnosisError::Table { path: path.to_owned(), why };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|e| DiagnosisError::Io { path: path.to_owned(), why: e.to_string() })?;
    let header = reader.headers().map_err(|e| bad(e.to_string()))?.clone();
    let mut columns: Vec<(String, Vec<f64>)> =
        header.iter().map(|h| (h.to_owned(), Vec::new())).collect();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|e| bad(e.to_string()))?;
        for (field, column) in record.iter().zip(&mut columns) {
            let value = if field.is_empty() {
                f64::NAN
            } else {
                field.parse().map_err(|_| {
                    bad(format!("line {}, column {}: {field:?} is no number", row + 2, column.0))
                })?
            };
            column.1.push(value);
        }
    }
    Ok(RawTable { columns })
}
