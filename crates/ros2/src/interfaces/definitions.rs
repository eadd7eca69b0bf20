//! The field lists of the interfaces that a peer needs and no Python wheel brings, as the packages
//! `simulation_interfaces` 2.1.0 define them; comments are left out. Peers build them with
//! `rosidl`.

/// A file of an interface package: its path in the package and its text.
pub type Definition = (&'static str, &'static str);

/// Package `simulation_interfaces`: what this node speaks of it.
pub const SIMULATION_INTERFACES: &[Definition] = &[
    (
        "msg/EntityCategory.msg",
        "uint8 CATEGORY_OBJECT=0\nuint8 CATEGORY_ROBOT=1\nuint8 CATEGORY_HUMAN=2\n\
         uint8 CATEGORY_DYNAMIC_OBJECT=4\nuint8 CATEGORY_STATIC_OBJECT=5\nuint8 category\n",
    ),
    (
        "msg/TagsFilter.msg",
        "string[] tags\nuint8 FILTER_MODE_ANY=0\nuint8 FILTER_MODE_ALL=1\nuint8 filter_mode\n",
    ),
    (
        "msg/Bounds.msg",
        "uint8 TYPE_EMPTY=0\nuint8 TYPE_BOX=1\nuint8 TYPE_CONVEX_HULL=2\nuint8 TYPE_SPHERE=3\n\
         uint8 type\ngeometry_msgs/Vector3[] points\n",
    ),
    (
        "msg/EntityFilters.msg",
        "string filter\nEntityCategory[] categories\nTagsFilter tags\nBounds bounds\n",
    ),
    (
        "msg/EntityState.msg",
        "std_msgs/Header header\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\n\
         geometry_msgs/Accel acceleration\n",
    ),
    (
        "msg/Result.msg",
        "uint8 RESULT_FEATURE_UNSUPPORTED=0\nuint8 RESULT_OK=1\nuint8 RESULT_NOT_FOUND=2\n\
         uint8 RESULT_INCORRECT_STATE=3\nuint8 RESULT_OPERATION_FAILED=4\nuint8 result\n\
         string error_message\n",
    ),
    (
        "msg/SimulationState.msg",
        "uint8 STATE_STOPPED=0\nuint8 STATE_PLAYING=1\nuint8 STATE_PAUSED=2\n\
         uint8 STATE_QUITTING=3\nuint8 STATE_NO_WORLD=4\nuint8 STATE_LOADING_WORLD=5\n\
         uint8 state\n",
    ),
    (
        "msg/SimulatorFeatures.msg",
        "uint8 ENTITY_CATEGORIES=8\nuint8 ENTITY_STATE_GETTING=10\nuint8 SIMULATION_RESET=20\n\
         uint8 SIMULATION_STATE_GETTING=24\nuint8 SIMULATION_STATE_SETTING=25\n\
         uint8 SIMULATION_STATE_PAUSE=26\nuint8 STEP_SIMULATION_SINGLE=31\n\
         uint8 STEP_SIMULATION_MULTIPLE=32\nuint8 STEP_SIMULATION_ACTION=33\nuint8 WORLD_LOADING=40\n\
         uint8 WORLD_RESOURCE_STRING=41\nuint8 WORLD_INFO_GETTING=44\n\
         uint8 AVAILABLE_WORLDS=45\nuint16[] features\nstring[] spawn_formats\n\
         string custom_info\n",
    ),
    ("msg/Resource.msg", "string uri\nstring resource_string\n"),
    (
        "msg/WorldResource.msg",
        "string name\nResource world_resource\nstring description\nstring[] tags\n",
    ),
    ("srv/GetSimulatorFeatures.srv", "---\nSimulatorFeatures features\n"),
    ("srv/GetSimulationState.srv", "---\nSimulationState state\nResult result\n"),
    (
        "srv/SetSimulationState.srv",
        "SimulationState state\n---\nuint8 ALREADY_IN_TARGET_STATE=101\n\
         uint8 STATE_TRANSITION_ERROR=102\nuint8 INCORRECT_TRANSITION=103\nResult result\n",
    ),
    (
        "srv/ResetSimulation.srv",
        "uint8 SCOPE_DEFAULT=0\nuint8 SCOPE_TIME=1\nuint8 SCOPE_STATE=2\nuint8 SCOPE_SPAWNED=4\n\
         uint8 SCOPE_ALL=255\nuint8 scope\n---\nResult result\n",
    ),
    ("srv/StepSimulation.srv", "uint64 steps 1\n---\nResult result\n"),
    (
        "action/SimulateSteps.action",
        "uint64 steps\n---\nResult result\n---\nuint64 completed_steps\nuint64 remaining_steps\n",
    ),
    ("srv/GetEntities.srv", "EntityFilters filters\n---\nResult result\nstring[] entities\n"),
    (
        "srv/GetEntitiesStates.srv",
        "EntityFilters filters\n---\nResult result\nstring[] entities\nEntityState[] states\n",
    ),
    ("srv/GetEntityState.srv", "string entity\n---\nResult result\nEntityState state\n"),
    (
        "srv/LoadWorld.srv",
        "Resource world_resource\nbool fail_on_unsupported_element\n\
         bool ignore_missing_or_unsupported_assets\n---\nuint8 UNSUPPORTED_FORMAT=101\n\
         uint8 NO_RESOURCE=102\nuint8 RESOURCE_PARSE_ERROR=103\nuint8 MISSING_ASSETS=104\n\
         uint8 UNSUPPORTED_ASSETS=105\nuint8 UNSUPPORTED_ELEMENTS=106\nResult result\n\
         WorldResource world\n",
    ),
    (
        "srv/GetCurrentWorld.srv",
        "---\nuint8 NO_WORLD_LOADED=101\nResult result\nWorldResource world\n",
    ),
    (
        "srv/GetAvailableWorlds.srv",
        "string[] additional_sources\nTagsFilter filter\nbool offline_only\n\
         bool continue_on_error\n---\nuint8 DEFAULT_SOURCES_FAILED=101\nResult result\n\
         WorldResource[] worlds\n",
    ),
];

