//! Standard ROS 2 messages that a recording holds (common_interfaces, rcl_interfaces, geometry2).

use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

use super::Message;

/// `builtin_interfaces/msg/Time` and `Duration`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Stamp {
    sec: i32,
    nanosec: u32,
}

impl Stamp {
    /// From simulation time.
    pub(crate) fn of(time: tractrix_core::Time) -> Self {
        Self {
            sec: i32::try_from(time.0.div_euclid(1_000_000_000)).unwrap_or(i32::MAX),
            nanosec: u32::try_from(time.0.rem_euclid(1_000_000_000)).unwrap_or(0),
        }
    }

    /// The simulation time again.
    pub(crate) fn time(self) -> tractrix_core::Time {
        tractrix_core::Time(i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec))
    }
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct Header {
    pub(crate) stamp: Stamp,
    pub(crate) frame_id: &'static str,
}

/// `geometry_msgs/msg/Point` and `Vector3`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub(crate) struct Vector3 {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

/// `geometry_msgs/msg/Quaternion`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Quaternion {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
    pub(crate) w: f64,
}

impl Quaternion {
    /// Rotation by yaw, then pitch, then roll (intrinsic z-y'-x''), rad. ISO 8855: pitch positive
    /// nose down, roll positive left side up.
    pub(crate) fn from_yaw_pitch_roll(yaw_rad: f64, pitch_rad: f64, roll_rad: f64) -> Self {
        let (sy, cy) = (0.5 * yaw_rad).sin_cos();
        let (sp, cp) = (0.5 * pitch_rad).sin_cos();
        let (sr, cr) = (0.5 * roll_rad).sin_cos();
        Self {
            x: sr * cp * cy - cr * sp * sy,
            y: cr * sp * cy + sr * cp * sy,
            z: cr * cp * sy - sr * sp * cy,
            w: cr * cp * cy + sr * sp * sy,
        }
    }

    /// The rotation of a frame given by its axes in another: unit vectors at right angles, the
    /// third one the vector product of the first two (Shepperd 1978).
    pub(crate) fn from_axes(x: [f64; 3], y: [f64; 3], z: [f64; 3]) -> Self {
        let trace = x[0] + y[1] + z[2];
        let part = |sum: f64| 0.5 * (1.0 + sum).max(0.0).sqrt();
        let [w, qx, qy, qz] = [
            part(trace),
            part(2.0 * x[0] - trace),
            part(2.0 * y[1] - trace),
            part(2.0 * z[2] - trace),
        ];
        Self {
            x: qx.copysign(y[2] - z[1]),
            y: qy.copysign(z[0] - x[2]),
            z: qz.copysign(x[1] - y[0]),
            w,
        }
    }

    /// The vector turned by this rotation.
    pub(crate) fn turn(self, v: Vector3) -> Vector3 {
        let Self { x, y, z, w } = self;
        let t = Vector3 {
            x: 2.0 * (y * v.z - z * v.y),
            y: 2.0 * (z * v.x - x * v.z),
            z: 2.0 * (x * v.y - y * v.x),
        };
        Vector3 {
            x: v.x + w * t.x + y * t.z - z * t.y,
            y: v.y + w * t.y + z * t.x - x * t.z,
            z: v.z + w * t.z + x * t.y - y * t.x,
        }
    }

    /// A vector of the outer frame as this rotated frame sees it.
    pub(crate) fn turn_back(self, v: Vector3) -> Vector3 {
        Self { x: -self.x, y: -self.y, z: -self.z, w: self.w }.turn(v)
    }

    /// The rotation `other` as seen from the frame turned by this one.
    pub(crate) fn inverse_times(self, other: Self) -> Self {
        let (a, b) = (self, other);
        Self {
            x: a.w * b.x - a.x * b.w - a.y * b.z + a.z * b.y,
            y: a.w * b.y - a.y * b.w - a.z * b.x + a.x * b.z,
            z: a.w * b.z - a.z * b.w - a.x * b.y + a.y * b.x,
            w: a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z,
        }
    }
}

/// `geometry_msgs/msg/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Pose {
    pub(crate) position: Vector3,
    pub(crate) orientation: Quaternion,
}

impl Pose {
    /// A point of the body (m ahead, left and up of its origin) in the pose's frame.
    pub(crate) fn point(&self, ahead: f64, left: f64, up: f64) -> Vector3 {
        let turned = self.orientation.turn(Vector3 { x: ahead, y: left, z: up });
        let Vector3 { x, y, z } = self.position;
        Vector3 { x: x + turned.x, y: y + turned.y, z: z + turned.z }
    }
}

/// `geometry_msgs/msg/PoseStamped`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct PoseStamped {
    pub(crate) header: Header,
    pub(crate) pose: Pose,
}

/// `geometry_msgs/msg/PoseWithCovariance`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct PoseWithCovariance {
    pub(crate) pose: Pose,
    #[serde(with = "BigArray")]
    pub(crate) covariance: [f64; 36],
}

/// `geometry_msgs/msg/Twist`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub(crate) struct Twist {
    pub(crate) linear: Vector3,
    pub(crate) angular: Vector3,
}

