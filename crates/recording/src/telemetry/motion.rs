//! Time, frames, motion and position on the earth.

use tractrix_core::{GRAVITY_M_S2, Tick, Time};

use super::bodies::{Bodies, on_road};
use super::{Scenery, in_map};
use crate::ros::standard::{
    Clock, Header, Imu, NavSatFix, NavSatStatus, Odometry, Path, Pose, PoseStamped,
    PoseWithCovariance, Quaternion, Stamp, TfMessage, Transform, TransformStamped, Twist,
    TwistWithCovariance, Vector3,
};

/// Variances of what the plant simulates and the recording copies: a millimetre, a hundredth of a
/// degree, a millimetre per second. Not zero, which filters take for "cannot be wrong".
const SIMULATED: f64 = 1e-6;
/// Variance of pitch and roll, rad²: the body is drawn on the road's surface, its movement on its
/// springs (about 1 degree) is not simulated.
const ATTITUDE: f64 = 3e-4;
/// Variance of the vertical speed, (m/s)², and of pitch and roll rate, (rad/s)², which are sent
/// as zero: grade 5 % at 22 m/s, a body that sways 2 degrees at 1 Hz.
const VERTICAL_SPEED: f64 = 1.0;
const SWAY: f64 = 0.05;
/// Variance of the vertical acceleration, (m/s²)², whose changes are not simulated: 5 % of gravity.
const HEAVE: f64 = 0.25;

/// `/clock`.
pub(super) fn clock(now: Time) -> Clock {
    Clock { clock: Stamp::of(now) }
}

/// `/tf`: `map` to `base_link` (the reference point) and `base_link` to `trailer` (the hitch,
/// turned by the articulation and the change of the road's attitude between the two bodies).
pub(super) fn transforms(tick: &Tick<'_>, scenery: &Scenery) -> TfMessage {
    let Bodies { tractor, trailer } = Bodies::of(tick.ego, scenery);
    let hitch = Vector3 { x: scenery.combination.hitch_m, y: 0.0, z: 0.0 };
    let turned = tractor.orientation.inverse_times(trailer.orientation);
    let stamp = Stamp::of(tick.now);
    let tractor = transform(stamp, ("map", "base_link"), tractor.position, tractor.orientation);
    let trailer = transform(stamp, ("base_link", "trailer"), hitch, turned);
    TfMessage { transforms: vec![tractor, trailer] }
}

/// `/tf_static`: points of tractor and trailer on the ground, and `earth` to `map` where the road
/// has a geo reference.
pub(super) fn static_transforms(scenery: &Scenery) -> TfMessage {
    let c = &scenery.combination;
    let none = Quaternion::from_yaw_pitch_roll(0.0, 0.0, 0.0);
    let stamp = Stamp::default();
    let trailer_axles_m =
        c.trailer_axles_m.iter().sum::<f64>() / c.trailer_axles_m.len().max(1) as f64;
    let points = [
        ("base_link", "front_bumper", c.tractor_front_m),
        ("base_link", "steer_axle", c.steer_axle_m),
        ("base_link", "hitch", c.hitch_m),
        ("trailer", "trailer_axles", trailer_axles_m),
        ("trailer", "trailer_rear", c.trailer_rear_m),
    ];
    let on_body = points.map(|(body, point, ahead_m)| {
        transform(stamp, (body, point), Vector3 { x: ahead_m, y: 0.0, z: 0.0 }, none)
    });
    let map = scenery.geodesy.as_ref().map(|geodesy| {
        let map = geodesy.earth_from_map();
        transform(stamp, ("earth", "map"), map.position, map.orientation)
    });
    TfMessage { transforms: map.into_iter().chain(on_body).collect() }
}

fn transform(
    stamp: Stamp,
    (parent, child): (&'static str, &'static str),
    translation: Vector3,
    rotation: Quaternion,
) -> TransformStamped {
    TransformStamped {
        header: Header { stamp, frame_id: parent },
        child_frame_id: child,
        transform: Transform { translation, rotation },
    }
}

/// `/odom`.
pub(super) fn odometry(tick: &Tick<'_>, scenery: &Scenery) -> Odometry {
    let ego = tick.ego;
    let pose = Bodies::of(ego, scenery).tractor;
    let twist = Twist {
        linear: Vector3 { x: ego.speed_m_s, y: ego.lateral_speed_m_s, z: 0.0 },
        angular: Vector3 { x: 0.0, y: 0.0, z: ego.yaw_rate_rad_s },
    };
    let of_pose = [SIMULATED, SIMULATED, SIMULATED, ATTITUDE, ATTITUDE, SIMULATED];
    let of_twist = [SIMULATED, SIMULATED, VERTICAL_SPEED, SWAY, SWAY, SIMULATED];
    Odometry {
        header: in_map(tick.now),
        child_frame_id: "base_link",
        pose: PoseWithCovariance { pose, covariance: diagonal(of_pose) },
        twist: TwistWithCovariance { twist, covariance: diagonal(of_twist) },
    }
}

