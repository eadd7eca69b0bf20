//! Whether the corners of tractor and trailer stay between two edges, at one station of a path.

use tractrix_core::Geometry;

/// More than rounding makes of the place of a corner, m.
const ROUNDING_M: f64 = 1e-6;

/// The truck at a station.
#[derive(Debug, Clone, Copy)]
pub(super) struct Posed {
    /// Offset of the reference point, m, positive left.
    pub d_m: f64,
    /// Tangent of the tractor's heading relative to the road.
    pub tan: f64,
    /// Heading of the tractor less that of the trailer, rad.
    pub fold_rad: f64,
    /// Curvature of the road, 1/m.
    pub road_curvature_1_m: f64,
}

impl Posed {
    /// Whether all corners are between the edges `(right, left)`, m.
    pub(super) fn is_within(&self, g: &Geometry, edges_m: (f64, f64)) -> bool {
        let within = |d_m: f64, off_m: f64| {
            let off_m = off_m + 0.5 * g.width_m;
            !(d_m - off_m < edges_m.0 || d_m + off_m > edges_m.1)
        };
        // Most of a change is far from the edges: no need to work out where corners are.
        if within(self.d_m, self.at_most_off_m(g) + ROUNDING_M) {
            return true;
        }
        let half = 0.5 * g.width_m;
        self.ends_d_m(g).into_iter().all(|d_m| !(d_m - half < edges_m.0 || d_m + half > edges_m.1))
    }

    /// Offsets of the middle of the tractor's front and of the trailer's rear, m.
    fn ends_d_m(&self, g: &Geometry) -> [f64; 2] {
        let angle = libm::atan(self.tan);
        let across = |ahead_m: f64, sin: f64, from_m: f64| {
            from_m + ahead_m * sin - 0.5 * self.road_curvature_1_m * ahead_m * ahead_m
        };
        let sin = libm::sin(angle);
        let front = across(g.front_m, sin, self.d_m);
        let hitch = self.d_m + g.hitch_ahead_m * sin;
        let rear = across(-g.trailer_rear_m, libm::sin(angle - self.fold_rad), hitch);
        [front, rear]
    }

    /// A bound of how far both are from the reference point across the road, m: no sine is larger
    /// than its angle, no angle than its tangent.
    fn at_most_off_m(&self, g: &Geometry) -> f64 {
        let (heading, fold) = (self.tan.abs(), self.fold_rad.abs());
        let bulge_m = |ahead_m: f64| 0.5 * self.road_curvature_1_m.abs() * ahead_m * ahead_m;
        let front = g.front_m.abs() * heading + bulge_m(g.front_m);
        let rear = g.hitch_ahead_m.abs() * heading
            + g.trailer_rear_m.abs() * (heading + fold)
            + bulge_m(g.trailer_rear_m);
        front.max(rear)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::reference_geometry;

    #[test]
    fn the_bound_holds_and_passes_nobody_whose_corners_are_outside() {
        let g = reference_geometry();
        let (mut by_bound, mut by_corners, mut outside) = (0, 0, 0);
        for k in 0..40_000_u32 {
            let unit = |n: u32| f64::from((k * n) % 1009) / 504.0 - 1.0;
            let (d_m, tan, fold_rad) = (2.5 * unit(7), 0.1 * unit(31), 0.1 * unit(101));
            let posed = Posed { d_m, tan, fold_rad, road_curvature_1_m: 0.004 * unit(577) };
            let edges_m = (-3.65, 3.65);
            let half = 0.5 * g.width_m;
            let ends = posed.ends_d_m(&g);
            let off = |e: f64| (e - d_m).abs();
            assert!(ends.into_iter().all(|e| off(e) <= posed.at_most_off_m(&g) + 1e-12));
            let is_within = ends.into_iter().all(|e| e - half >= -3.65 && e + half <= 3.65);
            assert_eq!(posed.is_within(&g, edges_m), is_within, "{posed:?}");
            let room_m = 3.65 - half - d_m.abs();
            match is_within {
                true if posed.at_most_off_m(&g) < room_m => by_bound += 1,
                true => by_corners += 1,
                false => outside += 1,
            }
        }
        assert!(by_bound > 1_000 && by_corners > 1_000 && outside > 1_000);
    }
}
