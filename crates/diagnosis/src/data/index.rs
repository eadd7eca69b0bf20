//! `drives.toml`, the index of a folder of measured drives, as it is written and as it is read.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tractrix_core::words::deserializer_message;

use crate::{DiagnosisError, Table};

/// Name of a folder's index.
pub(crate) const INDEX: &str = "drives.toml";
/// The form of the index.
const SCHEMA: u32 = 1;

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Index {
    schema: u32,
    /// The truck file that the measurement was made with.
    pub(crate) truck: String,
    #[serde(default)]
    pub(crate) drive: Vec<Entry>,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) file: String,
    pub(crate) map: Option<String>,
    pub(crate) reported_mass_kg: Option<f64>,
    pub(crate) tyres_warm_at_start: Option<bool>,
    /// Of a coast-down: standard deviations of its readings, where they are no logger's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) time_sigma_s: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) speed_sigma_m_s: Option<f64>,
}

impl Index {
    /// Reads the index of a folder.
    pub(crate) fn read(dir: &Path) -> Result<Self, DiagnosisError> {
        let path = dir.join(INDEX);
        let text = std::fs::read_to_string(&path)
            .map_err(|e| DiagnosisError::Io { path: path.clone(), why: e.to_string() })?;
        let bad = |why: String| DiagnosisError::Index { path: path.clone(), why };
        let index: Index = toml::from_str(&text).map_err(|e| {
            let before = e.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            let line = before.matches('\n').count() + 1;
            bad(format!("line {line}: {}", deserializer_message(e.message())))
        })?;
        if index.schema != SCHEMA {
            let schema = index.schema;
            return Err(bad(format!("schema = {schema}, this program reads schema {SCHEMA}")));
        }
        if index.drive.is_empty() {
            return Err(bad("no [[drive]] in it".into()));
        }
        for (i, entry) in index.drive.iter().enumerate() {
            if index.drive[..i].iter().any(|d| d.name == entry.name) {
                return Err(bad(format!("two drives are named {:?}", entry.name)));
            }
        }
        Ok(index)
    }
}

/// `drives.toml` of drives of a truck.
///
/// # Errors
/// [`DiagnosisError::Numerics`] if it cannot be serialised.
pub fn drives_index(truck: &str, tables: &[Table]) -> Result<String, DiagnosisError> {
    let entry = |t: &Table| Entry {
        name: t.name.clone(),
        file: format!("{}.csv", t.name),
        map: t.map.clone(),
        reported_mass_kg: t.reported_mass_kg,
        tyres_warm_at_start: t.tyres_warm_at_start,
        time_sigma_s: None,
        speed_sigma_m_s: None,
    };
    let drive = tables.iter().map(entry).collect();
    let index = Index { schema: SCHEMA, truck: truck.to_owned(), drive };
    toml::to_string(&index).map_err(|e| DiagnosisError::Numerics(e.to_string()))
}