/// `/imu`: what a sensor at the reference point of the tractor measures, fixed to its body. A
/// standing truck on level ground measures +g upwards (REP 145).
pub(super) fn imu(tick: &Tick<'_>, scenery: &Scenery) -> Imu {
    let ego = tick.ego;
    let orientation = Bodies::of(ego, scenery).tractor.orientation;
    let up = orientation.turn_back(Vector3 { x: 0.0, y: 0.0, z: GRAVITY_M_S2 });
    let covariance = |[x, y, z]: [f64; 3]| [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z];
    Imu {
        header: Header { stamp: Stamp::of(tick.now), frame_id: "base_link" },
        orientation,
        orientation_covariance: covariance([ATTITUDE, ATTITUDE, SIMULATED]),
        angular_velocity: Vector3 { x: 0.0, y: 0.0, z: ego.yaw_rate_rad_s },
        angular_velocity_covariance: covariance([SWAY, SWAY, SIMULATED]),
        linear_acceleration: Vector3 {
            x: ego.accel_x_m_s2 - ego.lateral_speed_m_s * ego.yaw_rate_rad_s + up.x,
            y: ego.accel_y_m_s2 + up.y,
            z: up.z,
        },
        linear_acceleration_covariance: covariance([SIMULATED, SIMULATED, HEAVE]),
    }
}

fn diagonal(variances: [f64; 6]) -> [f64; 36] {
    let mut matrix = [0.0; 36];
    for (i, variance) in variances.into_iter().enumerate() {
        matrix[7 * i] = variance;
    }
    matrix
}

/// `/fix`: the reference point on the earth; none where the road has no geo reference.
pub(super) fn fix(tick: &Tick<'_>, scenery: &Scenery) -> Option<NavSatFix> {
    let ego = tick.ego;
    let at = scenery.geodesy.as_ref()?.on_earth(ego.x_m, ego.y_m, ego.z_m)?;
    Some(NavSatFix {
        header: Header { stamp: Stamp::of(tick.now), frame_id: "base_link" },
        status: NavSatStatus::default(),
        latitude: at.latitude_deg,
        longitude: at.longitude_deg,
        altitude: at.altitude_m,
        position_covariance: [0.0; 9],
        position_covariance_type: 0,
    })
}

/// `/plan/path`.
pub(super) fn path(tick: &Tick<'_>, scenery: &Scenery) -> Path {
    let header = in_map(tick.now);
    let poses = tick.plan.path.iter().map(|p| {
        let z = scenery.road.at(p.s_m, p.d_m).z_m;
        let orientation = on_road(&scenery.road, p.s_m, p.d_m, p.yaw_rad);
        let pose = Pose { position: Vector3 { x: p.x_m, y: p.y_m, z }, orientation };
        PoseStamped { header: header.clone(), pose }
    });
    Path { header: header.clone(), poses: poses.collect() }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tractrix_core::{EgoState, Plan, Scene};

    use super::*;
    use crate::Combination;

    /// On a slope a sensor at rest measures what holds the truck: gravity's reaction, tilted.
    #[test]
    fn a_truck_at_rest_measures_the_slope() {
        let road = Arc::new(road::builtin::test_site());
        let (s_m, scene, plan) = (807.0, Scene::default(), Plan::default());
        let at = road.at(s_m, 0.0);
        let ego =
            EgoState { s_m, yaw_rad: at.heading_rad, accel_x_m_s2: 0.3, ..EgoState::default() };
        let scenery = Scenery { road, combination: Combination::default(), geodesy: None };
        let tick = Tick { now: Time::ZERO, ego: &ego, scene: &scene, plan: &plan };
        let a = imu(&tick, &scenery).linear_acceleration;
        let slope = GRAVITY_M_S2 * at.grade_rad.sin();
        assert!(slope.abs() > 0.1 && (a.x - 0.3 - slope).abs() < 1e-9, "{a:?} {slope}");
        let length_m_s2 = (a.x - 0.3).hypot(a.y).hypot(a.z);
        assert!((length_m_s2 - GRAVITY_M_S2).abs() < 1e-12, "{a:?}");
    }
}
