//! Do two bodies overlap? Oriented rectangles in the map frame, separating-axis test.

use tractrix_core::{EgoState, Geometry, Neighbour};

/// An oriented rectangle on the ground, map frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// Centre x, m.
    pub x_m: f64,
    /// Centre y, m.
    pub y_m: f64,
    /// Heading, rad.
    pub yaw_rad: f64,
    /// Length along the heading, m.
    pub length_m: f64,
    /// Width across, m.
    pub width_m: f64,
}

impl Footprint {
    /// The rectangle from `rear` to `front` metres ahead of a point on its centre line.
    fn along(x_m: f64, y_m: f64, yaw_rad: f64, rear_m: f64, front_m: f64, width_m: f64) -> Self {
        let mid = 0.5 * (rear_m + front_m);
        let (sin, cos) = libm::sincos(yaw_rad);
        Self {
            x_m: x_m + mid * cos,
            y_m: y_m + mid * sin,
            yaw_rad,
            length_m: front_m - rear_m,
            width_m,
        }
    }

    /// Tractor and trailer of the ego.
    #[must_use]
    pub fn of_ego(ego: &EgoState, geometry: &Geometry) -> [Self; 2] {
        let g = geometry;
        let (sin, cos) = libm::sincos(ego.yaw_rad);
        let hitch = (ego.x_m + g.hitch_ahead_m * cos, ego.y_m + g.hitch_ahead_m * sin);
        let trailer_yaw = ego.yaw_rad + ego.trailer.articulation_rad;
        [
            Self::along(ego.x_m, ego.y_m, ego.yaw_rad, -g.tractor_rear_m, g.front_m, g.width_m),
            Self::along(
                hitch.0,
                hitch.1,
                trailer_yaw,
                -g.trailer_rear_m,
                g.trailer_front_m,
                g.width_m,
            ),
        ]
    }

    /// The body of another vehicle.
    #[must_use]
    pub fn of_neighbour(n: &Neighbour) -> Self {
        Self {
            x_m: n.x_m,
            y_m: n.y_m,
            yaw_rad: n.yaw_rad,
            length_m: n.length_m(),
            width_m: n.width_m,
        }
    }

    fn axes(&self) -> [(f64, f64); 2] {
        let (sin, cos) = libm::sincos(self.yaw_rad);
        [(cos, sin), (-sin, cos)]
    }

    /// Half extent along a unit direction.
    fn half_extent(&self, (ux, uy): (f64, f64)) -> f64 {
        let [(ax, ay), (bx, by)] = self.axes();
        0.5 * self.length_m * (ax * ux + ay * uy).abs()
            + 0.5 * self.width_m * (bx * ux + by * uy).abs()
    }
}

/// Whether two rectangles share a point.
#[must_use]
pub fn footprints_overlap(a: &Footprint, b: &Footprint) -> bool {
    let (dx, dy) = (b.x_m - a.x_m, b.y_m - a.y_m);
    a.axes()
        .into_iter()
        .chain(b.axes())
        .all(|u| (dx * u.0 + dy * u.1).abs() <= a.half_extent(u) + b.half_extent(u))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> Footprint {
        Footprint { x_m, y_m, yaw_rad, length_m: 4.0, width_m: 2.0 }
    }

    #[test]
    fn rectangles_touch_at_half_the_sum_of_their_lengths() {
        assert!(footprints_overlap(&at(0.0, 0.0, 0.0), &at(3.99, 0.0, 0.0)));
        assert!(!footprints_overlap(&at(0.0, 0.0, 0.0), &at(4.01, 0.0, 0.0)));
        assert!(!footprints_overlap(&at(0.0, 0.0, 0.0), &at(0.0, 2.01, 0.0)));
    }

    #[test]
    fn a_turned_rectangle_reaches_as_far_as_its_corner() {
        let turned = at(0.0, 3.0, core::f64::consts::FRAC_PI_2);
        assert!(footprints_overlap(&at(0.0, 0.0, 0.0), &turned));
        let corner = at(2.9, 2.2, core::f64::consts::FRAC_PI_4);
        assert!(footprints_overlap(&at(0.0, 0.0, 0.0), &corner));
        assert!(!footprints_overlap(&at(0.0, 0.0, 0.0), &at(3.6, 2.9, 0.785)));
    }

    #[test]
    fn the_trailer_swings_with_the_articulation() {
        let geometry = Geometry {
            front_m: 5.0,
            hitch_ahead_m: 0.3,
            trailer_front_m: 1.0,
            trailer_rear_m: 12.0,
            tractor_rear_m: 1.0,
            width_m: 2.5,
            ..Default::default()
        };
        let mut ego = EgoState::default();
        let [tractor, trailer] = Footprint::of_ego(&ego, &geometry);
        assert_eq!((tractor.x_m, tractor.length_m), (2.0, 6.0));
        assert!((trailer.x_m - (0.3 - 5.5)).abs() < 1e-12);
        ego.trailer.articulation_rad = 0.1;
        assert!(Footprint::of_ego(&ego, &geometry)[1].y_m < -0.5);
    }
}
