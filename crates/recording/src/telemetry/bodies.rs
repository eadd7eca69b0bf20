//! Where bodies are in the map: poses and boxes of tractor, trailer and the other vehicles.

use road::Road;
use serde::Serialize;
use tractrix_core::{EgoState, Geometry, LateralLimits, Neighbour, VehicleClass, VehicleLimits};

use super::Scenery;
use crate::ros::marker::{Color, Marker};
use crate::ros::standard::{Header, Pose, Quaternion, Vector3};

/// A station on a body, m ahead of the body's origin.
pub(super) type Ahead = f64;

/// Lengths of the combination as a viewer draws it. Tractor lengths are ahead of the reference
/// point, trailer lengths ahead of the hitch.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Combination {
    /// Front bumper.
    pub tractor_front_m: f64,
    /// Tractor's rear end.
    pub tractor_rear_m: f64,
    /// Fifth wheel.
    pub hitch_m: f64,
    /// Steered axle.
    pub steer_axle_m: f64,
    /// Drive axles.
    pub drive_axles_m: Vec<f64>,
    /// Trailer's front end.
    pub trailer_front_m: f64,
    /// Trailer's rear end.
    pub trailer_rear_m: f64,
    /// Trailer axles.
    pub trailer_axles_m: Vec<f64>,
    /// Width.
    pub width_m: f64,
}

impl Combination {
    /// From what the truck says about itself: two drive axles, three trailer axles.
    #[must_use]
    pub fn new(limits: &VehicleLimits) -> Self {
        let (g, l): (&Geometry, &LateralLimits) = (&limits.geometry, &limits.lateral);
        let trailer_m = -g.hitch_to_trailer_axle_m;
        Self {
            tractor_front_m: g.front_m,
            tractor_rear_m: -g.tractor_rear_m,
            hitch_m: g.hitch_ahead_m,
            steer_axle_m: g.wheelbase_m,
            drive_axles_m: vec![l.drive_half_spread_m, -l.drive_half_spread_m],
            trailer_front_m: g.trailer_front_m,
            trailer_rear_m: -g.trailer_rear_m,
            trailer_axles_m: vec![
                trailer_m + l.trailer_half_spread_m,
                trailer_m,
                trailer_m - l.trailer_half_spread_m,
            ],
            width_m: g.width_m,
        }
    }
}

/// Where tractor and trailer are: the tractor's reference point and the hitch, on the ground, each
/// with the attitude of the road under its body.
pub(super) struct Bodies {
    pub(super) tractor: Pose,
    pub(super) trailer: Pose,
}

impl Bodies {
    pub(super) fn of(ego: &EgoState, scenery: &Scenery) -> Self {
        let c = &scenery.combination;
        let tractor = Pose {
            position: Vector3 { x: ego.x_m, y: ego.y_m, z: ego.z_m },
            orientation: on_road(&scenery.road, ego.s_m, ego.d_m, ego.yaw_rad),
        };
        let trailer_mid_m = c.hitch_m + 0.5 * (c.trailer_front_m + c.trailer_rear_m);
        let yaw_rad = ego.yaw_rad + ego.trailer.articulation_rad;
        let trailer = Pose {
            position: tractor.point(c.hitch_m, 0.0, 0.0),
            orientation: on_road(&scenery.road, ego.s_m + trailer_mid_m, ego.d_m, yaw_rad),
        };
        Self { tractor, trailer }
    }
}

/// Attitude of a body that stands on the road with a heading, ISO 8855: pitch positive nose down,
/// roll positive left side up. Grade and bank are turned into the body's axes.
pub(super) fn on_road(road: &Road, s_m: f64, d_m: f64, yaw_rad: f64) -> Quaternion {
    let at = road.at(s_m, d_m);
    let (sin, cos) = (yaw_rad - at.heading_rad).sin_cos();
    let (grade, bank) = (at.grade_rad.tan(), at.bank_rad.tan());
    let ahead = cos * grade + sin * bank;
    let left = cos * bank - sin * grade;
    let roll_rad = (left / ahead.hypot(1.0)).atan();
    Quaternion::from_yaw_pitch_roll(yaw_rad, -ahead.atan(), roll_rad)
}

