//! Reads a folder of measured drives: `drives.toml` and one table per drive.

mod clean;
mod csv_table;
mod grid;
mod parquet_table;
mod stuck;
mod units;

use std::path::Path;

use crate::data::drive::RoadMap;
use crate::data::index::{Entry, INDEX, Index};
use crate::{DiagnosisError, Drive, DriveSet, Executor, Finding, Serial, Trace, collect};

/// Standard deviations that the index may name for the readings of a coast-down, s and m/s.
const MOST_SIGMA: core::ops::RangeInclusive<f64> = 1e-3..=5.0;

/// Columns of one file by name, as written, `NaN` where a value is missing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawTable {
    /// Name and samples of each column.
    pub columns: Vec<(String, Vec<f64>)>,
}

impl RawTable {
    /// Samples of a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.0 == name).map(|c| c.1.as_slice())
    }
}

/// Reads a folder of traces of any length for [`crate::whole_run`]: the tables that its
/// `drives.toml` names, or, without one, every CSV file, its mass taken from its name
/// (`accel_18t.csv`, `brake_m18000.csv`).
///
/// # Errors
/// A file that cannot be read or decoded, an index of another form, a trace without a mass.
pub fn read_traces(dir: &Path) -> Result<Vec<Trace>, DiagnosisError> {
    if dir.join(INDEX).is_file() {
        let entries = Index::read(dir)?.drive.into_iter();
        return entries.map(|e| trace(&dir.join(&e.file), e.name, e.reported_mass_kg)).collect();
    }
    let io = |e: std::io::Error| DiagnosisError::Io { path: dir.to_owned(), why: e.to_string() };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(io)? {
        let path = entry.map_err(io)?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(DiagnosisError::Io {
            path: dir.to_owned(),
            why: format!("no {INDEX} and no CSV file in it"),
        });
    }
    let stem = |p: &Path| p.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    files.iter().map(|f| trace(f, stem(f), mass_in_name_kg(&stem(f)))).collect()
}

fn trace(path: &Path, name: String, mass_kg: Option<f64>) -> Result<Trace, DiagnosisError> {
    let table = read_table(path)?;
    match mass_kg {
        Some(mass_kg) if PLAUSIBLE_MASS_KG.contains(&mass_kg) => Ok(Trace { name, mass_kg, table }),
        Some(kg) => Err(DiagnosisError::Table {
            path: path.to_owned(),
            why: format!("a mass of {kg} kg is no truck's"),
        }),
        None => Err(DiagnosisError::Table {
            path: path.to_owned(),
            why: "no mass: name it in the file's name (_18t, _m18000) or in drives.toml \
                  (reported_mass_kg)"
                .into(),
        }),
    }
}

/// Total masses that a load sheet may say, kg.
const PLAUSIBLE_MASS_KG: core::ops::RangeInclusive<f64> = 1000.0..=200_000.0;

/// `accel_pedal40_18t` or `brake_m18000`, kg.
fn mass_in_name_kg(stem: &str) -> Option<f64> {
    stem.split('_').find_map(|word| {
        let tonnes = word.strip_suffix('t').and_then(|t| t.parse::<f64>().ok());
        let kg = word.strip_prefix('m').and_then(|m| m.parse::<f64>().ok());
        tonnes.map(|t| 1e3 * t).or(kg)
    })
}

/// Reads `dir/drives.toml` and the tables that it names.
///
/// Defects that leave a drive usable are in [`DriveSet::findings`], with channel, time and what
/// was done about them.
///
/// # Errors
/// A file that cannot be read or decoded, an index of another form, a drive without usable
/// `time_s` or `speed_m_s`, with shuffled rows, or shorter than a minute.
pub fn read_drives(dir: &Path) -> Result<DriveSet, DiagnosisError> {
    read_drives_with(dir, &Serial)
}