/// Package `autoware_control_msgs`: how another controller drives the truck.
pub const AUTOWARE_CONTROL_MSGS: &[Definition] = &[
    (
        "msg/Lateral.msg",
        "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\n\
         float32 steering_tire_angle\nfloat32 steering_tire_rotation_rate\n\
         bool is_defined_steering_tire_rotation_rate\n",
    ),
    (
        "msg/Longitudinal.msg",
        "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\nfloat32 velocity\n\
         float32 acceleration\nfloat32 jerk\nbool is_defined_acceleration\nbool is_defined_jerk\n",
    ),
    (
        "msg/Control.msg",
        "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\nLateral lateral\n\
         Longitudinal longitudinal\n",
    ),
];

/// Package `autoware_vehicle_msgs`: what this node says under Autoware's names.
pub const AUTOWARE_VEHICLE_MSGS: &[Definition] = &[
    (
        "msg/VelocityReport.msg",
        "std_msgs/Header header\nfloat32 longitudinal_velocity\nfloat32 lateral_velocity\n\
         float32 heading_rate\n",
    ),
    ("msg/SteeringReport.msg", "builtin_interfaces/Time stamp\nfloat32 steering_tire_angle\n"),
    (
        "msg/GearReport.msg",
        "uint8 NONE=0\nuint8 NEUTRAL=1\nuint8 DRIVE=2\nbuiltin_interfaces/Time stamp\nuint8 report\n",
    ),
    (
        "msg/ControlModeReport.msg",
        "uint8 NO_COMMAND=0\nuint8 AUTONOMOUS=1\nuint8 MANUAL=4\n\
         builtin_interfaces/Time stamp\nuint8 mode\n",
    ),
];

/// Package `can_msgs`: what this node speaks of it.
pub const CAN_MSGS: &[Definition] = &[(
    "msg/Frame.msg",
    "std_msgs/Header header\nuint32 id\nbool is_rtr\nbool is_extended\nbool is_error\nuint8 dlc\n\
     uint8[8] data\n",
)];

/// Package `tf2_msgs`: what this node speaks of it.
pub const TF2_MSGS: &[Definition] =
    &[("msg/TFMessage.msg", "geometry_msgs/TransformStamped[] transforms\n")];
