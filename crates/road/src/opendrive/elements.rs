//! A baked reference line back into OpenDRIVE elements.
//!
//! Cells whose curvature is linear are merged into lines, arcs and spirals; others become
//! paramPoly3 over arc length, split until they are within a tenth of a micrometre.

use crate::{Jet, Line, Placed, Shape};

/// Largest distance between an element and the line, m.
const TOLERANCE_M: f64 = 1e-7;
const SHORTEST_M: f64 = 0.05;

/// Elements that follow the line.
pub(super) fn elements(line: &Line) -> Vec<Placed> {
    let mut out: Vec<Placed> = Vec::new();
    for (a, b, start, end) in line.cells_with_jets() {
        let merged = out.last().and_then(|last| extended(line, last, b, &end));
        if let (Some(merged), Some(last)) = (merged, out.last_mut()) {
            *last = merged;
            continue;
        }
        let shape = spiral(start.curvature_1_m(), end.curvature_1_m());
        let placed = placed(a, &start, b - a, shape);
        if fits(line, &placed) {
            out.push(placed);
        } else {
            cubic(line, a, b, &start, &end, &mut out);
        }
    }
    out
}

fn placed(s_m: f64, jet: &Jet, length_m: f64, shape: Shape) -> Placed {
    let [x_m, y_m] = jet.point;
    Placed { s_m, x_m, y_m, heading_rad: jet.heading_rad(), length_m, shape }
}

fn spiral(start_1_m: f64, end_1_m: f64) -> Shape {
    if start_1_m.abs() < 1e-12 && end_1_m.abs() < 1e-12 {
        Shape::Line
    } else if (start_1_m - end_1_m).abs() < 1e-12 {
        Shape::Arc { curvature_1_m: start_1_m }
    } else {
        Shape::Spiral { start_1_m, end_1_m }
    }
}

/// The element drawn out to a later station, if the line follows it there.
fn extended(line: &Line, last: &Placed, to_m: f64, end: &Jet) -> Option<Placed> {
    let start_1_m = match last.shape {
        Shape::Line => 0.0,
        Shape::Arc { curvature_1_m } => curvature_1_m,
        Shape::Spiral { start_1_m, .. } => start_1_m,
        Shape::Poly3 { .. } | Shape::ParamPoly3 { .. } => return None,
    };
    let shape = spiral(start_1_m, end.curvature_1_m());
    let longer = Placed { length_m: to_m - last.s_m, shape, ..*last };
    fits(line, &longer).then_some(longer)
}

fn fits(line: &Line, e: &Placed) -> bool {
    [0.2, 0.5, 0.8, 1.0].into_iter().all(|f| {
        let ds = f * e.length_m;
        let k = line.at_in(e.s_m + ds, (e.s_m + ds - 1e-9).max(e.s_m));
        let jet = e.at(ds);
        let [x, y] = jet.point;
        let rounding = 1e-15 * (x.abs() + y.abs());
        libm::hypot(x - k.x_m, y - k.y_m) < TOLERANCE_M + rounding
            && (jet.curvature_1_m() - k.curvature_1_m).abs() < 1e-8
    })
}

/// The cubic in the start's axes that meets both ends with their directions.
fn cubic(line: &Line, a: f64, b: f64, start: &Jet, end: &Jet, out: &mut Vec<Placed>) {
    let h = b - a;
    let (sin, cos) = libm::sincos(start.heading_rad());
    let turn = |[x, y]: [f64; 2]| [cos * x + sin * y, cos * y - sin * x];
    let p = turn([end.point[0] - start.point[0], end.point[1] - start.point[1]]);
    let (m0, m1) = (turn(start.first), turn(end.first));
    let axis = |k: usize| {
        let chord = p[k] / h;
        [
            0.0,
            m0[k],
            (3.0 * chord - 2.0 * m0[k] - m1[k]) / h,
            (m0[k] + m1[k] - 2.0 * chord) / (h * h),
        ]
    };
    let shape = Shape::ParamPoly3 { u: axis(0), v: axis(1), normalized: false };
    let e = placed(a, start, h, shape);
    let mid = 0.5 * (a + b);
    let k = line.at_in(mid, mid);
    let [x, y] = e.at(0.5 * h).point;
    if libm::hypot(x - k.x_m, y - k.y_m) > TOLERANCE_M && h > SHORTEST_M {
        let jet = line.jet_in(mid, mid);
        cubic(line, a, mid, start, &jet, out);
        cubic(line, mid, b, &jet, end, out);
    } else {
        out.push(e);
    }
}
