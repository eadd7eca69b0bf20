//! Built-in roads: a real hilly highway, a real sag, a synthetic test site, a flat straight.
//!
//! All begin at 50° N, 10° E and go east. The place is invented, so that there are satellite fixes:
//! none of the roads is there, not even those with the grades of real ones.

use alloc::{vec, vec::Vec};

use tractrix_core::GRAVITY_M_S2;

use crate::road::parallel_lanes;
use crate::{Cubics, GeoReference, LaneEnd, LaneKind, LaneTrack, Line, Road, RoadObject};

/// Grades of two stretches of real long-haul drives; origin and licence in the heads of the files.
const HILLS: &str = include_str!("../data/highway_hills.csv");
const SAG: &str = include_str!("../data/longhaul_hills.csv");

/// Transverse Mercator with the origin of the map as its own: x is east, y north.
const PROJECTION: &str =
    "+proj=tmerc +lat_0=50 +lon_0=10 +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m +no_defs";

const LANE_WIDTH_M: f64 = 3.75;
const LENGTH_M: f64 = 15_000.0;

/// 15 km of highway: real grades in waves of 1 to 3 km (-3.3 to +2.8 %, root mean square 1.5 %),
/// curves down to R = 600 m, two to three lanes, an on-ramp at 3 km and an off-ramp at 11 km.
///
/// The reference line is the right edge of the left through lane. Lanes: 0 right, 1 left, 2 a
/// climbing stretch's third lane on the left, 3 the on-ramp, 4 the off-ramp.
#[must_use]
pub fn highway() -> Road {
    highway_over("highway", HILLS)
}

/// The plan view and lanes of [`highway`] over a single real sag (-0.8 to +2.5 %): a road on which
/// looking ahead saves next to nothing.
#[must_use]
pub fn highway_sag() -> Road {
    highway_over("highway-sag", SAG)
}

fn highway_over(name: &str, grades_csv: &str) -> Road {
    let curves = plan_view(&HIGHWAY_CURVES);
    let line = Line::from_curvature(
        0.0,
        &curves,
        Cubics::integral_of_linear(0.0, &slopes(grades_csv)),
        bank(&curves),
    );
    let w = LANE_WIDTH_M;
    let lane = |id, from, to, kind, end, center: Cubics| LaneTrack {
        id,
        s_start_m: from,
        s_end_m: to,
        kind,
        end,
        center,
        width: Cubics::constant(w),
        speed_limits: Vec::new(),
        sources: Vec::new(),
    };
    let through =
        |id, d| lane(id, 0.0, LENGTH_M, LaneKind::Driving, LaneEnd::Continues, Cubics::constant(d));
    let lanes = vec![
        through(0, -0.5 * w),
        through(1, 0.5 * w),
        lane(2, 6_000.0, 8_500.0, LaneKind::Driving, LaneEnd::Drops, Cubics::constant(1.5 * w)),
        lane(
            3,
            2_700.0,
            3_350.0,
            LaneKind::Entry,
            LaneEnd::Drops,
            Cubics::smooth_steps(&[(2_700.0, -3.6 * w), (3_000.0, -1.5 * w), (3_350.0, -1.5 * w)]),
        ),
        lane(
            4,
            11_000.0,
            11_550.0,
            LaneKind::Exit,
            LaneEnd::Leaves,
            Cubics::smooth_steps(&[
                (11_000.0, -1.5 * w),
                (11_250.0, -1.5 * w),
                (11_550.0, -3.6 * w),
            ]),
        ),
    ];
    let limits = vec![(0.0, 25.0), (9_000.0, 22.22), (10_000.0, 25.0)];
    expect_valid(Road::new(name, line, lanes, limits))
}

