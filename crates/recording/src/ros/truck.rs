//! Own messages, for what has no standard one; fields as in `msg/truck_msgs/msg/*.msg`.

use serde::Serialize;
use tractrix_core::{
    BrakeMode, Command, EgoState, GearRequest, Neighbour, Plan, RPM_PER_RAD_S, VehicleClass,
};

use super::Message;
use super::standard::{Header, names};

/// `truck_msgs/msg/TruckState`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TruckState {
    header: Header,
    s_m: f64,
    d_m: f64,
    grade_rad: f64,
    speed_m_s: f64,
    lateral_speed_m_s: f64,
    accel_x_m_s2: f64,
    accel_y_m_s2: f64,
    yaw_rate_rad_s: f64,
    articulation_rad: f64,
    trailer_yaw_rate_rad_s: f64,
    road_wheel_rad: f64,
    steering_wheel_rad: f64,
    load_transfer_ratio: f64,
    engine_speed_rpm: f64,
    engine_torque_nm: f64,
    engine_friction_torque_nm: f64,
    engine_power_w: f64,
    drive_force_n: f64,
    brake_force_n: f64,
    brake_pressure_pa: f64,
    retarder_force_n: f64,
    gear: u8,
    shift_in_progress: bool,
    fuel_rate_g_s: f64,
    fuel_used_g: f64,
    accelerator_pedal_frac: f64,
    xbr_decel_m_s2: f64,
    brake_mode: u8,
    command_steering_wheel_rad: f64,
    command_retarder_frac: f64,
    gear_request: u8,
    requested_gear: u8,
}

impl TruckState {
    /// From the contract types.
    pub(crate) fn new(header: Header, ego: &EgoState, grade_rad: f64, command: &Command) -> Self {
        let p = &ego.powertrain;
        let (gear_request, requested_gear) = gear_codes(command.gear);
        Self {
            header,
            s_m: ego.s_m,
            d_m: ego.d_m,
            grade_rad,
            speed_m_s: ego.speed_m_s,
            lateral_speed_m_s: ego.lateral_speed_m_s,
            accel_x_m_s2: ego.accel_x_m_s2,
            accel_y_m_s2: ego.accel_y_m_s2,
            yaw_rate_rad_s: ego.yaw_rate_rad_s,
            articulation_rad: ego.trailer.articulation_rad,
            trailer_yaw_rate_rad_s: ego.trailer.yaw_rate_rad_s,
            road_wheel_rad: ego.road_wheel_rad,
            steering_wheel_rad: ego.steering_wheel_rad,
            load_transfer_ratio: ego.load_transfer_ratio,
            engine_speed_rpm: p.engine_speed_rad_s * RPM_PER_RAD_S,
            engine_torque_nm: p.engine_torque_nm,
            engine_friction_torque_nm: p.engine_friction_torque_nm,
            engine_power_w: p.engine_power_w,
            drive_force_n: p.drive_force_n,
            brake_force_n: p.brake_force_n,
            brake_pressure_pa: p.brake_pressure_pa,
            retarder_force_n: p.retarder_force_n,
            gear: p.gear,
            shift_in_progress: p.shift_in_progress,
            fuel_rate_g_s: p.fuel_rate_g_s,
            fuel_used_g: p.fuel_used_g,
            accelerator_pedal_frac: command.accelerator_pedal_frac,
            xbr_decel_m_s2: command.xbr_decel_m_s2,
            brake_mode: brake_code(command.brake_mode),
            command_steering_wheel_rad: command.steering_wheel_rad,
            command_retarder_frac: command.retarder_frac,
            gear_request,
            requested_gear,
        }
    }
}

/// The code of a brake mode.
pub(crate) const fn brake_code(mode: BrakeMode) -> u8 {
    match mode {
        BrakeMode::Off => 0,
        BrakeMode::Addition => 1,
        BrakeMode::Maximum => 2,
    }
}

/// The code of a gear request, and its gear.
pub(crate) const fn gear_codes(request: GearRequest) -> (u8, u8) {
    match request {
        GearRequest::Automatic => (0, 0),
        GearRequest::Gear(gear) => (1, gear),
        GearRequest::Neutral => (2, 0),
    }
}

/// `truck_msgs/msg/PlanState`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct PlanState {
    header: Header,
    maneuver: String,
    refusal: String,
    speed_status: String,
    reference_speed_m_s: f64,
    target_speed_m_s: f64,
    target_accel_m_s2: f64,
    target_d_m: f64,
    lateral_error_m: f64,
    lane: u16,
    is_following: bool,
    following_id: u64,
    guard: Vec<String>,
    reason: String,
}

impl PlanState {
    /// From the contract type.
    pub(crate) fn new(header: Header, plan: &Plan) -> Self {
        Self {
            header,
            maneuver: word(&plan.maneuver),
            refusal: plan.refusal.as_ref().map(word).unwrap_or_default(),
            speed_status: word(&plan.speed_status),
            reference_speed_m_s: plan.reference_speed_m_s,
            target_speed_m_s: plan.target_speed_m_s,
            target_accel_m_s2: plan.target_accel_m_s2,
            target_d_m: plan.target_d_m,
            lateral_error_m: plan.lateral_error_m,
            lane: plan.lane,
            is_following: plan.following.is_some(),
            following_id: plan.following.unwrap_or_default(),
            guard: plan.guard.iter().map(word).collect(),
            reason: plan.reason.as_ref().map(word).unwrap_or_default(),
        }
    }
}

/// The contract's word for a value of a field-less enum.
pub(crate) fn word(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    }
}

/// `truck_msgs/msg/SceneVehicle`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct SceneVehicle {
    id: u64,
    vehicle_class: u8,
    front_s_m: f64,
    rear_s_m: f64,
    d_m: f64,
    width_m: f64,
    speed_m_s: f64,
    lateral_speed_m_s: f64,
    accel_m_s2: f64,
    lane: u16,
}

/// The number of a class in every message.
pub(crate) const fn class_code(class: VehicleClass) -> u8 {
    match class {
        VehicleClass::Car => 0,
        VehicleClass::Van => 1,
        VehicleClass::Truck => 2,
        VehicleClass::Emergency => 3,
        VehicleClass::Barrier => 4,
    }
}

impl From<&Neighbour> for SceneVehicle {
    fn from(n: &Neighbour) -> Self {
        Self {
            id: n.id,
            vehicle_class: class_code(n.class),
            front_s_m: n.front_s_m,
            rear_s_m: n.rear_s_m,
            d_m: n.d_m,
            width_m: n.width_m,
            speed_m_s: n.speed_m_s,
            lateral_speed_m_s: n.lateral_speed_m_s,
            accel_m_s2: n.accel_m_s2,
            lane: n.lane,
        }
    }
}

/// `truck_msgs/msg/Scene`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Scene {
    pub(crate) header: Header,
    pub(crate) vehicles: Vec<SceneVehicle>,
}

names! {
    TruckState: "truck_msgs" / "TruckState";
    PlanState: "truck_msgs" / "PlanState";
    Scene: "truck_msgs" / "Scene";
}
