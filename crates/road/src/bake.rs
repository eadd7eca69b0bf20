//! Bakes exact plan curves into cells of quintics.
//!
//! A cell holds x and y in its own axes (origin at its start, first axis along its start heading),
//! fitted to position, first and second derivative of the exact curve at both ends, and split until
//! it meets the exact curve within [`BAKE_TOLERANCE_M`].

use alloc::vec::Vec;

use crate::{Cubics, Jet, Line, Placed, Shape};

/// Largest distance between the baked and the exact curve, m (plus rounding of large coordinates).
pub const BAKE_TOLERANCE_M: f64 = 1e-9;
const LONGEST_CELL_M: f64 = 25.0;
const SHORTEST_CELL_M: f64 = 0.02;
/// A curve that needs more cells than this is not followed more closely.
const MOST_CELLS: f64 = 4_000.0;

/// One piece of a baked line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    pub(crate) s_m: f64,
    pub(crate) length_m: f64,
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) heading_rad: f64,
    pub(crate) cos: f64,
    pub(crate) sin: f64,
    /// Coefficients of t..t⁵ along the start heading.
    u: [f64; 5],
    /// Coefficients of t..t⁵ to its left.
    v: [f64; 5],
    /// The cell is nowhere more curved than this, 1/m.
    pub(crate) curved_at_most_1_m: f64,
}

/// Nowhere between 0 and `h` is the derivative of `c[0] t + .. + c[4] t⁵` farther from `c[0]` than
/// this, nor the second derivative from zero than that.
fn bounds(c: &[f64; 5], h: f64) -> (f64, f64) {
    let [c1, c2, c3, c4] = [c[1], c[2], c[3], c[4]].map(libm::fabs);
    let off = h * (2.0 * c1 + h * (3.0 * c2 + h * (4.0 * c3 + h * 5.0 * c4)));
    (off, 2.0 * c1 + h * (6.0 * c2 + h * (12.0 * c3 + h * 20.0 * c4)))
}

/// A bound of the curvature `(u' v'' - v' u'')/|r'|³` over the cell, 1/m, by bounds of its terms;
/// infinite where they say nothing.
fn curved_at_most_1_m(u: &[f64; 5], v: &[f64; 5], h: f64) -> f64 {
    let ((off_u, second_u), (off_v, second_v)) = (bounds(u, h), bounds(v, h));
    let (first_u, first_v) = (libm::fabs(u[0]) + off_u, libm::fabs(v[0]) + off_v);
    let least = libm::fabs(u[0]) - off_u;
    if !(least > 0.5) {
        return f64::INFINITY;
    }
    // a little more than enough, for what rounding takes
    1.000_001 * (first_u * second_v + first_v * second_u) / (least * least * least)
}

impl Cell {
    /// Point and derivatives in the cell's axes, `t` metres from its start.
    pub(crate) fn local(&self, t: f64) -> Jet {
        let p = |c: &[f64; 5]| t * (c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * c[4]))));
        let p1 = |c: &[f64; 5]| {
            c[0] + t * (2.0 * c[1] + t * (3.0 * c[2] + t * (4.0 * c[3] + t * 5.0 * c[4])))
        };
        let p2 = |c: &[f64; 5]| 2.0 * c[1] + t * (6.0 * c[2] + t * (12.0 * c[3] + t * 20.0 * c[4]));
        Jet {
            point: [p(&self.u), p(&self.v)],
            first: [p1(&self.u), p1(&self.v)],
            second: [p2(&self.u), p2(&self.v)],
        }
    }

    /// Point and derivatives in map axes, `t` metres from the start.
    #[cfg(feature = "std")]
    pub(crate) fn jet(&self, t: f64) -> Jet {
        let local = self.local(t);
        let turn = |[u, v]: [f64; 2]| [self.cos * u - self.sin * v, self.sin * u + self.cos * v];
        let [x, y] = turn(local.point);
        Jet {
            point: [self.x_m + x, self.y_m + y],
            first: turn(local.first),
            second: turn(local.second),
        }
    }

    pub(crate) fn distance_to_start(&self, x_m: f64, y_m: f64) -> f64 {
        libm::hypot(x_m - self.x_m, y_m - self.y_m)
    }

    /// The quintic that meets `a` at 0 and `b` at `length_m` with two derivatives.
    fn fit(s_m: f64, length_m: f64, a: &Jet, b: &Jet, heading_before: Option<f64>) -> Self {
        let wrapped = a.heading_rad();
        let heading_rad = heading_before
            .map_or(wrapped, |h| h + libm::remainder(wrapped - h, 2.0 * core::f64::consts::PI));
        let (sin, cos) = libm::sincos(wrapped);
        let turn = |[x, y]: [f64; 2]| [cos * x + sin * y, cos * y - sin * x];
        let end = turn([b.point[0] - a.point[0], b.point[1] - a.point[1]]);
        let (a1, a2, b1, b2) = (turn(a.first), turn(a.second), turn(b.first), turn(b.second));
        let h = length_m;
        let axis = |k: usize| {
            let (m0, c0) = (a1[k], 0.5 * a2[k]);
            let p = (end[k] - h * (m0 + h * c0)) / (h * h * h);
            let q = (b1[k] - m0 - 2.0 * c0 * h) / (h * h);
            let r = (b2[k] - 2.0 * c0) / h;
            [
                m0,
                c0,
                10.0 * p - 4.0 * q + 0.5 * r,
                (-15.0 * p + 7.0 * q - r) / h,
                (6.0 * p - 3.0 * q + 0.5 * r) / (h * h),
            ]
        };
        let [x_m, y_m] = a.point;
        let (u, v) = (axis(0), axis(1));
        let curved_at_most_1_m = curved_at_most_1_m(&u, &v, h);
        Self { s_m, length_m, x_m, y_m, heading_rad, cos, sin, u, v, curved_at_most_1_m }
    }
}