/// 15 km with the statistics of the paper's site: grades to ±5 % with a standard deviation of
/// 2.8 %, 225 m of climb, R = 600 m curves, two lanes, one tunnel. The slope is a sum of sines with
/// fixed coefficients, limited to ±5 %.
#[must_use]
pub fn test_site() -> Road {
    let curves = plan_view(&SITE_CURVES);
    let wave = |s: f64, period_m: f64, phase: f64| {
        libm::sin(core::f64::consts::TAU * s / period_m + phase)
    };
    let slope = |s: f64| {
        let hills = 0.0325 * wave(s, 2_500.0, 0.3)
            + 0.017 * wave(s, 1_150.0, 1.9)
            + 0.008 * wave(s, 610.0, 4.0);
        (0.005 + 1.06 * hills).clamp(-0.05, 0.05)
    };
    let slopes: Vec<(f64, f64)> =
        (0..=750).map(|i| f64::from(i) * 20.0).map(|s| (s, slope(s))).collect();
    let line =
        Line::from_curvature(0.0, &curves, Cubics::integral_of_linear(0.0, &slopes), bank(&curves));
    let lanes = parallel_lanes(2, LANE_WIDTH_M, LENGTH_M);
    let tunnel = RoadObject {
        kind: "tunnel".into(),
        name: "test-site tunnel".into(),
        s_start_m: 8_600.0,
        s_end_m: 9_800.0,
    };
    expect_valid(Road::new("test-site", line, lanes, vec![(0.0, 25.0)])).with_objects(vec![tunnel])
}

/// Level, straight, two lanes, 25 m/s.
#[must_use]
pub fn flat(length_m: f64) -> Road {
    let length_m = if length_m.is_finite() { length_m.clamp(1.0, 1e7) } else { LENGTH_M };
    let line = Line::from_curvature(
        0.0,
        &[(0.0, 0.0), (length_m, 0.0)],
        Cubics::default(),
        Cubics::default(),
    );
    let lanes = parallel_lanes(2, LANE_WIDTH_M, length_m);
    expect_valid(Road::new("flat", line, lanes, vec![(0.0, 25.0)]))
}

/// Curves as (start of the entry clothoid m, clothoid m, arc m, curvature 1/m).
const HIGHWAY_CURVES: [(f64, f64, f64, f64); 9] = [
    (600.0, 150.0, 500.0, 1.0 / 1_500.0),
    (1_900.0, 150.0, 350.0, -1.0 / 900.0),
    (3_700.0, 200.0, 450.0, 1.0 / 1_200.0),
    (5_000.0, 150.0, 400.0, -1.0 / 750.0),
    (6_400.0, 200.0, 700.0, 1.0 / 2_000.0),
    (8_900.0, 160.0, 300.0, 1.0 / 600.0),
    (9_700.0, 160.0, 300.0, -1.0 / 600.0),
    (11_700.0, 200.0, 600.0, -1.0 / 1_500.0),
    (13_300.0, 150.0, 500.0, 1.0 / 800.0),
];

const SITE_CURVES: [(f64, f64, f64, f64); 6] = [
    (900.0, 150.0, 400.0, 1.0 / 800.0),
    (2_600.0, 150.0, 350.0, -1.0 / 600.0),
    (5_200.0, 200.0, 500.0, -1.0 / 1_200.0),
    (7_600.0, 150.0, 300.0, 1.0 / 600.0),
    (10_100.0, 200.0, 700.0, 1.0 / 1_500.0),
    (12_900.0, 150.0, 400.0, -1.0 / 700.0),
];

/// Curvature of a chain of clothoid-arc-clothoid curves between straights: (station m, 1/m).
fn plan_view(curves: &[(f64, f64, f64, f64)]) -> Vec<(f64, f64)> {
    let mut points = vec![(0.0, 0.0)];
    for &(s, clothoid, arc, kappa) in curves {
        points.extend([
            (s, 0.0),
            (s + clothoid, kappa),
            (s + clothoid + arc, kappa),
            (s + 2.0 * clothoid + arc, 0.0),
        ]);
    }
    points.push((LENGTH_M, 0.0));
    points
}

/// Bank that carries a third of the lateral acceleration at 80 km/h, at most 5 %, linear along the
/// clothoids; a left curve lifts the right side.
fn bank(curvature_1_m: &[(f64, f64)]) -> Cubics {
    let bank_rad = |k: f64| -(22.2 * 22.2 * k / (3.0 * GRAVITY_M_S2)).clamp(-0.05, 0.05);
    let points: Vec<_> = curvature_1_m.iter().map(|&(s, k)| (s, bank_rad(k))).collect();
    Cubics::linear(&points)
}

