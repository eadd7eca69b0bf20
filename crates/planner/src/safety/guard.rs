//! The last check before the vehicle: two pure functions over a small memory.
//!
//! [`inspect`] looks at what came in (finite, in range, fresh, moving, not jumping), [`limit`] at
//! what goes out (finite, in range, not too fast, not into the vehicle ahead). Whatever is wrong
//! with the inputs leads to the minimal-risk manoeuvre: keep the lane, accelerator off, brake with
//! a bounded deceleration, until the inputs have been in order for a while. A driver who takes over
//! gets the truck: nothing is asked of it. Every activation names its [`GuardReason`].
//!
//! Neither function allocates or can panic.

use crate::PlannerError;
use crate::error::config_in;
use serde::{Deserialize, Serialize};
use tractrix_core::{
    BrakeMode, Command, EgoState, GearRequest, GuardReason, SafetySignal, Stamped, Time,
    VehicleFault, VehicleLimits, VehicleStatus,
};

/// A set of reasons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Reasons(u16);

const _: () = assert!(GuardReason::ALL.len() <= u16::BITS as usize);

impl Reasons {
    fn insert(&mut self, reason: GuardReason) {
        self.0 |= 1 << reason as u16;
    }

    fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether the reason is in the set.
    pub(crate) fn contains(self, reason: GuardReason) -> bool {
        self.0 & (1 << reason as u16) != 0
    }

    /// What is in this set or in the other.
    pub(crate) fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The reasons, in the order of [`GuardReason::ALL`].
    pub(crate) fn iter(self) -> impl Iterator<Item = GuardReason> {
        GuardReason::ALL.into_iter().filter(move |&reason| self.contains(reason))
    }
}

/// Bounds of the guard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GuardConfig {
    /// Oldest usable ego state, s.
    pub ego_age_max_s: f64,
    /// Oldest usable scene, s.
    pub scene_age_max_s: f64,
    /// Oldest usable demand of who drives from outside, s.
    pub demand_age_max_s: f64,
    /// A moving truck's position may stay the same for so long, s.
    pub frozen_max_s: f64,
    /// Largest plausible acceleration, m/s².
    pub accel_max_m_s2: f64,
    /// Largest plausible jump of position beyond what the speed explains, m.
    pub jump_max_m: f64,
    /// Largest deceleration of the minimal-risk manoeuvre, m/s².
    pub minimal_risk_decel_m_s2: f64,
    /// Rate at which that deceleration is built up, m/s³.
    pub minimal_risk_jerk_m_s3: f64,
    /// Inputs must be in order for so long before driving goes on, s.
    pub recovery_s: f64,
    /// Largest rate of the hand wheel, rad/s.
    pub wheel_rate_max_rad_s: f64,
    /// Largest lateral acceleration that a steering command may cause, m/s².
    pub lateral_accel_max_m_s2: f64,
}

impl Default for GuardConfig {
    fn default() -> Self {
        Self {
            ego_age_max_s: 0.15,
            scene_age_max_s: 0.5,
            demand_age_max_s: 0.2,
            frozen_max_s: 0.3,
            accel_max_m_s2: 12.0,
            jump_max_m: 2.0,
            minimal_risk_decel_m_s2: 2.5,
            minimal_risk_jerk_m_s3: 1.5,
            recovery_s: 0.5,
            wheel_rate_max_rad_s: 12.0,
            lateral_accel_max_m_s2: 3.0,
        }
    }
}