/// The same, drives side by side on an executor; the result does not depend on it.
///
/// # Errors
/// As [`read_drives`]; of several drives that cannot be read the first in the index is named.
pub fn read_drives_with(dir: &Path, executor: &dyn Executor) -> Result<DriveSet, DiagnosisError> {
    let index = Index::read(dir)?;
    let bad = |why: String| DiagnosisError::Index { path: dir.join(INDEX), why };
    let mut set = DriveSet { truck: index.truck, drives: Vec::new(), findings: Vec::new() };
    for one in collect(executor, index.drive.len(), |i| read_drive(dir, &index.drive[i], &bad)) {
        let (drive, findings) = one?;
        set.drives.push(drive);
        set.findings.extend(findings);
    }
    Ok(set)
}

/// One drive of the index and what was found in it.
fn read_drive(
    dir: &Path,
    entry: &Entry,
    bad: &(dyn Fn(String) -> DiagnosisError + Sync),
) -> Result<(Drive, Vec<Finding>), DiagnosisError> {
    let mut findings = Vec::new();
    let path = dir.join(&entry.file);
    let table = read_table(&path)?;
    let mut drive = grid::to_grid(&entry.name, &path, &table, &mut findings)?;
    if let Some(m) = entry.reported_mass_kg {
        if !PLAUSIBLE_MASS_KG.contains(&m) {
            return Err(bad(format!("drive {}: reported_mass_kg = {m}", entry.name)));
        }
        drive.reported_mass_kg = Some(m);
    }
    drive.tyres_warm_at_start = entry.tyres_warm_at_start;
    for (key, sigma) in
        [("time_sigma_s", entry.time_sigma_s), ("speed_sigma_m_s", entry.speed_sigma_m_s)]
    {
        let Some(sigma) = sigma else { continue };
        let Some(readings) = &mut drive.coast_down else {
            let why = "is for a coast-down, and gear is not 0 from begin to end";
            return Err(bad(format!("drive {}: {key} {why}", entry.name)));
        };
        if !MOST_SIGMA.contains(&sigma) {
            return Err(bad(format!("drive {}: {key} = {sigma}", entry.name)));
        }
        let known = if key == "time_sigma_s" {
            &mut readings.time_sigma_s
        } else {
            &mut readings.speed_sigma_m_s
        };
        *known = sigma;
    }
    if let Some(map) = &entry.map {
        drive.map = Some(road_map(&dir.join(map))?);
        grid::fill_from_map(&mut drive);
    }
    crate::data::clock::check(&mut drive, &mut findings);
    Ok((drive, findings))
}

/// Reads one table, CSV if the name ends in `.csv`, else Parquet.
///
/// # Errors
/// [`DiagnosisError::Io`] or [`DiagnosisError::Table`].
pub fn read_table(path: &Path) -> Result<RawTable, DiagnosisError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv")) {
        csv_table::read(path)
    } else {
        parquet_table::read(path)
    }
}

fn road_map(path: &Path) -> Result<RoadMap, DiagnosisError> {
    let t = read_table(path)?;
    let bad = |why: String| DiagnosisError::Table { path: path.to_owned(), why };
    let need = |n: &str| {
        t.column(n).map(<[f64]>::to_vec).ok_or_else(|| bad(format!("column {n} is missing")))
    };
    let s_m = need("s_m")?;
    let grade_frac = need("grade_frac")?;
    let curvature_1_m =
        t.column("curvature_1_m").map_or_else(|| vec![0.0; s_m.len()], <[f64]>::to_vec);
    if s_m.len() < 2
        || s_m.windows(2).any(|w| w[1] <= w[0] || !w[0].is_finite() || !w[1].is_finite())
    {
        return Err(bad("s_m must increase and have two rows at least".into()));
    }
    if grade_frac.iter().chain(&curvature_1_m).any(|v| !v.is_finite()) {
        return Err(bad("a value is not finite".into()));
    }
    Ok(RoadMap { s_m, grade_frac, curvature_1_m })
}