/// (station m, slope) of recorded grades.
fn slopes(grades_csv: &str) -> Vec<(f64, f64)> {
    grades_csv
        .lines()
        .filter_map(|line| line.split_once(','))
        .filter_map(|(s, g)| Some((s.parse().ok()?, g.parse().ok()?)))
        .collect()
}

#[expect(clippy::expect_used, reason = "built-in tables; the tests of this file build each")]
fn expect_valid(road: Result<Road, crate::RoadError>) -> Road {
    let geo = GeoReference { projection: PROJECTION.into(), ..GeoReference::default() };
    road.expect("built-in road").with_geo_reference(&geo)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_test_site_has_the_statistics_of_the_papers_site() {
        let road = test_site();
        let grades: Vec<f64> =
            (0..1_500).map(|i| road.line().at(f64::from(i) * 10.0).slope).collect();
        let n = grades.len() as f64;
        let mean = grades.iter().sum::<f64>() / n;
        let std = (grades.iter().map(|g| (g - mean) * (g - mean)).sum::<f64>() / n).sqrt();
        let climb: f64 = grades.iter().map(|g| g.max(0.0) * 10.0).sum();
        let steepest = grades.iter().fold(0.0_f64, |a, g| a.max(g.abs()));
        assert!((steepest - 0.05).abs() < 1e-3, "steepest {steepest}");
        assert!((std - 0.028).abs() < 0.001, "std {std}");
        assert!((climb - 225.0).abs() < 5.0, "climb {climb}");
    }

    #[test]
    fn the_highway_rolls_in_waves_and_the_sag_is_one() {
        // On one sag of 15 km nothing can be saved by looking ahead; the default road must have
        // hills of the length that a truck's momentum carries.
        let crests = |road: &Road| {
            let slope = |i: u32| road.line().at(f64::from(i) * 50.0).slope;
            (1..300).filter(|&i| slope(i - 1) > 0.0 && slope(i) <= 0.0).count()
        };
        let (hills, sag) = (highway(), highway_sag());
        assert!(crests(&hills) >= 4, "{}", crests(&hills));
        assert!(crests(&sag) <= 1, "{}", crests(&sag));
        let slopes: Vec<f64> =
            (0..=1_500).map(|i| hills.line().at(f64::from(i) * 10.0).slope).collect();
        let rms = (slopes.iter().map(|g| g * g).sum::<f64>() / slopes.len() as f64).sqrt();
        let steepest = slopes.iter().fold([0.0_f64; 2], |a, &g| [a[0].min(g), a[1].max(g)]);
        assert!((rms - 0.015).abs() < 5e-4, "rms {rms}");
        assert!((steepest[0] + 0.033).abs() < 5e-4 && (steepest[1] - 0.028).abs() < 5e-4);
        let climbed = hills.at(15_000.0, 0.0).z_m - hills.at(0.0, 0.0).z_m;
        assert!((climbed - 9.8).abs() < 0.1, "{climbed}");
        assert_eq!(hills.lanes(), sag.lanes());
    }

    #[test]
    fn the_highway_is_15_km_with_curves_down_to_600_m() {
        let road = highway();
        assert_eq!(road.length_m(), 15_000.0);
        let tightest = (0..15_000)
            .map(|i| road.line().at(f64::from(i)).curvature_1_m.abs())
            .fold(0.0, f64::max);
        assert!((tightest - 1.0 / 600.0).abs() < 1e-9);
        assert_eq!(road.lanes_at(7_000.0).count(), 3);
        assert_eq!(road.left_of(0, 100.0), Some(1));
        assert_eq!(road.left_of(1, 100.0), None);
        assert_eq!(road.left_of(3, 3_100.0), Some(0));
    }

    #[test]
    fn projection_inverts_the_map() {
        let road = highway();
        for i in 0..300 {
            let (s, d) = (37.0 + 49.7 * f64::from(i), -4.0 + 0.03 * f64::from(i));
            let p = road.at(s, d);
            for hint in [Some(s + 3.0), None] {
                let back = road.project(p.x_m, p.y_m, hint).unwrap();
                assert!((back.s_m - s).abs() < 1e-6 && (back.d_m - d).abs() < 1e-6, "{s} {d}");
            }
        }
    }
}