/// Boxes of tractor and trailer.
pub(super) fn ego_markers(header: &Header, ego: &EgoState, scenery: &Scenery) -> [Marker; 2] {
    let (bodies, c) = (Bodies::of(ego, scenery), &scenery.combination);
    let body = |id, at: &Pose, (rear_m, front_m): (Ahead, Ahead), color| {
        let size_m = [front_m - rear_m, c.width_m, TRUCK_HEIGHT_M];
        cube(header, ("ego", id), at, 0.5 * (front_m + rear_m), size_m, color)
    };
    [
        body(0, &bodies.tractor, (c.tractor_rear_m, c.tractor_front_m), TRACTOR),
        body(1, &bodies.trailer, (c.trailer_rear_m, c.trailer_front_m), TRAILER),
    ]
}

/// The box of another vehicle.
pub(super) fn neighbour_marker(header: &Header, n: &Neighbour, road: &Road) -> Marker {
    let height_m = match n.class {
        VehicleClass::Car => 1.5,
        VehicleClass::Van | VehicleClass::Emergency => 2.4,
        VehicleClass::Barrier => 1.2,
        VehicleClass::Truck => TRUCK_HEIGHT_M,
    };
    let mid_s_m = 0.5 * (n.front_s_m + n.rear_s_m);
    let z = road.at(mid_s_m, n.d_m).z_m;
    let at = Pose {
        position: Vector3 { x: n.x_m, y: n.y_m, z },
        orientation: on_road(road, mid_s_m, n.d_m, n.yaw_rad),
    };
    let id = i32::try_from(n.id % (1 << 31)).unwrap_or_default();
    cube(header, ("traffic", id), &at, 0.0, [n.length_m(), n.width_m, height_m], TRAFFIC)
}

const TRUCK_HEIGHT_M: f64 = 3.9;
const TRACTOR: Color = Color { r: 0.18, g: 0.55, b: 0.95, a: 1.0 };
const TRAILER: Color = Color { r: 0.75, g: 0.80, b: 0.86, a: 1.0 };
const TRAFFIC: Color = Color { r: 0.95, g: 0.65, b: 0.20, a: 1.0 };

/// A box on the ground whose middle is `mid_m` ahead of a body's origin.
fn cube(
    header: &Header,
    (ns, id): (&'static str, i32),
    body: &Pose,
    mid_m: Ahead,
    [x, y, z]: [f64; 3],
    color: Color,
) -> Marker {
    let middle = Pose { position: body.point(mid_m, 0.0, 0.5 * z), ..*body };
    Marker { scale: Vector3 { x, y, z }, color, ..Marker::cube(header, ns, id, middle) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gradients of the road's surface at the body: what a rider would feel ahead and to the left.
    #[test]
    fn a_body_lies_on_the_surface_whatever_its_heading() {
        let road = road::builtin::test_site();
        let s_m = 807.0;
        let at = road.at(s_m, 0.0);
        assert!(at.grade_rad.abs() > 0.01);
        for turn_rad in [0.0, 0.04, -0.3, 1.2] {
            let yaw_rad = at.heading_rad + turn_rad;
            let q = on_road(&road, s_m, 0.0, yaw_rad);
            let ahead = q.turn(Vector3 { x: 1.0, y: 0.0, z: 0.0 });
            assert!((ahead.y.atan2(ahead.x) - yaw_rad).sin().abs() < 1e-12);
            let step_m = 1e-3;
            let (sin, cos) = turn_rad.sin_cos();
            let before = road.at(s_m - step_m * cos, -step_m * sin).z_m;
            let after = road.at(s_m + step_m * cos, step_m * sin).z_m;
            let slope = (after - before) / (2.0 * step_m);
            assert!((ahead.z / ahead.x.hypot(ahead.y) - slope).abs() < 1e-4);
        }
    }
}
