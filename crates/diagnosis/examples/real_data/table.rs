//! Tables of the data sets: comma-separated, gzipped or Parquet, with times of day.

use std::path::{Path, PathBuf};

use diagnosis::{RawTable, read_table};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Files of a folder whose name ends so, sorted; the file itself if `path` is one.
pub(crate) fn files(path: &Path, ends: &[&str]) -> Outcome<Vec<PathBuf>> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path)? {
        let file = entry?.path();
        if file.file_name().is_some_and(|n| ends.iter().any(|e| n.to_string_lossy().ends_with(e))) {
            found.push(file);
        }
    }
    found.sort();
    if found.is_empty() {
        return Err(format!("{}: no file ends in {}", path.display(), ends.join(" or ")).into());
    }
    Ok(found)
}

/// Name of a file without folder and endings.
pub(crate) fn stem(path: &Path) -> String {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    name.split('.').next().unwrap_or_default().to_owned()
}

/// Reads a table; times of day become seconds, what is no number becomes NaN.
pub(crate) fn read(path: &Path) -> Outcome<RawTable> {
    let name = path.to_string_lossy().into_owned();
    if name.ends_with(".parquet") {
        return Ok(read_table(path)?);
    }
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(|e| format!("{name}: {e}"))?;
    let read: Box<dyn std::io::Read> = if name.ends_with(".gz") {
        Box::new(flate2::read::GzDecoder::new(file))
    } else {
        Box::new(file)
    };
    std::io::Read::read_to_string(&mut std::io::BufReader::new(read), &mut text)
        .map_err(|e| format!("{name}: {e}"))?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let mut columns: Vec<(String, Vec<f64>)> =
        reader.headers()?.iter().map(|h| (h.to_owned(), Vec::new())).collect();
    for record in reader.records() {
        for (field, column) in record?.iter().zip(&mut columns) {
            column.1.push(number(field));
        }
    }
    Ok(RawTable { columns })
}

/// A number or a time of day, s; NaN for anything else.
pub(crate) fn number(field: &str) -> f64 {
    let parts: Vec<f64> = field.split(':').filter_map(|p| p.parse().ok()).collect();
    match parts.as_slice() {
        [h, m, s] => 3600.0 * h + 60.0 * m + s,
        [v] => *v,
        _ => f64::NAN,
    }
}

/// A column that must be there.
pub(crate) fn column<'a>(table: &'a RawTable, path: &Path, name: &str) -> Outcome<&'a [f64]> {
    table.column(name).ok_or_else(|| format!("{}: no column {name}", path.display()).into())
}

/// Value of samples at a time, linear between them, held beyond the ends.
pub(crate) fn at(time_s: &[f64], value: &[f64], t: f64) -> f64 {
    let i = time_s.partition_point(|x| *x <= t);
    match (i.checked_sub(1), value.get(i)) {
        (None, first) => first.copied().unwrap_or(f64::NAN),
        (Some(k), None) => value[k],
        (Some(k), Some(next)) => {
            let part = (t - time_s[k]) / (time_s[i] - time_s[k]).max(1e-9);
            value[k] + part.clamp(0.0, 1.0) * (next - value[k])
        }
    }
}
