//! One telemetry frame: what the page shows of one tick.

use road::Road;
use serde::Serialize;
use sim::GhostReport;
use tractrix_core::{
    EgoState, GuardReason, LaneChangeReason, LaneChangeRefusal, Maneuver, Neighbour, Plan,
    PlanStatus, RPM_PER_RAD_S, Scene, Time, VehicleClass,
};

use super::ahead::{Lead, SpeedAhead};
use super::strip::round;
use crate::provenance::Provenance;
use crate::session::{Pace, RunState, Settings};

/// The frame sent to viewers and answered by `/api/v1/state`.
#[derive(Debug, Serialize)]
pub(super) struct Frame<'a, R> {
    #[serde(flatten)]
    pub(super) provenance: Provenance,
    /// Tells frames from strip columns on the WebSocket.
    pub(super) kind: &'static str,
    /// Another run answers on the same port with another one.
    pub(super) run_id: &'a str,
    pub(super) time_s: f64,
    /// How the run goes, or went.
    pub(super) run: R,
    pub(super) ego: Ego,
    pub(super) road: Here,
    pub(super) plan: Planned<'a>,
    /// The vehicle ahead.
    pub(super) lead: Option<Lead>,
    pub(super) speed_ahead: &'a SpeedAhead,
    /// None where no ghost drives along.
    pub(super) ghost: Option<GhostHere>,
    pub(super) neighbours: Vec<Other>,
}

/// How the run goes.
#[derive(Debug, Serialize)]
pub(super) struct Run<'a> {
    pub(super) scenario: &'a str,
    pub(super) state: RunState,
    /// Lane changes are wished from outside.
    pub(super) external_decider: bool,
    #[serde(flatten)]
    pub(super) settings: Settings,
    pub(super) pace: Pace,
    /// Simulated seconds per second since the last frame but a few.
    pub(super) realtime_factor: f64,
    pub(super) distance_m: f64,
    pub(super) mean_speed_m_s: f64,
    pub(super) lane_changes: u32,
    pub(super) collisions: u32,
    pub(super) guard_activations: u64,
    /// A wheel is beyond the paved lanes.
    pub(super) off_road: bool,
    pub(super) off_road_events: u32,
    pub(super) off_road_time_s: f64,
    pub(super) max_lateral_error_m: f64,
    pub(super) min_time_to_collision_s: Option<f64>,
    pub(super) set_speed_m_s: f64,
    /// The last lane change that was wished and not driven.
    pub(super) last_refusal: Option<Refused>,
}

/// A lane change that was wished and not driven.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Refused {
    pub(super) refusal: LaneChangeRefusal,
    /// Why it was wished.
    pub(super) reason: Option<LaneChangeReason>,
    pub(super) time_s: f64,
}

/// The truck.
#[derive(Debug, Serialize)]
pub(super) struct Ego {
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    s_m: f64,
    d_m: f64,
    speed_m_s: f64,
    accel_x_m_s2: f64,
    accel_y_m_s2: f64,
    yaw_rate_rad_s: f64,
    articulation_rad: f64,
    road_wheel_rad: f64,
    steering_wheel_rad: f64,
    load_transfer_ratio: f64,
    engine_speed_rpm: f64,
    engine_torque_nm: f64,
    engine_power_w: f64,
    gear: u8,
    shift_in_progress: bool,
    brake_force_n: f64,
    retarder_force_n: f64,
    fuel_rate_g_s: f64,
    fuel_used_g: f64,
}

impl From<&EgoState> for Ego {
    fn from(e: &EgoState) -> Self {
        let p = &e.powertrain;
        Self {
            x_m: round(e.x_m, 1e3),
            y_m: round(e.y_m, 1e3),
            yaw_rad: round(e.yaw_rad, 1e5),
            s_m: round(e.s_m, 1e2),
            d_m: round(e.d_m, 1e3),
            speed_m_s: round(e.speed_m_s, 1e3),
            accel_x_m_s2: round(e.accel_x_m_s2, 1e3),
            accel_y_m_s2: round(e.accel_y_m_s2, 1e3),
            yaw_rate_rad_s: round(e.yaw_rate_rad_s, 1e5),
            articulation_rad: round(e.trailer.articulation_rad, 1e5),
            road_wheel_rad: round(e.road_wheel_rad, 1e5),
            steering_wheel_rad: round(e.steering_wheel_rad, 1e4),
            load_transfer_ratio: round(e.load_transfer_ratio, 1e3),
            engine_speed_rpm: round(p.engine_speed_rad_s * RPM_PER_RAD_S, 1.0),
            engine_torque_nm: round(p.engine_torque_nm, 1.0),
            engine_power_w: round(p.engine_power_w, 0.01),
            gear: p.gear,
            shift_in_progress: p.shift_in_progress,
            brake_force_n: round(p.brake_force_n, 0.1),
            retarder_force_n: round(p.retarder_force_n, 0.1),
            fuel_rate_g_s: round(p.fuel_rate_g_s, 1e2),
            fuel_used_g: round(p.fuel_used_g, 10.0),
        }
    }
}

