//! Where on a map a drive was: satellite fixes on the road and the wheels between them, or the wheels
//! alone from a place that somebody states.

/// Fixes on both sides that say together how far the wheels are off.
const EACH_SIDE: usize = 15;
/// Fewest fixes on the road, and their least share, for a drive on this map.
const LEAST_FIXES: usize = 5;
const LEAST_ON_ROAD_FRAC: f64 = 0.8;

/// Where a fix, latitude and longitude in deg, is on the road, m; `None`: off it. The last argument
/// is where the truck was before.
pub type Locate<'a> = &'a dyn Fn(f64, f64, Option<f64>) -> Option<f64>;

/// How the place on a road is told.
#[derive(Clone, Copy)]
pub enum OnRoad<'a> {
    /// By satellite fixes.
    Fixes(Locate<'a>),
    /// By the wheels: the log's first drive begins at a station, the next where the last one ended.
    From {
        /// Station of the first drive's first row, m.
        start_m: f64,
        /// Length of the road, m.
        length_m: f64,
    },
}

/// Stations of rows by the wheels, m. An error of the speed adds up: 1 % is 10 m after a kilometre.
///
/// # Errors
/// The drive is longer than what is left of the road.
pub(super) fn by_wheels_m(way_m: &[f64], start_m: f64, length_m: f64) -> Result<Vec<f64>, String> {
    let end_m = start_m + way_m.last().copied().unwrap_or(0.0);
    if end_m > length_m {
        return Err(format!(
            "from {start_m:.0} m the wheels come to {end_m:.0} m, the road ends at {length_m:.0} m"
        ));
    }
    Ok(way_m.iter().map(|way| start_m + way).collect())
}

/// Stations of rows, m. `way_m` is what the wheels count at the rows; `fixes` are row number,
/// latitude and longitude, deg.
///
/// # Errors
/// Why the drive cannot be laid on the map.
pub(super) fn stations_m(
    way_m: &[f64],
    fixes: &[(usize, f64, f64)],
    locate: Locate<'_>,
) -> Result<Vec<f64>, String> {
    let mut found = Vec::new();
    let mut before_m = None;
    for &(row, latitude_deg, longitude_deg) in fixes {
        if let (Some(s_m), Some(way)) =
            (locate(latitude_deg, longitude_deg, before_m), way_m.get(row))
        {
            before_m = Some(s_m);
            found.push((row, s_m - way));
        }
    }
    if fixes.len() < LEAST_FIXES {
        return Err(format!("{} satellite fixes (VP1)", fixes.len()));
    }
    if (found.len() as f64) < LEAST_ON_ROAD_FRAC * fixes.len() as f64 {
        let off = fixes.len() - found.len();
        return Err(format!("{off} of {} satellite fixes are not on this road", fixes.len()));
    }
    // the median of neighbours: one wild fix moves nothing
    let offsets: Vec<(usize, f64)> = (0..found.len())
        .filter_map(|k| {
            let from = k.saturating_sub(EACH_SIDE);
            let near = found.get(from..(k + EACH_SIDE + 1).min(found.len()))?;
            let mut values: Vec<f64> = near.iter().map(|f| f.1).collect();
            values.sort_by(f64::total_cmp);
            Some((found.get(k)?.0, *values.get(values.len() / 2)?))
        })
        .collect();
    Ok(way_m.iter().enumerate().map(|(row, way)| way + between(&offsets, row)).collect())
}

/// Linear between known rows, constant beyond them.
fn between(known: &[(usize, f64)], row: usize) -> f64 {
    let after = known.partition_point(|k| k.0 <= row);
    match (after.checked_sub(1).and_then(|k| known.get(k)), known.get(after)) {
        (Some(a), Some(b)) => {
            let f = (row - a.0) as f64 / (b.0 - a.0) as f64;
            a.1 + f * (b.1 - a.1)
        }
        (Some(only), None) | (None, Some(only)) => only.1,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_that_count_too_much_are_put_right_by_fixes_and_a_wild_fix_is_not_believed() {
        let truth: Vec<f64> = (0..2000).map(|k| 500.0 + 2.0 * k as f64).collect();
        let way: Vec<f64> = truth.iter().map(|s| 1.01 * (s - 500.0)).collect();
        let mut fixes: Vec<(usize, f64, f64)> =
            (0..2000).step_by(10).map(|k| (k, truth[k], 0.0)).collect();
        fixes[100].1 += 300.0;
        let found = stations_m(&way, &fixes, &|s, _, _| Some(s)).unwrap();
        let worst = found
            .iter()
            .zip(&truth)
            .skip(200)
            .take(1600)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(worst < 1.0, "{worst}");
    }

    #[test]
    fn wheels_count_from_a_stated_start_to_the_end_of_the_road() {
        let way = [0.0, 1.0, 2.5];
        assert_eq!(by_wheels_m(&way, 500.0, 502.5).unwrap(), [500.0, 501.0, 502.5]);
        let why = by_wheels_m(&way, 500.0, 502.0).unwrap_err();
        assert!(why.contains("ends at 502 m"), "{why}");
    }

    #[test]
    fn a_drive_on_another_road_is_not_laid_on_the_map() {
        let fixes: Vec<(usize, f64, f64)> = (0..100).map(|k| (k, 1.0, 1.0)).collect();
        let why = stations_m(&[0.0; 100], &fixes, &|_, _, _| None).unwrap_err();
        assert!(why.contains("not on this road"), "{why}");
        assert!(stations_m(&[0.0; 100], &[], &|_, _, _| None).is_err());
    }
}
