//! Time, frames, motion and position on the earth.

use tractrix_core::{Tick, Time};

use super::bodies::{Bodies, on_road};
use super::{Scenery, in_map};
use crate::ros::standard::{
    Clock, Header, NavSatFix, NavSatStatus, Odometry, Path, Pose, PoseStamped, PoseWithCovariance,
    Quaternion, Stamp, TfMessage, Transform, TransformStamped, Twist, TwistWithCovariance, Vector3,
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