/// `geometry_msgs/msg/TwistWithCovariance`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TwistWithCovariance {
    pub(crate) twist: Twist,
    #[serde(with = "BigArray")]
    pub(crate) covariance: [f64; 36],
}

/// `geometry_msgs/msg/Transform`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Transform {
    pub(crate) translation: Vector3,
    pub(crate) rotation: Quaternion,
}

/// `geometry_msgs/msg/TransformStamped`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TransformStamped {
    pub(crate) header: Header,
    pub(crate) child_frame_id: &'static str,
    pub(crate) transform: Transform,
}

/// `rosgraph_msgs/msg/Clock`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Clock {
    pub(crate) clock: Stamp,
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TfMessage {
    pub(crate) transforms: Vec<TransformStamped>,
}

/// `nav_msgs/msg/Odometry`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Odometry {
    pub(crate) header: Header,
    pub(crate) child_frame_id: &'static str,
    pub(crate) pose: PoseWithCovariance,
    pub(crate) twist: TwistWithCovariance,
}

/// `nav_msgs/msg/Path`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Path {
    pub(crate) header: Header,
    pub(crate) poses: Vec<PoseStamped>,
}

/// `sensor_msgs/msg/NavSatStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub(crate) struct NavSatStatus {
    /// 0: a fix without augmentation.
    pub(crate) status: i8,
    /// Bits of the satellite systems used; 0: not known.
    pub(crate) service: u16,
}

/// `sensor_msgs/msg/NavSatFix`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct NavSatFix {
    pub(crate) header: Header,
    pub(crate) status: NavSatStatus,
    /// Degrees, positive north.
    pub(crate) latitude: f64,
    /// Degrees, positive east.
    pub(crate) longitude: f64,
    /// m above the ellipsoid.
    pub(crate) altitude: f64,
    pub(crate) position_covariance: [f64; 9],
    /// 0: not known.
    pub(crate) position_covariance_type: u8,
}

/// `sensor_msgs/msg/Imu`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Imu {
    pub(crate) header: Header,
    pub(crate) orientation: Quaternion,
    pub(crate) orientation_covariance: [f64; 9],
    pub(crate) angular_velocity: Vector3,
    pub(crate) angular_velocity_covariance: [f64; 9],
    pub(crate) linear_acceleration: Vector3,
    pub(crate) linear_acceleration_covariance: [f64; 9],
}

macro_rules! names {
    ($($ty:ty: $package:literal / $name:literal;)*) => {$(
        impl Message for $ty {
            const DEFINITION: &'static str = concat!($package, "/", $name);
            const NAME: &'static str = concat!($package, "/msg/", $name);
        }
    )*};
}
pub(crate) use names;

names! {
    Clock: "rosgraph_msgs" / "Clock";
    TfMessage: "tf2_msgs" / "TFMessage";
    Odometry: "nav_msgs" / "Odometry";
    Path: "nav_msgs" / "Path";
    NavSatFix: "sensor_msgs" / "NavSatFix";
    Imu: "sensor_msgs" / "Imu";
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Vector3, b: [f64; 3]) -> bool {
        [a.x - b[0], a.y - b[1], a.z - b[2]].iter().all(|d| d.abs() < 1e-12)
    }

    #[test]
    fn yaw_pitch_and_roll_turn_as_iso_8855_says() {
        let ahead = Vector3 { x: 1.0, y: 0.0, z: 0.0 };
        let left = Vector3 { x: 0.0, y: 1.0, z: 0.0 };
        let turned = |y, p, r, v| Quaternion::from_yaw_pitch_roll(y, p, r).turn(v);
        assert!(near(turned(0.3, 0.0, 0.0, ahead), [0.3_f64.cos(), 0.3_f64.sin(), 0.0]));
        assert!(near(turned(0.0, 0.1, 0.0, ahead), [0.1_f64.cos(), 0.0, -0.1_f64.sin()]));
        assert!(near(turned(0.0, 0.0, 0.2, left), [0.0, 0.2_f64.cos(), 0.2_f64.sin()]));
    }

    #[test]
    fn a_rotation_is_that_of_its_axes_and_its_inverse_undoes_it() {
        let q = Quaternion::from_yaw_pitch_roll(2.6, -0.4, 0.9);
        let axis = |x, y, z| {
            let v = q.turn(Vector3 { x, y, z });
            [v.x, v.y, v.z]
        };
        let same =
            Quaternion::from_axes(axis(1.0, 0.0, 0.0), axis(0.0, 1.0, 0.0), axis(0.0, 0.0, 1.0));
        let none = q.inverse_times(same);
        assert!((none.w.abs() - 1.0).abs() < 1e-12, "{none:?}");
        let other = Quaternion::from_yaw_pitch_roll(2.9, -0.1, 0.0);
        let v = Vector3 { x: 1.0, y: 2.0, z: 3.0 };
        let twice = q.turn(q.inverse_times(other).turn(v));
        let once = other.turn(v);
        assert!(near(twice, [once.x, once.y, once.z]));
    }
}