impl GuardConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlannerError::Config`] names the key.
    pub fn check(&self) -> Result<(), PlannerError> {
        config_in("guard.ego_age_max_s", self.ego_age_max_s, 0.01, 2.0)?;
        config_in("guard.scene_age_max_s", self.scene_age_max_s, 0.01, 5.0)?;
        config_in("guard.demand_age_max_s", self.demand_age_max_s, 0.02, 2.0)?;
        config_in("guard.frozen_max_s", self.frozen_max_s, 0.02, 5.0)?;
        config_in("guard.accel_max_m_s2", self.accel_max_m_s2, 5.0, 100.0)?;
        config_in("guard.jump_max_m", self.jump_max_m, 0.1, 100.0)?;
        config_in("guard.minimal_risk_decel_m_s2", self.minimal_risk_decel_m_s2, 0.5, 6.0)?;
        config_in("guard.minimal_risk_jerk_m_s3", self.minimal_risk_jerk_m_s3, 0.1, 50.0)?;
        config_in("guard.recovery_s", self.recovery_s, 0.0, 10.0)?;
        config_in("guard.wheel_rate_max_rad_s", self.wheel_rate_max_rad_s, 0.5, 50.0)?;
        config_in("guard.lateral_accel_max_m_s2", self.lateral_accel_max_m_s2, 0.5, 10.0)
    }
}

/// What the guard remembers between ticks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct GuardMemory {
    /// Last finite ego state.
    last: Option<Stamped<EgoState>>,
    /// When the position last changed.
    moved: Option<Time>,
    /// Last time at which an input was wrong.
    wrong: Option<Time>,
    /// Last command sent.
    sent: Command,
}

impl GuardMemory {
    /// The last command sent.
    #[must_use]
    pub(crate) fn sent(&self) -> &Command {
        &self.sent
    }
}

/// Verdict on the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Inspection {
    /// The ego state can be steered with.
    pub ego_usable: bool,
    /// The inputs, or those of a moment ago, call for the minimal-risk manoeuvre.
    pub minimal_risk: bool,
    /// The driver has taken over.
    pub driver: bool,
    /// What is wrong now.
    pub reasons: Reasons,
}

/// The inputs of a tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Inputs<'a> {
    /// The truck's state; `None`: its seam failed.
    pub ego: Option<&'a Stamped<EgoState>>,
    /// What is wrong with the truck.
    pub status: &'a VehicleStatus,
    /// Time of the scene; `None`: its seam failed.
    pub scene_time: Option<Time>,
    /// Time of the last demand of who drives from outside; `None`: nobody does.
    pub demand_time: Option<Time>,
}

/// Looks at the inputs of a tick.
///
/// A truck whose engine, gearbox or brakes are silent can still be steered to its stop: only the
/// signals that steer make the ego state unusable.
#[must_use]
pub(crate) fn inspect(
    config: &GuardConfig,
    memory: &GuardMemory,
    now: Time,
    inputs: &Inputs<'_>,
) -> (Inspection, GuardMemory) {
    let Inputs { ego, status, scene_time, demand_time } = *inputs;
    let mut next = *memory;
    let mut reasons = Reasons::default();
    match ego {
        None => reasons.insert(GuardReason::Stale),
        Some(ego) if !ego.value.is_finite() => reasons.insert(GuardReason::NonFinite),
        Some(ego) => {
            let age_s = now.seconds_since(ego.time);
            let too_old = |age_s: f64| age_s > config.ego_age_max_s;
            let steering = SafetySignal::ALL.into_iter().filter(|signal| signal.steers());
            if too_old(age_s.abs()) || steering.filter_map(|s| status.age_s(s)).any(too_old) {
                reasons.insert(GuardReason::Stale);
            }
            if !in_range(&ego.value) {
                reasons.insert(GuardReason::Range);
            }
            if let Some(last) = &memory.last {
                if jumped(config, last, ego) {
                    reasons.insert(GuardReason::Jump);
                }
                let v = &ego.value;
                let same = v.s_m == last.value.s_m && v.x_m == last.value.x_m;
                let since = memory.moved.unwrap_or(now);
                if !same || v.speed_m_s.abs() < 0.5 {
                    next.moved = Some(now);
                } else if now.seconds_since(since) > config.frozen_max_s {
                    reasons.insert(GuardReason::Frozen);
                }
            } else {
                next.moved = Some(now);
            }
            next.last = Some(*ego);
        }
    }
    let ego_usable = reasons.is_empty();
    match scene_time {
        None => reasons.insert(GuardReason::Stale),
        Some(t) if now.seconds_since(t).abs() > config.scene_age_max_s => {
            reasons.insert(GuardReason::Stale);
        }
        Some(_) => {}
    }
    if demand_time.is_some_and(|t| now.seconds_since(t).abs() > config.demand_age_max_s) {
        reasons.insert(GuardReason::Stale);
    }
    for fault in status.faults() {
        reasons.insert(reason_of(fault.fault));
    }
    let driver = reasons.contains(GuardReason::Driver);
    let wrong = reasons.iter().any(|reason| reason != GuardReason::Driver);
    if wrong {
        next.wrong = Some(now);
    }
    let recovering = |t| now.seconds_since(t) < config.recovery_s;
    let minimal_risk = !driver && (wrong || next.wrong.is_some_and(recovering));
    (Inspection { ego_usable, minimal_risk, driver, reasons }, next)
}

/// What a fault of the truck means to the guard.
fn reason_of(fault: VehicleFault) -> GuardReason {
    match fault {
        VehicleFault::DriverOverride => GuardReason::Driver,
        VehicleFault::Spoofed | VehicleFault::AddressConflict => GuardReason::Intruder,
        VehicleFault::SignalLost
        | VehicleFault::CounterJump
        | VehicleFault::Checksum
        | VehicleFault::RateViolation
        | VehicleFault::BusOff
        | VehicleFault::Flooded
        | VehicleFault::NotReady => GuardReason::Bus,
    }
}

/// Ranges that no truck leaves.
fn in_range(ego: &EgoState) -> bool {
    (-5.0..=60.0).contains(&ego.speed_m_s)
        && ego.lateral_speed_m_s.abs() <= 10.0
        && ego.accel_x_m_s2.abs() <= 30.0
        && ego.yaw_rate_rad_s.abs() <= 3.0
        && ego.trailer.yaw_rate_rad_s.abs() <= 3.0
        && ego.trailer.articulation_rad.abs() <= 2.0
        && ego.road_wheel_rad.abs() <= 1.5
}

/// More change between two states than physics allows.
fn jumped(config: &GuardConfig, last: &Stamped<EgoState>, ego: &Stamped<EgoState>) -> bool {
    let dt_s = ego.time.seconds_since(last.time);
    if dt_s < 0.0 {
        return true;
    }
    let (a, b) = (&last.value, &ego.value);
    let speed = (b.speed_m_s - a.speed_m_s).abs();
    let travel = 0.5 * (a.speed_m_s + b.speed_m_s) * dt_s;
    let along = (b.s_m - a.s_m - travel).abs();
    let across = (b.d_m - a.d_m).abs();
    let turn = (b.yaw_rad - a.yaw_rad).abs() % (2.0 * core::f64::consts::PI);
    let turn = turn.min(2.0 * core::f64::consts::PI - turn);
    speed > 0.5 + config.accel_max_m_s2 * dt_s
        || along > config.jump_max_m + 0.2 * travel.abs()
        || across > 0.5 * config.jump_max_m + 5.0 * dt_s
        || turn > 0.1 + 1.0 * dt_s
}

/// The vehicle ahead, for the headway check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Headway {
    /// Gap, m.
    pub gap_m: f64,
    /// Speed of the vehicle ahead, m/s.
    pub speed_m_s: f64,
    /// Acceleration of the vehicle ahead, m/s².
    pub accel_m_s2: f64,
}

/// What [`limit`] needs besides the plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GuardInput {
    /// Time since the last command, s.
    pub dt_s: f64,
    /// Last trustworthy speed, m/s.
    pub speed_m_s: f64,
    /// The planned command; `None` if there is no plan.
    pub planned: Option<Command>,
    /// Hand-wheel angle that keeps the lane as well as is known, rad.
    pub keep_lane_wheel_rad: f64,
    /// The inputs call for the minimal-risk manoeuvre.
    pub minimal_risk: bool,
    /// The driver has taken over; the hand wheel as it stands, rad.
    pub driver_wheel_rad: Option<f64>,
    /// The vehicle ahead.
    pub headway: Option<Headway>,
}

/// The guarded command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Guarded {
    /// The command to send.
    pub command: Command,
    /// What was changed and why.
    pub reasons: Reasons,
    /// The minimal-risk manoeuvre is being driven.
    pub minimal_risk: bool,
}

/// Limits the command of a tick; total: every input gives a safe, finite command.
#[must_use]
pub(crate) fn limit(
    config: &GuardConfig,
    memory: &GuardMemory,
    input: &GuardInput,
    limits: &VehicleLimits,
) -> (Guarded, GuardMemory) {
    let mut reasons = Reasons::default();
    if let Some(wheel_rad) = input.driver_wheel_rad {
        let held = memory.sent.steering_wheel_rad;
        let command = Command {
            steering_wheel_rad: if wheel_rad.is_finite() { wheel_rad } else { held },
            ..Command::default()
        };
        let next = GuardMemory { sent: command, ..*memory };
        return (Guarded { command, reasons, minimal_risk: false }, next);
    }
    let planned = match &input.planned {
        None => {
            if !input.minimal_risk {
                reasons.insert(GuardReason::NoPlan);
            }
            None
        }
        Some(c) if !c.is_finite() => {
            reasons.insert(GuardReason::NonFinite);
            None
        }
        Some(c) => Some(*c),
    };
    let minimal_risk = input.minimal_risk || planned.is_none();
    let mut command = match planned {
        Some(c) if !minimal_risk => c,
        _ => minimal_risk_command(config, memory, input, planned.as_ref()),
    };
    if in_command_range(&mut command, config, input.speed_m_s, limits) {
        reasons.insert(GuardReason::Range);
    }
    let step = config.wheel_rate_max_rad_s * input.dt_s;
    let from = memory.sent.steering_wheel_rad;
    let slow = within(command.steering_wheel_rad, from - step, from + step);
    if slow != command.steering_wheel_rad {
        command.steering_wheel_rad = slow;
        reasons.insert(GuardReason::Rate);
    }
    if let Some(decel_m_s2) = input.headway.and_then(|h| needs_braking(&h, input, limits)) {
        let already = command.xbr_decel_m_s2;
        if already < decel_m_s2 || command.accelerator_pedal_frac > 0.0 {
            command.accelerator_pedal_frac = 0.0;
            command.retarder_frac = 1.0;
            command.xbr_decel_m_s2 = already.max(decel_m_s2);
            command.brake_mode = BrakeMode::Maximum;
            command.gear = GearRequest::Automatic;
            reasons.insert(GuardReason::Headway);
        }
    }
    let next = GuardMemory { sent: command, ..*memory };
    (Guarded { command, reasons, minimal_risk }, next)
}

/// Keep lane, accelerator off, deceleration built up to its bound and held at standstill.
fn minimal_risk_command(
    config: &GuardConfig,
    memory: &GuardMemory,
    input: &GuardInput,
    planned: Option<&Command>,
) -> Command {
    let built_up = memory.sent.xbr_decel_m_s2 + config.minimal_risk_jerk_m_s3 * input.dt_s;
    let planned_decel = planned.map_or(0.0, |c| c.xbr_decel_m_s2);
    let decel = built_up.min(config.minimal_risk_decel_m_s2).max(planned_decel);
    Command {
        accelerator_pedal_frac: 0.0,
        xbr_decel_m_s2: decel,
        brake_mode: BrakeMode::Maximum,
        steering_wheel_rad: planned.map_or(input.keep_lane_wheel_rad, |c| c.steering_wheel_rad),
        retarder_frac: 0.0,
        gear: GearRequest::Automatic,
    }
}

/// `f64::clamp` without its panic on bounds that are the wrong way round.
fn within(value: f64, low: f64, high: f64) -> f64 {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// Clamps every field into its range; true if something was outside.
fn in_command_range(
    command: &mut Command,
    config: &GuardConfig,
    speed_m_s: f64,
    limits: &VehicleLimits,
) -> bool {
    let before = *command;
    let l = &limits.lateral;
    // Steady turn: a_y = v² delta / wheelbase at most; keeps a wrong command from rolling the truck
    let v2 = (speed_m_s * speed_m_s).max(1.0);
    let by_accel = config.lateral_accel_max_m_s2 * limits.geometry.wheelbase_m.max(1.0) / v2;
    let wheel = l.max_road_wheel_rad.min(by_accel).max(0.0) * l.steering_ratio.abs().max(1.0);
    let wheel = if wheel.is_finite() { wheel } else { 0.0 };
    let hardest = if limits.brakes.max_decel_m_s2 > 0.0 {
        limits.brakes.max_decel_m_s2.max(config.minimal_risk_decel_m_s2).min(12.5)
    } else {
        config.minimal_risk_decel_m_s2
    };
    command.accelerator_pedal_frac = within(command.accelerator_pedal_frac, 0.0, 1.0);
    command.retarder_frac = within(command.retarder_frac, 0.0, 1.0);
    command.xbr_decel_m_s2 = within(command.xbr_decel_m_s2, 0.0, hardest);
    command.steering_wheel_rad = within(command.steering_wheel_rad, -wheel, wheel);
    if command.xbr_decel_m_s2 > 0.0 && command.brake_mode == BrakeMode::Off {
        command.brake_mode = BrakeMode::Maximum;
    }
    *command != before
}

/// Deceleration that avoids the vehicle ahead with the brakes' full force, if coasting on would hit
/// it: both vehicles keep their deceleration to standstill.
fn needs_braking(h: &Headway, input: &GuardInput, limits: &VehicleLimits) -> Option<f64> {
    let b = &limits.brakes;
    let hardest = b.max_decel_m_s2.max(0.5);
    let v = input.speed_m_s.max(0.0);
    let ahead = (-h.accel_m_s2).max(1.0);
    let v_f = h.speed_m_s.max(0.0);
    let delay = b.dead_time_s + 0.5 * b.build_up_s;
    let closing = v - v_f;
    let stop = v * delay + v * v / (2.0 * hardest) - v_f * v_f / (2.0 * ahead.min(hardest));
    let hits = h.gap_m < stop.max(0.0) && closing > 0.5 || h.gap_m < 1.0 && v > 0.2;
    hits.then_some(hardest)
}
