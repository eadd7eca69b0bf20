//! What the planning stack decided in one tick, with its reasons.

use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use crate::Command;

/// A wish for a lane change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneChoice {
    /// The lane on the left (the paper's -1).
    Left,
    /// This lane (0).
    #[default]
    Keep,
    /// The lane on the right (1).
    Right,
}

/// The manoeuvre that the stack is driving.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Maneuver {
    /// Stay in the lane.
    #[default]
    KeepLane,
    /// Change to the lane on the left.
    ChangeLeft,
    /// Change to the lane on the right.
    ChangeRight,
    /// Return to the lane that a change had begun to leave.
    AbortChange,
    /// Brake within the lane because something failed.
    MinimalRisk,
}

/// Why a lane change is wished.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneChangeReason {
    /// The own lane ends.
    LaneEnds,
    /// A vehicle ahead in the own lane is slower than the truck would drive.
    SlowerAhead,
    /// The right lane serves as well.
    KeepRight,
    /// The learned policy chose it.
    Policy,
    /// It was asked for from outside.
    Requested,
}

/// Why a requested lane change is not driven (the paper's Fig. 14 and the rules around it).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LaneChangeRefusal {
    /// Fig. 14 (a): the target lane does not exist.
    NoTargetLane,
    /// Fig. 14 (b): the gap to the vehicle ahead in the target lane is too small.
    UnsafeFront,
    /// Fig. 14 (b): the gap to the vehicle behind in the target lane is too small.
    UnsafeRear,
    /// Fig. 14 (b): the gap to the vehicle ahead in the own lane closes during the change.
    UnsafeOwnLane,
    /// Another vehicle is alongside.
    Occupied,
    /// No path keeps the limits of the loaded truck.
    NoFeasiblePath,
    /// A change is already under way, or the last one is too recent.
    Busy,
}

/// Outcome of the speed planner in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanStatus {
    /// Cruise control, no optimisation asked for.
    #[default]
    Cruise,
    /// Optimal within tolerance.
    Solved,
    /// Usable, but the solver stopped early.
    AlmostSolved,
    /// The last valid profile is still being driven.
    LastProfile,
    /// No profile: cruise control drives.
    Fallback,
}

/// Why the guard changed a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GuardReason {
    /// A value was outside its range.
    Range,
    /// A value changed faster than allowed.
    Rate,
    /// An input is too old.
    Stale,
    /// A number is NaN or infinite.
    NonFinite,
    /// An input did not change although it must.
    Frozen,
    /// An input jumped further than physics allows.
    Jump,
    /// The vehicle ahead is closer than the safe gap.
    Headway,
    /// The planner returned no plan.
    NoPlan,
    /// The truck or its bus is not in order: a lost signal, wrong counters, the bus gone or flooded.
    Bus,
    /// Somebody on the bus pretends to be somebody else.
    Intruder,
    /// The driver has taken over; nothing is asked of the truck.
    Driver,
}

impl GuardReason {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Range,
        Self::Rate,
        Self::Stale,
        Self::NonFinite,
        Self::Frozen,
        Self::Jump,
        Self::Headway,
        Self::NoPlan,
        Self::Bus,
        Self::Intruder,
        Self::Driver,
    ];
}

/// A point of the planned path.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PathPoint {
    /// Time from now, s.
    pub time_s: f64,
    /// Station, m.
    pub s_m: f64,
    /// Offset from the reference line, m.
    pub d_m: f64,
    /// Map x, m.
    pub x_m: f64,
    /// Map y, m.
    pub y_m: f64,
    /// Heading, rad.
    pub yaw_rad: f64,
    /// Path curvature, 1/m, positive left.
    pub curvature_1_m: f64,
}

/// A point of the planned speed profile.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SpeedPoint {
    /// Station, m.
    pub s_m: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Acceleration, m/s².
    pub accel_m_s2: f64,
}

/// The stack's output of one tick.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Plan {
    /// The manoeuvre.
    pub maneuver: Maneuver,
    /// Why the lane change is wished that is driven, or that was refused in this tick.
    pub reason: Option<LaneChangeReason>,
    /// Why a requested lane change was refused in this tick.
    pub refusal: Option<LaneChangeRefusal>,
    /// Outcome of the speed planner.
    pub speed_status: PlanStatus,
    /// Reference speed at the ego's position, m/s, before traffic.
    pub reference_speed_m_s: f64,
    /// Speed that the controller is following, m/s, with traffic.
    pub target_speed_m_s: f64,
    /// Acceleration that the controller is following, m/s².
    pub target_accel_m_s2: f64,
    /// Lateral offset that the controller is following at the ego's station, m.
    pub target_d_m: f64,
    /// Lateral error of the reference point from the planned path, m, positive left.
    pub lateral_error_m: f64,
    /// Lane track that the ego is in (or leaves).
    pub lane: u16,
    /// The planned path, a few seconds ahead.
    pub path: Vec<PathPoint>,
    /// The planned speed profile, from the ego on.
    pub speed: Vec<SpeedPoint>,
    /// Identifier of the vehicle being followed.
    pub following: Option<u64>,
    /// Traffic holds the truck up: car following asks for less than the reference, the speed plan is
    /// made for staying behind a vehicle, a lane change slows into its gap, or the truck waits for
    /// one at its lane's end.
    pub held_up: bool,
    /// The guarded command.
    pub command: Command,
    /// What the guard changed, in the order of [`GuardReason::ALL`].
    pub guard: Vec<GuardReason>,
}
