//! The diagnosis of measured drives.

use std::path::{Path, PathBuf};

use diagnosis::{DiagnosisError, Options, Request, read_drives_with};
use dynamics::TruckParameters;
use pyo3::{Python, pyfunction};
use sim::SimError;

use crate::fault::Fault;
use crate::provenance;
use shell::Threads;

/// The text of `diagnosis.json`; with `out`, also the files there.
#[pyfunction]
#[pyo3(signature = (truck, drives, *, baseline, hold_out, table_effect, seed, out))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn diagnose_json(
    py: Python<'_>,
    truck: &str,
    drives: PathBuf,
    baseline: Option<PathBuf>,
    hold_out: Vec<String>,
    table_effect: bool,
    seed: u64,
    out: Option<PathBuf>,
) -> Result<String, Fault> {
    py.detach(|| {
        let threads = Threads::available();
        let parameters =
            TruckParameters::load(truck).map_err(|e| Fault::of_input(&SimError::from(e)))?;
        let read = |folder: &Path| read_drives_with(folder, &threads).map_err(|e| of_drives(&e));
        let measured = read(&drives)?;
        let baseline = baseline.as_deref().map(read).transpose()?;
        let request = Request {
            truck: &parameters,
            truck_name: truck,
            drives: &measured,
            drives_at: &drives,
            baseline: baseline.as_ref(),
            options: &Options { hold_out, ..Options::default() },
            table_effect,
            seed,
        };
        let outcome = request.run(&threads, &mut |_| {}).map_err(|e| of_drives(&e))?;
        let work = |e: serde_json::Error| Fault::Work(e.to_string());
        let json = outcome.json(&provenance(seed)).map_err(work)?;
        if let Some(out) = &out {
            let file = |e: std::io::Error| Fault::Io(format!("{}: {e}", out.display()));
            std::fs::create_dir_all(out).map_err(file)?;
            outcome.write_truck(out).map_err(|e| of_drives(&e))?;
            let text = serde_json::to_string_pretty(&json).map_err(work)?;
            std::fs::write(out.join("diagnosis.json"), text).map_err(file)?;
        }
        Ok(json.to_string())
    })
}

/// Drives that cannot be diagnosed.
pub(crate) fn of_drives(error: &DiagnosisError) -> Fault {
    match error {
        DiagnosisError::Io { path, .. } => Fault::file(path, error.to_string()),
        _ => Fault::Value(error.to_string()),
    }
}
