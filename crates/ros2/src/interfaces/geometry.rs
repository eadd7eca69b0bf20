//! `std_msgs` and `geometry_msgs`, owned.

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/msg/Time`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Stamp {
    sec: i32,
    nanosec: u32,
}

impl Stamp {
    /// Of a simulation time, ns.
    pub(crate) fn of(time_ns: i64) -> Self {
        const SECOND: i64 = 1_000_000_000;
        let sec = i32::try_from(time_ns.div_euclid(SECOND)).unwrap_or(i32::MAX);
        Self { sec, nanosec: u32::try_from(time_ns.rem_euclid(SECOND)).unwrap_or_default() }
    }
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Header {
    pub(crate) stamp: Stamp,
    pub(crate) frame_id: String,
}

/// `geometry_msgs/msg/Vector3`, and `Point`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Vector3 {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

/// `geometry_msgs/msg/Quaternion`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Quaternion {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
    pub(crate) w: f64,
}

/// `geometry_msgs/msg/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Pose {
    pub(crate) position: Vector3,
    pub(crate) orientation: Quaternion,
}

/// `geometry_msgs/msg/Twist`, and `Accel`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Twist {
    pub(crate) linear: Vector3,
    pub(crate) angular: Vector3,
}
