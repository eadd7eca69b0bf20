//! The report of a road that is one carriageway: a CSV profile or a built-in road.

use road::{Finding, LaneKind, Road};
use serde::Serialize;

use crate::provenance::Provenance;

/// What is in a road.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    #[serde(flatten)]
    provenance: Provenance,
    road: String,
    length_m: f64,
    lanes: Vec<Lane>,
    grade_frac: Range,
    bank_rad: Range,
    curvature_1_m: Range,
    height_m: Range,
    /// Sum of all rises, m.
    climb_m: f64,
    speed_limit_m_s: Range,
    objects: usize,
    /// Values that no highway has.
    findings: Vec<Finding>,
    jumps: Vec<Jump>,
}

/// One lane track.
#[derive(Debug, Serialize)]
struct Lane {
    id: u16,
    kind: &'static str,
    s_start_m: f64,
    s_end_m: f64,
    width_m: Range,
}

/// Smallest and largest value.
#[derive(Debug, Clone, Copy, Serialize)]
struct Range {
    min: f64,
    max: f64,
}

impl Range {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        values.fold(Self { min: f64::INFINITY, max: f64::NEG_INFINITY }, |r, v| Self {
            min: r.min.min(v),
            max: r.max.max(v),
        })
    }
}

/// A step where two elements meet.
#[derive(Debug, Serialize)]
struct Jump {
    s_m: f64,
    gap_m: f64,
    height_m: f64,
    heading_rad: f64,
    grade_frac: f64,
}

/// Distance between two samples, m.
const STEP_M: f64 = 1.0;
/// Steps below these are rounding of the file: position and height m, heading rad, grade.
const TOLERANCE: [f64; 3] = [1e-3, 1e-4, 1e-3];

/// Samples the road.
pub(super) fn inspect(name: &str, road: &Road) -> Report {
    let count = (road.length_m() / STEP_M).floor().max(0.0) as usize;
    let points: Vec<_> = (0..=count).map(|i| road.at(i as f64 * STEP_M, 0.0)).collect();
    let height = |i: usize| points[i].z_m;
    let lanes = road.lanes().iter().map(|lane| Lane {
        id: lane.id,
        kind: match lane.kind {
            LaneKind::Driving => "driving",
            LaneKind::Entry => "entry",
            LaneKind::Exit => "exit",
            LaneKind::Shoulder => "shoulder",
        },
        s_start_m: lane.s_start_m,
        s_end_m: lane.s_end_m,
        width_m: Range::of((0..=100).map(|i| {
            lane.width_m(lane.s_start_m + (lane.s_end_m - lane.s_start_m) * f64::from(i) * 0.01)
        })),
    });
    Report {
        provenance: Provenance::of_seed(0),
        road: name.to_owned(),
        length_m: road.length_m(),
        lanes: lanes.collect(),
        grade_frac: Range::of(points.iter().map(|p| p.grade_rad.tan())),
        bank_rad: Range::of(points.iter().map(|p| p.bank_rad)),
        curvature_1_m: Range::of(points.iter().map(|p| p.curvature_1_m)),
        height_m: Range::of(points.iter().map(|p| p.z_m)),
        climb_m: (1..points.len()).map(|i| (height(i) - height(i - 1)).max(0.0)).sum(),
        speed_limit_m_s: Range::of(road.speed_limits().iter().map(|l| l.1)),
        objects: road.objects().len(),
        findings: road.findings(),
        jumps: jumps(road),
    }
}

/// Steps of the reference line where its elements meet.
fn jumps(road: &Road) -> Vec<Jump> {
    const ASIDE_M: f64 = 1e-6;
    let joints = road.line().joints_m().filter(|s| *s > ASIDE_M && *s < road.length_m() - ASIDE_M);
    joints
        .map(|s_m| {
            let (a, b) = (road.at(s_m - ASIDE_M, 0.0), road.at(s_m + ASIDE_M, 0.0));
            Jump {
                s_m,
                gap_m: (b.x_m - a.x_m).hypot(b.y_m - a.y_m),
                height_m: (b.z_m - a.z_m).abs(),
                heading_rad: (b.heading_rad - a.heading_rad).abs(),
                grade_frac: (b.grade_rad.tan() - a.grade_rad.tan()).abs(),
            }
        })
        .filter(|j| {
            let [length, heading, grade] = TOLERANCE;
            j.gap_m > length
                || j.height_m > length
                || j.heading_rad > heading
                || j.grade_frac > grade
        })
        .collect()
}

/// The report as lines.
pub(super) fn text(r: &Report) -> String {
    let mut lines = vec![
        format!("{}: {:.1} m, {} objects", r.road, r.length_m, r.objects),
        format!(
            "grade {:+.2} to {:+.2} %, height {:.1} to {:.1} m, climb {:.1} m",
            100.0 * r.grade_frac.min,
            100.0 * r.grade_frac.max,
            r.height_m.min,
            r.height_m.max,
            r.climb_m
        ),
        format!(
            "curvature {:+.5} to {:+.5} 1/m, bank {:+.3} to {:+.3} rad, limits {:.1} to {:.1} m/s",
            r.curvature_1_m.min,
            r.curvature_1_m.max,
            r.bank_rad.min,
            r.bank_rad.max,
            r.speed_limit_m_s.min,
            r.speed_limit_m_s.max
        ),
    ];
    lines.extend(r.lanes.iter().map(|l| {
        format!(
            "lane {:2} {:8} {:9.1} to {:9.1} m, {:.2} to {:.2} m wide",
            l.id, l.kind, l.s_start_m, l.s_end_m, l.width_m.min, l.width_m.max
        )
    }));
    lines.extend(super::finding_lines(&r.findings));
    lines.push(format!("{} jumps", r.jumps.len()));
    lines.extend(r.jumps.iter().map(|j| {
        format!(
            "jump at {:.2} m: {:.4} m sideways, {:.4} m in height, {:.5} rad, {:.4} in grade",
            j.s_m, j.gap_m, j.height_m, j.heading_rad, j.grade_frac
        )
    }));
    lines.join("\n")
}