/// The ghost: where it is on the map, and the comparison with it.
#[derive(Debug, Serialize)]
pub(super) struct GhostHere {
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    #[serde(flatten)]
    report: GhostReport,
}

impl GhostHere {
    pub(super) fn new(road: &Road, report: GhostReport) -> Self {
        let at = road.at(report.s_m, report.d_m);
        Self {
            x_m: round(at.x_m, 1e3),
            y_m: round(at.y_m, 1e3),
            yaw_rad: round(at.heading_rad, 1e5),
            report,
        }
    }
}

/// The road under the reference point.
#[derive(Debug, Serialize)]
pub(super) struct Here {
    grade_frac: f64,
    curvature_1_m: f64,
    speed_limit_m_s: f64,
}

impl Here {
    pub(super) fn new(road: &Road, ego: &EgoState, lane: u16) -> Self {
        let at = road.at(ego.s_m, ego.d_m);
        Self {
            grade_frac: round(at.grade_rad.tan(), 1e5),
            curvature_1_m: round(at.curvature_1_m, 1e7),
            speed_limit_m_s: round(road.lane_speed_limit_m_s(lane, ego.s_m), 1e2),
        }
    }
}

/// The plan.
#[derive(Debug, Serialize)]
pub(super) struct Planned<'a> {
    maneuver: Maneuver,
    reason: Option<LaneChangeReason>,
    refusal: Option<LaneChangeRefusal>,
    speed_status: PlanStatus,
    reference_speed_m_s: f64,
    target_speed_m_s: f64,
    lateral_error_m: f64,
    lane: u16,
    following: Option<u64>,
    held_up: bool,
    guard: &'a [GuardReason],
    accelerator_pedal_frac: f64,
    xbr_decel_m_s2: f64,
    /// Map x and y in turn, m.
    path_xy_m: Vec<f64>,
}

impl<'a> From<&'a Plan> for Planned<'a> {
    fn from(p: &'a Plan) -> Self {
        Self {
            maneuver: p.maneuver,
            reason: p.reason,
            refusal: p.refusal,
            speed_status: p.speed_status,
            reference_speed_m_s: round(p.reference_speed_m_s, 1e3),
            target_speed_m_s: round(p.target_speed_m_s, 1e3),
            lateral_error_m: round(p.lateral_error_m, 1e4),
            lane: p.lane,
            following: p.following,
            held_up: p.held_up,
            guard: &p.guard,
            accelerator_pedal_frac: round(p.command.accelerator_pedal_frac, 1e3),
            xbr_decel_m_s2: round(p.command.xbr_decel_m_s2, 1e3),
            path_xy_m: p.path.iter().flat_map(|q| [round(q.x_m, 1e2), round(q.y_m, 1e2)]).collect(),
        }
    }
}

/// Another vehicle.
#[derive(Debug, Serialize)]
pub(super) struct Other {
    id: u64,
    class: VehicleClass,
    x_m: f64,
    y_m: f64,
    yaw_rad: f64,
    length_m: f64,
    width_m: f64,
    speed_m_s: f64,
}

impl From<&Neighbour> for Other {
    fn from(n: &Neighbour) -> Self {
        Self {
            id: n.id,
            class: n.class,
            x_m: round(n.x_m, 1e2),
            y_m: round(n.y_m, 1e2),
            yaw_rad: round(n.yaw_rad, 1e4),
            length_m: round(n.length_m(), 1e2),
            width_m: round(n.width_m, 1e2),
            speed_m_s: round(n.speed_m_s, 1e2),
        }
    }
}

/// Owned parts of a tick, kept until the frame is built.
#[derive(Debug, Clone, Default)]
pub(super) struct Snapshot {
    pub(super) now: Time,
    pub(super) ego: EgoState,
    pub(super) plan: Plan,
    pub(super) scene: Scene,
    pub(super) last_refusal: Option<Refused>,
}
