//! Roads from CSV profiles: `s_m,z_m[,x_m,y_m,curvature_1_m,speed_limit_m_s]`.

use std::fs;

use crate::bake::Baker;
use crate::road::parallel_lanes;
use crate::smooth::{LocalFit, local_quadratic};
use crate::{Cubics, Jet, Line, Road, RoadError};

/// More rows than this are refused.
const MAX_ROWS: usize = 2_000_000;
/// Larger files are refused.
const MAX_BYTES: u64 = 256 << 20;
const LANE_WIDTH_M: f64 = 3.75;
/// Half width of the window that smooths heights, m.
const HEIGHT_WINDOW_M: f64 = 25.0;
/// Half width of the window that smooths x and y, m.
const PLAN_WINDOW_M: f64 = 60.0;
/// Points nearer to each other than this have no direction, m.
const LEAST_CHORD_M: f64 = 4.0;
/// Limit where the file has none: 90 km/h.
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

/// Reads a profile. Heights are smoothed so that the slope is continuous; the plan view comes from
/// x and y, smoothed likewise, else from the curvature column (starting at the origin along x),
/// else it is straight. Two lanes of 3.75 m, the reference line between them.
pub(crate) fn read(path: &str) -> Result<Road, RoadError> {
    let io = |why: String| RoadError::Io { path: path.into(), why };
    let bytes = fs::metadata(path).map_err(|e| io(e.to_string()))?.len();
    if bytes > MAX_BYTES {
        return Err(io(format!("{bytes} bytes, at most {MAX_BYTES} are read")));
    }
    let text = fs::read_to_string(path).map_err(|e| io(e.to_string()))?;
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
    let heights = local_quadratic(&s, z, HEIGHT_WINDOW_M);
    if let Some((f, s)) = heights.iter().zip(&s).find(|(f, _)| !(f.slope.abs() <= 0.35)) {
        return Err(invalid(format!("slope {} at s_m = {s} is not a road", f.slope)));
    }
    let knots: Vec<_> = s.iter().zip(&heights).map(|(&s, f)| (s, f.value, f.slope)).collect();
    let elevation = Cubics::hermite(&knots);
    let length_m = s[s.len() - 1];
    let line = if !x.is_empty() && !y.is_empty() {
        plan_through(path, &s, x, y, elevation)?
    } else {
        let k = |i: usize| kappa.get(i).copied().unwrap_or(0.0);
        let points: Vec<_> = s.iter().enumerate().map(|(i, &s)| (s, k(i))).collect();
        if let Some((s, k)) = points.iter().find(|p| p.1.abs() > MAX_CURVATURE_1_M) {
            return Err(invalid(tight(*k, *s)));
        }
        Line::from_curvature(0.0, &points, elevation, Cubics::default())
    };
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

/// Tighter curves than R = 20 m are taken for a mistake.
const MAX_CURVATURE_1_M: f64 = 0.05;

fn tight(curvature_1_m: f64, s_m: f64) -> String {
    format!("curvature {curvature_1_m} 1/m at s_m = {s_m} is tighter than R = 20 m")
}

/// The plan view through smoothed points, with continuous heading and curvature. Where x and y do
/// not move as `s_m` does (by more than 10 %: gaps, doubled points), stations and heights are kept
/// and the plan view follows the headings instead.
fn plan_through(
    path: &str,
    s: &[f64],
    x: &[f64],
    y: &[f64],
    elevation: Cubics,
) -> Result<Line, RoadError> {
    let (fx, fy) = (local_quadratic(s, x, PLAN_WINDOW_M), local_quadratic(s, y, PLAN_WINDOW_M));
    let jet = |(u, v): (&LocalFit, &LocalFit)| Jet {
        point: [u.value, v.value],
        first: [u.slope, v.slope],
        second: [u.bend, v.bend],
    };
    let jets: Vec<Jet> = fx.iter().zip(&fy).map(jet).collect();
    let speed = |j: &Jet| libm::hypot(j.first[0], j.first[1]);
    if !jets.iter().all(|j| speed(j) > 0.9 && speed(j) < 1.1) {
        return plan_by_headings(path, s, x, y, elevation);
    }
    let mut baker = Baker::default();
    for (i, jet) in jets.iter().enumerate() {
        if !(jet.curvature_1_m().abs() <= MAX_CURVATURE_1_M) {
            let why = tight(jet.curvature_1_m(), s[i]);
            return Err(RoadError::Invalid { name: path.into(), why });
        }
        if let Some(next) = jets.get(i + 1) {
            baker.push_between(s[i + 1] - s[i], jet, next);
        }
    }
    Ok(baker.finish(elevation, Cubics::default()))
}

/// Headings of the chords between points that lie apart, smoothed over station; their slope is the
/// curvature.
fn plan_by_headings(
    path: &str,
    s: &[f64],
    x: &[f64],
    y: &[f64],
    elevation: Cubics,
) -> Result<Line, RoadError> {
    let invalid = |why: String| RoadError::Invalid { name: path.into(), why };
    let (mut at, mut headings): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut from = 0;
    for i in 1..s.len() {
        let (dx, dy) = (x[i] - x[from], y[i] - y[from]);
        if libm::hypot(dx, dy) < LEAST_CHORD_M {
            continue;
        }
        let heading = libm::atan2(dy, dx);
        let before = headings.last().copied().unwrap_or(heading);
        at.push(0.5 * (s[from] + s[i]));
        headings.push(before + libm::remainder(heading - before, core::f64::consts::TAU));
        from = i;
    }
    if at.len() < 3 {
        return Err(invalid("x_m and y_m do not move along s_m".into()));
    }
    let smooth = local_quadratic(&at, &headings, PLAN_WINDOW_M);
    let mut curvature: Vec<(f64, f64)> =
        at.iter().zip(&smooth).map(|(&s, f)| (s, f.slope)).collect();
    if let Some((s, k)) = curvature.iter().find(|p| !(p.1.abs() <= MAX_CURVATURE_1_M)) {
        return Err(invalid(tight(*k, *s)));
    }
    let (first, last) = (curvature[0], curvature[curvature.len() - 1]);
    curvature.insert(0, (0.0, first.1));
    curvature.push((s[s.len() - 1], last.1));
    let heading = smooth[0].value - first.1 * first.0;
    Ok(Line::from_pose([x[0], y[0]], heading, &curvature, elevation, Cubics::default()))
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
