//! The reference line, ready for fast look-up: plan view, height and bank over station.
//!
//! A plan curve is baked into cells of quintics, within [`crate::BAKE_TOLERANCE_M`] of the exact
//! curve. Heading and curvature belong to the same curve as the position, and a look-up costs one
//! division and a few multiplications. Heights and bank are the exact cubics.

use alloc::vec::Vec;

#[cfg(feature = "std")]
use crate::Jet;
use crate::bake::{Baker, Cell};
use crate::small;
use crate::{Cubics, Placed, Shape};

/// A point farther than this from the line, or beyond its ends, has no road coordinates.
const REACH_M: f64 = 200.0;

/// The reference line at one station.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Knot {
    /// Station, m.
    pub s_m: f64,
    /// Map x, m.
    pub x_m: f64,
    /// Map y, m.
    pub y_m: f64,
    /// Heading, rad, continuous along the line (not wrapped).
    pub heading_rad: f64,
    /// Curvature, 1/m, positive left.
    pub curvature_1_m: f64,
    /// Height, m.
    pub z_m: f64,
    /// Slope dz/ds, dimensionless.
    pub slope: f64,
    /// Bank, rad, left side up.
    pub bank_rad: f64,
}

/// A reference line.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    cells: Vec<Cell>,
    /// First cell of each of `buckets.len()` equal parts of the line.
    buckets: Vec<u32>,
    length_m: f64,
    elevation: Cubics,
    bank: Cubics,
    curved_at_most_1_m: f64,
}

impl Line {
    /// A line from placed elements, one after the other (their `s_m` is not used), with height and
    /// bank over station. Elements that are shorter than a tenth of a millimetre together give a
    /// line of one millimetre, an empty list one at the origin.
    #[must_use]
    pub fn from_elements(elements: &[Placed], elevation: Cubics, bank: Cubics) -> Self {
        let mut baker = Baker::default();
        for e in elements {
            baker.push(e.length_m, &|ds| e.at(ds));
        }
        baker.finish_at(elements.first(), elevation, bank)
    }

    /// A line that starts at the map's origin in direction `heading_rad` and has a curvature that
    /// is linear between (station m, curvature 1/m) points: a chain of clothoids.
    #[must_use]
    pub fn from_curvature(
        heading_rad: f64,
        points: &[(f64, f64)],
        elevation: Cubics,
        bank: Cubics,
    ) -> Self {
        Self::from_pose([0.0, 0.0], heading_rad, points, elevation, bank)
    }

    /// As [`Line::from_curvature`], from another point of the map.
    #[must_use]
    pub fn from_pose(
        start_m: [f64; 2],
        heading_rad: f64,
        points: &[(f64, f64)],
        elevation: Cubics,
        bank: Cubics,
    ) -> Self {
        let ([mut x_m, mut y_m], mut heading) = (start_m, heading_rad);
        let mut baker = Baker::default();
        for w in points.windows(2) {
            let ((s_m, start_1_m), (s1, end_1_m)) = (w[0], w[1]);
            let length_m = s1 - s_m;
            let shape = Shape::Spiral { start_1_m, end_1_m };
            let placed = Placed { s_m, x_m, y_m, heading_rad: heading, length_m, shape };
            baker.push(length_m, &|ds| placed.at(ds));
            [x_m, y_m] = placed.at(length_m).point;
            heading += 0.5 * (start_1_m + end_1_m) * length_m;
        }
        baker.finish(elevation, bank)
    }

    pub(crate) fn from_cells(
        cells: Vec<Cell>,
        buckets: Vec<u32>,
        length_m: f64,
        elevation: Cubics,
        bank: Cubics,
    ) -> Self {
        let curved_at_most_1_m = cells.iter().map(|c| c.curved_at_most_1_m).fold(0.0, f64::max);
        Self { cells, buckets, length_m, elevation, bank, curved_at_most_1_m }
    }

    /// Length, m.
    #[must_use]
    pub const fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Height over station.
    #[must_use]
    pub const fn elevation(&self) -> &Cubics {
        &self.elevation
    }

    /// Bank over station.
    #[must_use]
    pub const fn bank(&self) -> &Cubics {
        &self.bank
    }

