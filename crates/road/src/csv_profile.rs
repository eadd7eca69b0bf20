//! Roads from CSV profiles: `s_m,z_m[,x_m,y_m,curvature_1_m,speed_limit_m_s]`.

use std::fs;

use tractrix_core::Curve;

use crate::road::parallel_lanes;
use crate::{Line, Road, RoadError};

/// More rows than this are refused.
const MAX_ROWS: usize = 2_000_000;
const LANE_WIDTH_M: f64 = 3.75;
const DEFAULT_LIMIT_M_S: f64 = 25.0;

/// Column names and what they are also called in the field's files.
const COLUMNS: [(&str, &[&str]); 6] = [
    ("s_m", &[]),
    ("z_m", &["elevation_m", "altitude_m"]),
    ("x_m", &["utm50n_east_m", "east_m", "easting_m"]),
    ("y_m", &["utm50n_north_m", "north_m", "northing_m"]),
    ("curvature_1_m", &[]),
    ("speed_limit_m_s", &[]),
];

/// Reads a profile. Heights are made into a slope that is continuous (central differences of the
/// samples, linear between them); the plan view comes from the curvature column, else from x and
/// y, else it is straight.
pub(crate) fn read(path: &str) -> Result<Road, RoadError> {
    let text = fs::read_to_string(path)
        .map_err(|e| RoadError::Io { path: path.into(), why: e.to_string() })?;
    parse(path, &text)
}

pub(crate) fn parse(path: &str, text: &str) -> Result<Road, RoadError> {
    let at = |line: u64, why: String| RoadError::Table { path: path.into(), line, why };
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let header = reader.headers().map_err(|e| at(1, e.to_string()))?.clone();
    let column = |want: usize| {
        let (name, aliases) = COLUMNS[want];
        header.iter().position(|h| h == name || aliases.contains(&h))
    };
    let index: Vec<Option<usize>> = (0..COLUMNS.len()).map(column).collect();
    for required in 0..2 {
        if index[required].is_none() {
            return Err(at(1, format!("column {} is missing", COLUMNS[required].0)));
        }
    }
    let mut table: Vec<Vec<f64>> = vec![Vec::new(); COLUMNS.len()];
    for record in reader.records() {
        let record =
            record.map_err(|e| at(e.position().map_or(0, csv::Position::line), e.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        for (c, index) in index.iter().enumerate() {
            let Some(i) = *index else { continue };
            let cell = record.get(i).unwrap_or("");
            let value = cell.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                at(line, format!("{} = {cell:?} is not a finite number", COLUMNS[c].0))
            })?;
            table[c].push(value);
        }
        if table[0].len() > MAX_ROWS {
            return Err(at(line, format!("more than {MAX_ROWS} rows")));
        }
    }
    build(path, &table)
}

fn build(path: &str, table: &[Vec<f64>]) -> Result<Road, RoadError> {
    let invalid = |why: String| RoadError::Invalid { name: path.into(), why };
    let [s, z, x, y, kappa, limit] = table else {
        return Err(invalid("columns".into()));
    };
    if s.len() < 3 {
        return Err(invalid(format!("{} rows, at least 3 are needed", s.len())));
    }
    let s: Vec<f64> = s.iter().map(|v| v - s[0]).collect();
    if let Some(w) = s.windows(2).find(|w| w[1] <= w[0]) {
        return Err(invalid(format!("s_m must increase, but {} follows {}", w[1], w[0])));
    }
    let table_error = |e: tractrix_core::CoreError| invalid(e.to_string());
    let slope = Curve::new("z_m", s.clone(), central_slope(&s, z)).map_err(table_error)?;
    if let Some(i) = slope.y().iter().position(|g| g.abs() > 0.35) {
        return Err(invalid(format!("slope {} at s_m = {} is not a road", slope.y()[i], s[i])));
    }
    let curvature = if !kappa.is_empty() {
        kappa.clone()
    } else if !x.is_empty() && !y.is_empty() {
        curvature_of(&s, x, y)
    } else {
        vec![0.0; s.len()]
    };
    let curvature = Curve::new("curvature_1_m", s.clone(), curvature).map_err(table_error)?;
    if let Some(i) = curvature.y().iter().position(|k| k.abs() > 0.05) {
        return Err(invalid(format!(
            "curvature {} 1/m at s_m = {} is tighter than R = 20 m",
            curvature.y()[i],
            s[i]
        )));
    }
    let heading =
        if x.len() > 1 && y.len() > 1 { libm::atan2(y[1] - y[0], x[1] - x[0]) } else { 0.0 };
    let length_m = s[s.len() - 1];
    let line = Line::integrate(length_m, heading, |p| curvature.at(p), |p| slope.at(p), |_| 0.0);
    let mut limits: Vec<(f64, f64)> = Vec::new();
    for (&s, &v) in s.iter().zip(limit) {
        if limits.last().is_none_or(|l| l.1 != v) {
            limits.push((s, v));
        }
    }
    if limits.is_empty() {
        limits.push((0.0, DEFAULT_LIMIT_M_S));
    }
    Road::new(path, line, parallel_lanes(2, LANE_WIDTH_M, length_m), limits)
}

