//! Writes a folder of measured drives as the contract has it.

use std::path::Path;

use diagnosis::{Table, drives_index};

use crate::failure::Failure;
use crate::out_folder::write_whole;

/// Table rate of a drive, s.
pub(crate) const STEP_S: f64 = 0.05;

/// Writes a folder of drives of a truck.
pub(crate) fn write(folder: &Path, truck: &str, tables: &[Table]) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::writing(folder, &e))?;
    for table in tables {
        write_whole(&folder.join(format!("{}.csv", table.name)), table.csv().as_bytes())?;
    }
    let index = drives_index(truck, tables).map_err(Failure::work)?;
    write_whole(&folder.join("drives.toml"), index.as_bytes())
}
