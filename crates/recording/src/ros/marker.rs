//! Markers of ROS 2 (visualization_msgs): what a 3D view draws.

use serde::Serialize;
use tractrix_core::Time;

use super::Message;
use super::standard::{Header, Pose, Quaternion, Stamp, Vector3, names};

/// `Marker` types.
const CUBE: i32 = 1;
const LINE_STRIP: i32 = 4;
const LINE_LIST: i32 = 5;
/// A box that is not renewed disappears after three periods.
const LIFETIME: Time = Time(300_000_000);

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

impl Marker {
    /// A box around a pose; it disappears when it is not renewed for three periods.
    pub(crate) fn cube(header: &Header, ns: &'static str, id: i32, pose: Pose) -> Self {
        Self { pose, lifetime: Stamp::of(LIFETIME), ..Self::of(header, CUBE, ns, id) }
    }

    /// Lines in the header's frame that stay: one through all points, or one per pair of points.
    pub(crate) fn lines(
        header: &Header,
        ns: &'static str,
        id: i32,
        points: Vec<Vector3>,
        as_pairs: bool,
    ) -> Self {
        let kind = if as_pairs { LINE_LIST } else { LINE_STRIP };
        Self { points, ..Self::of(header, kind, ns, id) }
    }

    fn of(header: &Header, marker_type: i32, ns: &'static str, id: i32) -> Self {
        Self {
            header: header.clone(),
            ns,
            id,
            marker_type,
            action: 0,
            pose: Pose {
                position: Vector3::default(),
                orientation: Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 },
            },
            scale: Vector3::default(),
            color: Color::default(),
            lifetime: Stamp::default(),
            frame_locked: false,
            points: Vec::new(),
            colors: Vec::new(),
            texture_resource: "",
            texture: CompressedImage::default(),
            uv_coordinates: Vec::new(),
            text: "",
            mesh_resource: "",
            mesh_file: MeshFile::default(),
            mesh_use_embedded_materials: false,
        }
    }
}

/// `visualization_msgs/msg/MarkerArray`.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(crate) struct MarkerArray {
    pub(crate) markers: Vec<Marker>,
}

names! {
    MarkerArray: "visualization_msgs" / "MarkerArray";
}