/// Collects cells.
#[derive(Default)]
pub(crate) struct Baker {
    cells: Vec<Cell>,
    s_m: f64,
}

impl Baker {
    /// Appends a smooth curve of `length_m`, given with its derivatives by station. A curve shorter
    /// than a tenth of a millimetre is left out.
    pub(crate) fn push(&mut self, length_m: f64, curve: &dyn Fn(f64) -> Jet) {
        if !(length_m > 1e-4) {
            return;
        }
        let parts = libm::ceil(length_m / LONGEST_CELL_M).max(1.0) as usize;
        let h = length_m / parts as f64;
        let least_m = SHORTEST_CELL_M.max(length_m / MOST_CELLS);
        for i in 0..parts {
            self.refine(i as f64 * h, (i + 1) as f64 * h, least_m, curve);
        }
        self.s_m += length_m;
    }

    /// Appends the quintic between two points, `length_m` of station apart.
    #[cfg(feature = "std")]
    pub(crate) fn push_between(&mut self, length_m: f64, a: &Jet, b: &Jet) {
        let cell = Cell::fit(self.s_m, length_m, a, b, self.end_heading_rad());
        self.cells.push(cell);
        self.s_m += length_m;
    }

    fn end_heading_rad(&self) -> Option<f64> {
        self.cells.last().map(|c| {
            let e = c.local(c.length_m);
            c.heading_rad + libm::atan2(e.first[1], e.first[0])
        })
    }

    fn refine(&mut self, from_m: f64, to_m: f64, least_m: f64, curve: &dyn Fn(f64) -> Jet) {
        let h = to_m - from_m;
        let before = self.end_heading_rad();
        let cell = Cell::fit(self.s_m + from_m, h, &curve(from_m), &curve(to_m), before);
        let far = [0.25, 0.5, 0.75].into_iter().any(|f| {
            let exact = curve(from_m + f * h).point;
            let [u, v] = cell.local(f * h).point;
            let x = cell.x_m + cell.cos * u - cell.sin * v;
            let y = cell.y_m + cell.sin * u + cell.cos * v;
            let scale = libm::fabs(x).max(libm::fabs(y));
            libm::hypot(x - exact[0], y - exact[1]) > BAKE_TOLERANCE_M + 1e-15 * scale
        });
        if far && h > least_m {
            let mid = 0.5 * (from_m + to_m);
            self.refine(from_m, mid, least_m, curve);
            self.refine(mid, to_m, least_m, curve);
        } else {
            self.cells.push(cell);
        }
    }

    /// The last point, if there is one.
    #[cfg(feature = "std")]
    pub(crate) fn end_point(&self) -> Option<[f64; 2]> {
        self.cells.last().map(|c| c.jet(c.length_m).point)
    }

    /// Station reached, m.
    #[cfg(feature = "std")]
    pub(crate) const fn length_m(&self) -> f64 {
        self.s_m
    }

    /// The line.
    pub(crate) fn finish(self, elevation: Cubics, bank: Cubics) -> Line {
        self.finish_at(None, elevation, bank)
    }

    /// The line; where nothing was long enough, a millimetre of straight at `start`.
    pub(crate) fn finish_at(
        mut self,
        start: Option<&Placed>,
        elevation: Cubics,
        bank: Cubics,
    ) -> Line {
        if self.cells.is_empty() {
            let mut straight = Placed {
                s_m: 0.0,
                x_m: 0.0,
                y_m: 0.0,
                heading_rad: 0.0,
                length_m: 1e-3,
                shape: Shape::Line,
            };
            if let Some(start) = start {
                straight = Placed { length_m: 1e-3, shape: Shape::Line, ..*start };
            }
            self.push(1e-3, &|ds| straight.at(ds));
        }
        let (length_m, n) = (self.s_m, self.cells.len());
        let mut buckets = Vec::with_capacity(n);
        let mut cell = 0;
        for i in 0..n {
            let s = length_m * i as f64 / n as f64;
            while cell + 1 < n && self.cells[cell + 1].s_m <= s {
                cell += 1;
            }
            buckets.push(cell as u32);
        }
        Line::from_cells(self.cells, buckets, length_m, elevation, bank)
    }
}
