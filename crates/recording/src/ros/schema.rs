//! Message definitions of the ROS 2 types that a recording holds, as MCAP schemas want them.
//!
//! A schema's data is the type's own `.msg` text followed by those of all types that it uses, each
//! behind a line of 80 equals signs and `MSG: package/Type` (MCAP specification, `ros2msg`
//! encoding). Field lists are those of ROS 2 Jazzy; the comments are left out.

/// The `.msg` texts. Names as in a definition: `package/Type`.
const DEFINITIONS: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"),
    ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"),
    (
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    ),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    ("rosgraph_msgs/Clock", "builtin_interfaces/Time clock\n"),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    (
        "nav_msgs/Odometry",
        "std_msgs/Header header\nstring child_frame_id\n\
         geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
    ),
    ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
    (
        "sensor_msgs/NavSatStatus",
        "int8 STATUS_NO_FIX=-1\nint8 STATUS_FIX=0\nint8 STATUS_SBAS_FIX=1\n\
         int8 STATUS_GBAS_FIX=2\nint8 status\n\
         uint16 SERVICE_GPS=1\nuint16 SERVICE_GLONASS=2\nuint16 SERVICE_COMPASS=4\n\
         uint16 SERVICE_GALILEO=8\nuint16 service\n",
    ),
    (
        "sensor_msgs/NavSatFix",
        "std_msgs/Header header\nsensor_msgs/NavSatStatus status\n\
         float64 latitude\nfloat64 longitude\nfloat64 altitude\n\
         float64[9] position_covariance\nuint8 COVARIANCE_TYPE_UNKNOWN=0\n\
         uint8 COVARIANCE_TYPE_APPROXIMATED=1\nuint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\n\
         uint8 COVARIANCE_TYPE_KNOWN=3\nuint8 position_covariance_type\n",
    ),
    (
        "sensor_msgs/Imu",
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n\
         float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n\
         float64[9] angular_velocity_covariance\n\
         geometry_msgs/Vector3 linear_acceleration\n\
         float64[9] linear_acceleration_covariance\n",
    ),
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    (
        "diagnostic_msgs/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\n\
         string message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n",
    ),
    (
        "diagnostic_msgs/DiagnosticArray",
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
    ),
    ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n"),
    ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n"),
    ("visualization_msgs/MarkerArray", "visualization_msgs/Marker[] markers\n"),
    (
        "visualization_msgs/Marker",
        "int32 ARROW=0\nint32 CUBE=1\nint32 SPHERE=2\nint32 CYLINDER=3\nint32 LINE_STRIP=4\n\
         int32 LINE_LIST=5\nint32 CUBE_LIST=6\nint32 SPHERE_LIST=7\nint32 POINTS=8\n\
         int32 TEXT_VIEW_FACING=9\nint32 MESH_RESOURCE=10\nint32 TRIANGLE_LIST=11\n\
         int32 ARROW_STRIP=12\nint32 ADD=0\nint32 MODIFY=0\nint32 DELETE=2\nint32 DELETEALL=3\n\
         std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\n\
         geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n\
         builtin_interfaces/Duration lifetime\nbool frame_locked\n\
         geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n\
         string texture_resource\nsensor_msgs/CompressedImage texture\n\
         visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n\
         visualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n",
    ),
    (
        "can_msgs/Frame",
        "std_msgs/Header header\nuint32 id\nbool is_rtr\nbool is_extended\nbool is_error\n\
         uint8 dlc\nuint8[8] data\n",
    ),
    ("truck_msgs/TruckState", include_str!("../../msg/truck_msgs/msg/TruckState.msg")),
    ("truck_msgs/PlanState", include_str!("../../msg/truck_msgs/msg/PlanState.msg")),
    ("truck_msgs/Scene", include_str!("../../msg/truck_msgs/msg/Scene.msg")),
    ("truck_msgs/SceneVehicle", include_str!("../../msg/truck_msgs/msg/SceneVehicle.msg")),
    ("truck_msgs/StackInput", include_str!("../../msg/truck_msgs/msg/StackInput.msg")),
    ("truck_msgs/StackScene", include_str!("../../msg/truck_msgs/msg/StackScene.msg")),
    ("truck_msgs/StackLimits", include_str!("../../msg/truck_msgs/msg/StackLimits.msg")),
    ("truck_msgs/StackChange", include_str!("../../msg/truck_msgs/msg/StackChange.msg")),
    ("truck_msgs/BusTick", include_str!("../../msg/truck_msgs/msg/BusTick.msg")),
];

fn definition(name: &str) -> Option<&'static str> {
    DEFINITIONS.iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
}

/// Types named in a definition, in order of first use.
fn used_types(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .filter_map(|line| line.split_whitespace().next())
        .map(|field_type| field_type.split('[').next().unwrap_or(field_type))
        .filter(|name| name.contains('/'))
}

/// The schema text of a type, dependencies included; none for a type that is not recorded.
pub(crate) fn schema_text(name: &str) -> Option<String> {
    let mut order = vec![name];
    let mut next = 0;
    let mut text = String::new();
    while let Some(&current) = order.get(next) {
        let own = definition(current)?;
        if next > 0 {
            text.push_str(&"=".repeat(80));
            text.push_str(&format!("\nMSG: {current}\n"));
        }
        text.push_str(own);
        for used in used_types(own) {
            if !order.contains(&used) {
                order.push(used);
            }
        }
        next += 1;
    }
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_that_a_definition_uses_is_defined() {
        for (name, text) in DEFINITIONS {
            for used in used_types(text) {
                assert!(definition(used).is_some(), "{name} uses {used}");
            }
        }
    }

    #[test]
    fn a_schema_names_each_dependency_once() {
        let text = schema_text("nav_msgs/Odometry").unwrap();
        assert_eq!(text.matches("MSG: geometry_msgs/Vector3\n").count(), 1);
        assert!(text.starts_with("std_msgs/Header header\n"));
        assert!(schema_text("no_such/Type").is_none());
    }
}
