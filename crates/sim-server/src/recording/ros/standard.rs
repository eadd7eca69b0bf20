//! Standard ROS 2 messages that a recording holds (common_interfaces, rcl_interfaces, geometry2).

use serde::Serialize;
use serde_big_array::BigArray;

use super::Message;

/// `builtin_interfaces/msg/Time` and `Duration`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
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
}

/// `geometry_msgs/msg/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Pose {
    pub(crate) position: Vector3,
    pub(crate) orientation: Quaternion,
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

/// `std_msgs/msg/ColorRGBA`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub(crate) struct Color {
    pub(crate) r: f32,
    pub(crate) g: f32,
    pub(crate) b: f32,
    pub(crate) a: f32,
}

/// `sensor_msgs/msg/CompressedImage`; always empty here.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct CompressedImage {
    header: Header,
    format: &'static str,
    data: Vec<u8>,
}

/// `visualization_msgs/msg/MeshFile`; always empty here.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct MeshFile {
    filename: &'static str,
    data: Vec<u8>,
}

/// `visualization_msgs/msg/Marker`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Marker {
    pub(crate) header: Header,
    pub(crate) ns: &'static str,
    pub(crate) id: i32,
    pub(crate) marker_type: i32,
    pub(crate) action: i32,
    pub(crate) pose: Pose,
    pub(crate) scale: Vector3,
    pub(crate) color: Color,
    pub(crate) lifetime: Stamp,
    pub(crate) frame_locked: bool,
    pub(crate) points: Vec<Vector3>,
    pub(crate) colors: Vec<Color>,
    pub(crate) texture_resource: &'static str,
    pub(crate) texture: CompressedImage,
    pub(crate) uv_coordinates: Vec<(f32, f32)>,
    pub(crate) text: &'static str,
    pub(crate) mesh_resource: &'static str,
    pub(crate) mesh_file: MeshFile,
    pub(crate) mesh_use_embedded_materials: bool,
}

/// `visualization_msgs/msg/MarkerArray`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct MarkerArray {
    pub(crate) markers: Vec<Marker>,
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
    MarkerArray: "visualization_msgs" / "MarkerArray";
}
