//! Where the ego's bodies are in the map: poses, boxes and wheels of tractor and trailer.

use road::Road;
use serde::Serialize;
use tractrix_core::{EgoState, Geometry, LateralLimits, Neighbour, VehicleClass, VehicleLimits};

use super::ros::standard::{
    Color, CompressedImage, Header, Marker, MeshFile, Pose, Quaternion, Stamp, Vector3,
};

/// A station on a body, m ahead of the body's origin.
pub(crate) type Ahead = f64;

/// Lengths of the combination as a viewer draws it. Tractor lengths are ahead of the reference
/// point, trailer lengths ahead of the hitch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Combination {
    pub(crate) tractor_front_m: Ahead,
    pub(crate) tractor_rear_m: Ahead,
    pub(crate) hitch_m: Ahead,
    pub(crate) steer_axle_m: Ahead,
    pub(crate) drive_axles_m: Vec<Ahead>,
    pub(crate) trailer_front_m: Ahead,
    pub(crate) trailer_rear_m: Ahead,
    pub(crate) trailer_axles_m: Vec<Ahead>,
    pub(crate) width_m: f64,
}

impl Combination {
    /// From what the truck says about itself: two drive axles, three trailer axles.
    pub(crate) fn new(limits: &VehicleLimits) -> Self {
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

/// Pose of the tractor's reference point on the road.
pub(crate) fn tractor_pose(ego: &EgoState, road: &Road) -> Pose {
    let at = road.at(ego.s_m, ego.d_m);
    Pose {
        position: Vector3 { x: ego.x_m, y: ego.y_m, z: ego.z_m },
        orientation: Quaternion::from_yaw_pitch_roll(ego.yaw_rad, -at.grade_rad, at.bank_rad),
    }
}

/// Boxes of tractor and trailer.
pub(crate) fn ego_markers(header: &Header, ego: &EgoState, c: &Combination) -> [Marker; 2] {
    let trailer_yaw_rad = ego.yaw_rad + ego.trailer.articulation_rad;
    let (sin, cos) = ego.yaw_rad.sin_cos();
    let hitch = (ego.x_m + c.hitch_m * cos, ego.y_m + c.hitch_m * sin);
    let body = |id, origin: (f64, f64), yaw_rad: f64, rear_m: f64, front_m: f64, color| {
        let (sin, cos) = yaw_rad.sin_cos();
        let mid_m = 0.5 * (front_m + rear_m);
        let at = (origin.0 + mid_m * cos, origin.1 + mid_m * sin, ego.z_m);
        cube(header, "ego", id, at, yaw_rad, (front_m - rear_m, c.width_m, TRUCK_HEIGHT_M), color)
    };
    [
        body(0, (ego.x_m, ego.y_m), ego.yaw_rad, c.tractor_rear_m, c.tractor_front_m, TRACTOR),
        body(1, hitch, trailer_yaw_rad, c.trailer_rear_m, c.trailer_front_m, TRAILER),
    ]
}

/// The box of another vehicle.
pub(crate) fn neighbour_marker(header: &Header, n: &Neighbour, road: &Road) -> Marker {
    let height_m = match n.class {
        VehicleClass::Car => 1.5,
        VehicleClass::Van => 2.4,
        VehicleClass::Truck => TRUCK_HEIGHT_M,
    };
    let z_m = road.at(0.5 * (n.front_s_m + n.rear_s_m), n.d_m).z_m;
    let id = i32::try_from(n.id % (1 << 31)).unwrap_or_default();
    let size_m = (n.length_m(), n.width_m, height_m);
    cube(header, "traffic", id, (n.x_m, n.y_m, z_m), n.yaw_rad, size_m, TRAFFIC)
}

const TRUCK_HEIGHT_M: f64 = 3.9;
const TRACTOR: Color = Color { r: 0.18, g: 0.55, b: 0.95, a: 1.0 };
const TRAILER: Color = Color { r: 0.75, g: 0.80, b: 0.86, a: 1.0 };
const TRAFFIC: Color = Color { r: 0.95, g: 0.65, b: 0.20, a: 1.0 };
/// `visualization_msgs/Marker` type of a box.
const CUBE: i32 = 1;
/// A marker that is not renewed disappears after three periods.
const MARKER_LIFETIME: tractrix_core::Time = tractrix_core::Time(300_000_000);

fn cube(
    header: &Header,
    ns: &'static str,
    id: i32,
    (x, y, ground_z): (f64, f64, f64),
    yaw_rad: f64,
    (length_m, width_m, height_m): (f64, f64, f64),
    color: Color,
) -> Marker {
    Marker {
        header: header.clone(),
        ns,
        id,
        marker_type: CUBE,
        action: 0,
        pose: Pose {
            position: Vector3 { x, y, z: ground_z + 0.5 * height_m },
            orientation: Quaternion::from_yaw_pitch_roll(yaw_rad, 0.0, 0.0),
        },
        scale: Vector3 { x: length_m, y: width_m, z: height_m },
        color,
        lifetime: Stamp::of(MARKER_LIFETIME),
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
