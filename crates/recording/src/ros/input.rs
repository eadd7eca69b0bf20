//! Messages that hold what the stack and its bus were given, read again as they were written.

use serde::{Deserialize, Serialize};

use super::Message;
use super::standard::{Stamp, names};

/// `truck_msgs/msg/StackInput`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct StackInput {
    pub(crate) now_ns: i64,
    pub(crate) has_ego: bool,
    pub(crate) has_scene: bool,
    pub(crate) ego_time_ns: i64,
    pub(crate) scene_time_ns: i64,
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) z_m: f64,
    pub(crate) yaw_rad: f64,
    pub(crate) s_m: f64,
    pub(crate) d_m: f64,
    pub(crate) speed_m_s: f64,
    pub(crate) lateral_speed_m_s: f64,
    pub(crate) accel_x_m_s2: f64,
    pub(crate) accel_y_m_s2: f64,
    pub(crate) yaw_rate_rad_s: f64,
    pub(crate) articulation_rad: f64,
    pub(crate) trailer_yaw_rate_rad_s: f64,
    pub(crate) road_wheel_rad: f64,
    pub(crate) steering_wheel_rad: f64,
    pub(crate) load_transfer_ratio: f64,
    pub(crate) engine_speed_rad_s: f64,
    pub(crate) engine_torque_nm: f64,
    pub(crate) engine_friction_torque_nm: f64,
    pub(crate) engine_power_w: f64,
    pub(crate) drive_force_n: f64,
    pub(crate) brake_force_n: f64,
    pub(crate) brake_pressure_pa: f64,
    pub(crate) retarder_force_n: f64,
    pub(crate) gear: u8,
    pub(crate) shift_in_progress: bool,
    pub(crate) fuel_rate_g_s: f64,
    pub(crate) fuel_used_g: f64,
    pub(crate) accelerator_pedal_frac: f64,
    pub(crate) xbr_decel_m_s2: f64,
    pub(crate) brake_mode: u8,
    pub(crate) command_steering_wheel_rad: f64,
    pub(crate) command_retarder_frac: f64,
    pub(crate) gear_request: u8,
    pub(crate) requested_gear: u8,
    pub(crate) set_speed_m_s: f64,
    pub(crate) lane_wish: i8,
    pub(crate) limit_cap_m_s: f64,
    pub(crate) faults: u16,
    pub(crate) fault_since_ns: [i64; 10],
    pub(crate) timed_signals: u8,
    pub(crate) signal_age_s: [f64; 8],
}

/// `truck_msgs/msg/StackScene`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StackScene {
    pub(crate) now_ns: i64,
    pub(crate) differences: Vec<u8>,
}

/// `truck_msgs/msg/StackLimits`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StackLimits {
    pub(crate) now_ns: i64,
    pub(crate) sheet_toml: String,
}

/// `truck_msgs/msg/StackChange`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StackChange {
    pub(crate) now_ns: i64,
    pub(crate) change_toml: String,
}

/// `truck_msgs/msg/BusTick`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct BusTick {
    pub(crate) now_ns: i64,
    pub(crate) number: u32,
    pub(crate) received: u32,
    pub(crate) sent: u32,
    pub(crate) wish: u8,
}

/// `std_msgs/msg/Header` of a frame, whose `frame_id` is the frame's way.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FrameHeader {
    pub(crate) stamp: Stamp,
    pub(crate) frame_id: String,
}

/// `can_msgs/msg/Frame`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CanFrame {
    pub(crate) header: FrameHeader,
    pub(crate) id: u32,
    pub(crate) is_rtr: bool,
    pub(crate) is_extended: bool,
    pub(crate) is_error: bool,
    pub(crate) dlc: u8,
    pub(crate) data: [u8; 8],
}

names! {
    StackInput: "truck_msgs" / "StackInput";
    StackScene: "truck_msgs" / "StackScene";
    StackLimits: "truck_msgs" / "StackLimits";
    StackChange: "truck_msgs" / "StackChange";
    BusTick: "truck_msgs" / "BusTick";
    CanFrame: "can_msgs" / "Frame";
}