/// Central differences over the samples, one-sided at the ends.
fn central_slope(s: &[f64], z: &[f64]) -> Vec<f64> {
    let n = s.len();
    (0..n)
        .map(|i| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
            (z[b] - z[a]) / (s[b] - s[a])
        })
        .collect()
}

/// Curvature from headings of the chords, smoothed over at least 100 m, so that survey noise does
/// not become steering.
fn curvature_of(s: &[f64], x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = s.len();
    let reach = |i: usize, ahead: bool| {
        let mut j = i;
        while (s[j] - s[i]).abs() < 50.0 && (if ahead { j + 1 < n } else { j > 0 }) {
            j = if ahead { j + 1 } else { j - 1 };
        }
        j
    };
    (0..n)
        .map(|i| {
            let (a, b) = (reach(i, false), reach(i, true));
            if a == i || b == i {
                return 0.0;
            }
            let before = libm::atan2(y[i] - y[a], x[i] - x[a]);
            let after = libm::atan2(y[b] - y[i], x[b] - x[i]);
            let turn = libm::remainder(after - before, core::f64::consts::TAU);
            turn / (0.5 * (s[b] - s[a]))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_becomes_a_road_with_its_grades_and_limits() {
        let text =
            "# survey\ns_m,z_m,speed_limit_m_s\n0,100,25\n100,102,25\n200,104,20\n300,106,20\n";
        let road = parse("hill.csv", text).unwrap();
        assert_eq!(road.length_m(), 300.0);
        assert!((libm::tan(road.at(150.0, 0.0).grade_rad) - 0.02).abs() < 1e-12);
        assert_eq!(road.speed_limit_m_s(250.0), 20.0);
        assert_eq!(road.lanes().len(), 2);
    }

    #[test]
    fn a_bad_cell_is_named_with_line_and_column() {
        let e = parse("r.csv", "s_m,z_m\n0,1\n10,x\n20,1\n").unwrap_err().to_string();
        assert!(e.contains("line 3") && e.contains("z_m") && e.contains("\"x\""), "{e}");
        let e = parse("r.csv", "s_m,height\n0,1\n").unwrap_err().to_string();
        assert!(e.contains("z_m"), "{e}");
        let e = parse("r.csv", "s_m,z_m\n0,1\n10,1\n5,1\n").unwrap_err().to_string();
        assert!(e.contains("must increase"), "{e}");
    }

    #[test]
    fn x_and_y_of_a_circle_give_its_curvature() {
        let rows: String = (0..200)
            .map(|i| {
                let s = f64::from(i) * 10.0;
                let (sin, cos) = libm::sincos(s / 700.0);
                format!("{s},0,{},{}\n", 700.0 * sin, 700.0 * (1.0 - cos))
            })
            .collect();
        let road = parse("c.csv", &format!("s_m,z_m,x_m,y_m\n{rows}")).unwrap();
        assert!((road.at(1_000.0, 0.0).curvature_1_m - 1.0 / 700.0).abs() < 1e-5);
    }
}
