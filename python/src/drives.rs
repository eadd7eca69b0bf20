//! Logs of a truck's bus into measured drives.

use std::path::{Path, PathBuf};

use diagnosis::DiagnosisError;
use diagnosis::from_log::{Assigned, Dbc, Job, LogFile, Map, Project, Report};
use dynamics::TruckParameters;
use planner::localise::MapProjection;
use pyo3::{Python, pyfunction};
use road::GeoReference;
use serde::Serialize;
use sim::SimError;

use crate::diagnose::of_drives;
use crate::fault::Fault;
use crate::provenance;

/// `conversion.json`.
#[derive(Serialize)]
struct Content<'a> {
    #[serde(flatten)]
    provenance: tractrix_core::Provenance,
    #[serde(flatten)]
    report: &'a Report,
}

/// Writes the folder; the text of `conversion.json`. `logs` are logs of candump, `named` what the
/// user calls them, `masses_kg` one for each.
#[pyfunction]
#[pyo3(signature = (logs, named, masses_kg, *, truck, out, map, start_s_m, dbc, signals, standstill_s, min_drive_s, overwrite))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub(crate) fn drives_from_logs(
    py: Python<'_>,
    logs: Vec<PathBuf>,
    named: Vec<PathBuf>,
    masses_kg: Vec<Option<f64>>,
    truck: &str,
    out: PathBuf,
    map: Option<String>,
    start_s_m: Option<f64>,
    dbc: Option<PathBuf>,
    signals: Vec<String>,
    standstill_s: f64,
    min_drive_s: f64,
    overwrite: bool,
) -> Result<String, Fault> {
    py.detach(|| {
        if !overwrite && out.join("drives.toml").exists() {
            let at = out.display();
            return Err(Fault::Value(format!("{at}: drives.toml is in it already (overwrite)")));
        }
        let positive = [("standstill_s", standstill_s), ("min_drive_s", min_drive_s)];
        let masses = masses_kg.iter().flatten().map(|kg| ("mass_kg", *kg));
        for (name, value) in positive.into_iter().chain(masses) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Fault::Value(format!("{name} = {value} is no positive number")));
            }
        }
        let parameters =
            TruckParameters::load(truck).map_err(|e| Fault::of_input(&SimError::from(e)))?;
        let assigned: Result<Vec<Assigned>, String> = signals.iter().map(|s| s.parse()).collect();
        let assigned = assigned.map_err(Fault::Value)?;
        if dbc.is_none() && !assigned.is_empty() {
            return Err(Fault::Value("signals: they are those of a dbc, and there is none".into()));
        }
        let map = map.as_deref().map(|m| Map::load(m, start_s_m, &projection));
        let map = map.transpose().map_err(|e| of_drives(&e))?;
        let dbc = dbc.as_deref().map(|file| Dbc::read(file, &assigned));
        let dbc = dbc.transpose().map_err(|e| of_drives(&e))?;
        let logs: Vec<LogFile<'_>> = logs
            .iter()
            .zip(&named)
            .zip(&masses_kg)
            .map(|((path, named), mass_kg)| LogFile { path, named, mass_kg: *mass_kg })
            .collect();
        if let Some(missing) = logs.iter().find(|log| !log.path.exists()) {
            return Err(Fault::NotFound(format!("{}: no such file", missing.named.display())));
        }
        let job = Job {
            truck: &parameters,
            truck_name: truck,
            logs: &logs,
            map: map.as_ref(),
            dbc: dbc.as_ref(),
            standstill_s,
            least_s: min_drive_s,
        };
        let made = job.run().map_err(|e| of_drives(&e))?;
        let io = |path: &Path, e: std::io::Error| Fault::Io(format!("{}: {e}", path.display()));
        std::fs::create_dir_all(&out).map_err(|e| io(&out, e))?;
        made.write(&mut |name, text| {
            let file = out.join(name);
            std::fs::write(&file, text).map_err(|e| Written(io(&file, e)))
        })
        .map_err(|e| e.0)?;
        let content = Content { provenance: provenance(0), report: &made.report };
        let text =
            serde_json::to_string_pretty(&content).map_err(|e| Fault::Work(e.to_string()))?;
        let file = out.join("conversion.json");
        std::fs::write(&file, &text).map_err(|e| io(&file, e))?;
        Ok(text)
    })
}

/// What writing a folder fails with.
struct Written(Fault);

impl From<DiagnosisError> for Written {
    fn from(error: DiagnosisError) -> Self {
        Self(of_drives(&error))
    }
}

/// The projection of a map.
fn projection(reference: &GeoReference) -> Result<Project, String> {
    let projection = MapProjection::new(reference).map_err(|e| e.to_string())?;
    Ok(Box::new(move |latitude_deg, longitude_deg| {
        projection.to_map_m(latitude_deg, longitude_deg)
    }))
}