    /// Stations at which cells begin, and the end: the curve is smooth between them.
    pub fn joints_m(&self) -> impl Iterator<Item = f64> + '_ {
        self.cells.iter().map(|c| c.s_m).chain(core::iter::once(self.length_m))
    }

    /// The cells: (start m, end m, jet at the start, jet at the end), in map axes.
    #[cfg(feature = "std")]
    pub(crate) fn cells_with_jets(&self) -> Vec<(f64, f64, Jet, Jet)> {
        let ends = self.joints_m().skip(1);
        self.cells
            .iter()
            .zip(ends)
            .map(|(c, end)| (c.s_m, end, c.jet(0.0), c.jet(c.length_m)))
            .collect()
    }

    /// Point and derivatives by the cell that holds `inside_m`, in map axes.
    #[cfg(feature = "std")]
    pub(crate) fn jet_in(&self, s_m: f64, inside_m: f64) -> Jet {
        let cell = &self.cells[self.cell(inside_m.clamp(0.0, self.length_m))];
        cell.jet(s_m - cell.s_m)
    }

    fn cell(&self, s_m: f64) -> usize {
        let n = self.buckets.len();
        let u = s_m / self.length_m * n as f64;
        let bucket = if u > 0.0 { (u as usize).min(n - 1) } else { 0 };
        let mut i = self.buckets[bucket] as usize;
        while i + 1 < self.cells.len() && self.cells[i + 1].s_m <= s_m {
            i += 1;
        }
        i
    }

    /// The line at a station, clamped to its ends; at a joint, the side that begins there.
    #[must_use]
    pub fn at(&self, s_m: f64) -> Knot {
        let s = s_m.clamp(0.0, self.length_m);
        self.knot(&self.cells[self.cell(s)], s)
    }

    /// The line at the end of the piece that holds `inside_m`, as that piece sees it.
    #[cfg(feature = "std")]
    pub(crate) fn at_in(&self, s_m: f64, inside_m: f64) -> Knot {
        self.knot(&self.cells[self.cell(inside_m.clamp(0.0, self.length_m))], s_m)
    }

    /// The station, clamped to the line, m, and the curvature there alone, 1/m: as [`Line::at`] at a
    /// part of its cost.
    #[must_use]
    pub fn curvature_1_m(&self, s_m: f64) -> (f64, f64) {
        let s = s_m.clamp(0.0, self.length_m);
        if self.curved_at_most_1_m == 0.0 {
            return (s, 0.0);
        }
        let cell = &self.cells[self.cell(s)];
        (s, cell.local(s - cell.s_m).curvature_1_m())
    }

    /// The heading alone, rad: as [`Line::at`] at a part of its cost.
    #[must_use]
    pub fn heading_rad(&self, s_m: f64) -> f64 {
        let s = s_m.clamp(0.0, self.length_m);
        let cell = &self.cells[self.cell(s)];
        cell.heading_rad + turned_rad(cell.local(s - cell.s_m).first)
    }

    /// A bound of the curvature between two stations, 1/m: nowhere there is [`Line::curvature_1_m`]
    /// larger, to either side. Infinite on curves that are bent within metres.
    #[must_use]
    pub fn curved_at_most_1_m(&self, from_m: f64, to_m: f64) -> f64 {
        let first = self.cell(from_m.clamp(0.0, self.length_m));
        let mut most_1_m = self.cells[first].curved_at_most_1_m;
        for cell in self.cells[first + 1..].iter().take_while(|cell| cell.s_m <= to_m) {
            most_1_m = most_1_m.max(cell.curved_at_most_1_m);
        }
        most_1_m
    }

    /// The bound of [`Line::curved_at_most_1_m`] for the whole line, 1/m.
    #[must_use]
    pub const fn curved_anywhere_at_most_1_m(&self) -> f64 {
        self.curved_at_most_1_m
    }

    /// The height alone, m: as [`Line::at`] at a part of its cost.
    #[must_use]
    pub fn height_m(&self, s_m: f64) -> f64 {
        self.elevation.at(s_m.clamp(0.0, self.length_m))
    }

    /// The slope dz/ds alone, dimensionless: as [`Line::at`] at a part of its cost.
    #[must_use]
    pub fn slope(&self, s_m: f64) -> f64 {
        self.elevation.at_with_slope(s_m.clamp(0.0, self.length_m)).1
    }

    fn knot(&self, cell: &Cell, s_m: f64) -> Knot {
        self.knot_and_tangent(cell, s_m).0
    }

    /// The line at a station with its unit tangent (x, y), which saves turning the heading back.
    pub(crate) fn at_with_tangent(&self, s_m: f64) -> (Knot, [f64; 2]) {
        let s = s_m.clamp(0.0, self.length_m);
        self.knot_and_tangent(&self.cells[self.cell(s)], s)
    }

    fn knot_and_tangent(&self, cell: &Cell, s_m: f64) -> (Knot, [f64; 2]) {
        let local = cell.local(s_m - cell.s_m);
        let ([u, v], [du, dv]) = (local.point, local.first);
        let speed = libm::sqrt(du * du + dv * dv);
        let (z_m, slope) = self.elevation.at_with_slope(s_m);
        let knot = Knot {
            s_m,
            x_m: cell.x_m + cell.cos * u - cell.sin * v,
            y_m: cell.y_m + cell.sin * u + cell.cos * v,
            heading_rad: cell.heading_rad + turned_rad([du, dv]),
            curvature_1_m: local.curvature_1_m(),
            z_m,
            slope,
            bank_rad: self.bank.at(s_m),
        };
        let tangent =
            [(cell.cos * du - cell.sin * dv) / speed, (cell.sin * du + cell.cos * dv) / speed];
        (knot, tangent)
    }

    /// Station of the nearest point of the line and the distance to its left in plan view. Near
    /// `hint_s_m` if given, else over the whole line. `None` for a point that is not finite, or
    /// farther than 200 m from the line or beyond its ends. Just beyond an end the station is that
    /// end's.
    #[must_use]
    pub fn project(&self, x_m: f64, y_m: f64, hint_s_m: Option<f64>) -> Option<(f64, f64)> {
        if !(x_m.is_finite() && y_m.is_finite()) {
            return None;
        }
        if let Some(hint) = hint_s_m.filter(|h| h.is_finite()) {
            let hint = hint.clamp(0.0, self.length_m);
            let found = self.descend(x_m, y_m, hint).filter(|f| (f.0 - hint).abs() <= REACH_M);
            if found.is_some() {
                return found;
            }
        }
        let nearest = self.cells.iter().fold(f64::MAX, |r, c| r.min(c.distance_to_start(x_m, y_m)));
        let mut best: Option<(f64, (f64, f64))> = None;
        for cell in &self.cells {
            // No point of a cell is farther from its start than its length (plus rounding).
            if cell.distance_to_start(x_m, y_m) - 1.01 * cell.length_m > nearest {
                continue;
            }
            let mid = cell.s_m + 0.5 * cell.length_m;
            if let Some(f) = self.descend(x_m, y_m, mid) {
                let k = self.at(f.0);
                let r = libm::hypot(x_m - k.x_m, y_m - k.y_m);
                if best.is_none_or(|b| r < b.0) {
                    best = Some((r, f));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// Newton's method on the foot point: `(q - p(s)) · p'(s) = 0`.
    fn descend(&self, x_m: f64, y_m: f64, start_m: f64) -> Option<(f64, f64)> {
        let mut s = start_m;
        let mut i = self.cell(s);
        for _ in 0..30 {
            while s < self.cells[i].s_m && i > 0 {
                i -= 1;
            }
            while i + 1 < self.cells.len() && s >= self.cells[i + 1].s_m {
                i += 1;
            }
            let cell = &self.cells[i];
            let local = cell.local(s - cell.s_m);
            let (dx, dy) = (x_m - cell.x_m, y_m - cell.y_m);
            let ru = cell.cos * dx + cell.sin * dy - local.point[0];
            let rv = cell.cos * dy - cell.sin * dx - local.point[1];
            let ([du, dv], [ddu, ddv]) = (local.first, local.second);
            let along = ru * du + rv * dv;
            let bend = du * du + dv * dv - ru * ddu - rv * ddv;
            let step = (along / bend.max(0.1)).clamp(-50.0, 50.0);
            let next = (s + step).clamp(0.0, self.length_m);
            let moved = (next - s).abs();
            s = next;
            if moved < 1e-10 {
                let across = (rv * du - ru * dv) / libm::sqrt(du * du + dv * dv);
                let near = across.abs() <= REACH_M && along.abs() <= REACH_M;
                return near.then_some((s, across));
            }
            if moved < 1e-7 && s > cell.s_m && s < cell.s_m + cell.length_m {
                // One more step is below rounding; the offset at the foot point has no slope.
                let across = (rv * du - ru * dv) / libm::sqrt(du * du + dv * dv);
                return (across.abs() <= REACH_M).then_some((s, across));
            }
        }
        // A corner between cells: the foot point is the corner itself.
        let k = self.at(s);
        let (sin, cos) = libm::sincos(k.heading_rad);
        let across = (y_m - k.y_m) * cos - (x_m - k.x_m) * sin;
        (across.abs() <= REACH_M).then_some((s, across))
    }
}

/// Direction of a tangent in the axes of its cell, rad.
fn turned_rad([du, dv]: [f64; 2]) -> f64 {
    if du > 0.0 { small::atan(dv / du) } else { libm::atan2(dv, du) }
}
