//! A step of the stack as a message, and out of a message again.

use tractrix_core::{
    BrakeMode, Command, EgoState, GearRequest, LaneChoice, Neighbour, PowertrainSignals,
    SafetySignal, Scene, Stamped, Step, Time, TrailerState, VehicleFault, VehicleLimits,
    VehicleStatus,
};

use crate::error::RecordingError;
use crate::ros::input::StackInput;
use crate::ros::truck::{brake_code, gear_codes};
use crate::topic::LIMITS;

/// A step of the stack as it was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenStep {
    /// Time of the tick.
    pub now: Time,
    /// The truck's state; `None`: it could not be read.
    pub ego: Option<Stamped<EgoState>>,
    /// What was wrong with the truck.
    pub status: VehicleStatus,
    /// The other vehicles; `None`: the traffic source failed, or the truck could not be read.
    pub scene: Option<Scene>,
    /// What the truck could do, where that is not what it was a step before.
    pub limits: Option<Box<VehicleLimits>>,
    /// Limit on the whole road beside its own ones, m/s.
    pub limit_cap_m_s: Option<f64>,
    /// The driver's set speed, m/s.
    pub set_speed_m_s: f64,
    /// The lane change that was wished from outside.
    pub wish: LaneChoice,
    /// Changes of the stack since the step before, in words.
    pub changes: Vec<String>,
    /// The command of the stack.
    pub command: Command,
}

/// What of a step is written.
pub(crate) struct StepNote {
    pub(crate) input: StackInput,
    /// The other vehicles, where they changed.
    pub(crate) vehicles: Option<Vec<Neighbour>>,
    /// The truck's sheet, where it changed.
    pub(crate) sheet_toml: Option<String>,
}

/// Makes notes of steps one after the other.
#[derive(Debug, Default)]
pub(crate) struct StepNotes {
    vehicles: Vec<Neighbour>,
    limits: Option<VehicleLimits>,
}

impl StepNotes {
    /// The note of the next step.
    ///
    /// # Errors
    /// If the truck's limits are none that a sheet may hold.
    pub(crate) fn note(&mut self, step: &Step<'_>) -> Result<StepNote, RecordingError> {
        let vehicles = step.scene.map(|scene| &scene.neighbours);
        let vehicles = vehicles.filter(|now| **now != self.vehicles).cloned();
        if let Some(vehicles) = &vehicles {
            self.vehicles.clone_from(vehicles);
        }
        let mut sheet_toml = None;
        if self.limits.as_ref() != Some(step.limits) {
            self.limits = Some(step.limits.clone());
            let wrong = |e: tractrix_core::CoreError| RecordingError::Encode {
                topic: LIMITS.topic.name,
                why: e.to_string(),
            };
            sheet_toml = Some(step.limits.to_sheet().map_err(wrong)?);
        }
        Ok(StepNote { input: StackInput::of(step), vehicles, sheet_toml })
    }
}

impl StackInput {
    fn of(step: &Step<'_>) -> Self {
        let Stamped { time, value: e } = step.ego.copied().unwrap_or_default();
        let (p, c) = (&e.powertrain, step.command);
        let (gear_request, requested_gear) = gear_codes(c.gear);
        let (mut faults, mut fault_since_ns) = (0, [0; 10]);
        for ((bit, fault), since_ns) in (0..).zip(VehicleFault::ALL).zip(&mut fault_since_ns) {
            if let Some(since) = step.status.since(fault) {
                faults |= 1 << bit;
                *since_ns = since.0;
            }
        }
        let (mut timed_signals, mut signal_age_s) = (0, [0.0; 8]);
        for ((bit, signal), age_s) in (0..).zip(SafetySignal::ALL).zip(&mut signal_age_s) {
            if let Some(age) = step.status.age_s(signal) {
                timed_signals |= 1 << bit;
                *age_s = age;
            }
        }
        Self {
            now_ns: step.now.0,
            has_ego: step.ego.is_some(),
            has_scene: step.scene.is_some(),
            ego_time_ns: time.0,
            scene_time_ns: step.scene.map_or(0, |scene| scene.time.0),
            x_m: e.x_m,
            y_m: e.y_m,
            z_m: e.z_m,
            yaw_rad: e.yaw_rad,
            s_m: e.s_m,
            d_m: e.d_m,
            speed_m_s: e.speed_m_s,
            lateral_speed_m_s: e.lateral_speed_m_s,
            accel_x_m_s2: e.accel_x_m_s2,
            accel_y_m_s2: e.accel_y_m_s2,
            yaw_rate_rad_s: e.yaw_rate_rad_s,
            articulation_rad: e.trailer.articulation_rad,
            trailer_yaw_rate_rad_s: e.trailer.yaw_rate_rad_s,
            road_wheel_rad: e.road_wheel_rad,
            steering_wheel_rad: e.steering_wheel_rad,
            load_transfer_ratio: e.load_transfer_ratio,
            engine_speed_rad_s: p.engine_speed_rad_s,
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
            accelerator_pedal_frac: c.accelerator_pedal_frac,
            xbr_decel_m_s2: c.xbr_decel_m_s2,
            brake_mode: brake_code(c.brake_mode),
            command_steering_wheel_rad: c.steering_wheel_rad,
            command_retarder_frac: c.retarder_frac,
            gear_request,
            requested_gear,
            set_speed_m_s: step.set_speed_m_s,
            lane_wish: match step.wish {
                LaneChoice::Left => -1,
                LaneChoice::Keep => 0,
                LaneChoice::Right => 1,
            },
            limit_cap_m_s: step.limit_cap_m_s.unwrap_or(f64::NAN),
            faults,
            fault_since_ns,
            timed_signals,
            signal_age_s,
        }
    }

    /// The step again; `None` if a code is none.
    pub(super) fn step(
        &self,
        vehicles: &[Neighbour],
        limits: Option<Box<VehicleLimits>>,
    ) -> Option<GivenStep> {
        let ego = Stamped { time: Time(self.ego_time_ns), value: self.ego() };
        let scene = || Scene { time: Time(self.scene_time_ns), neighbours: vehicles.to_vec() };
        Some(GivenStep {
            now: Time(self.now_ns),
            ego: self.has_ego.then_some(ego),
            status: self.status(),
            scene: self.has_scene.then(scene),
            limits,
            limit_cap_m_s: (!self.limit_cap_m_s.is_nan()).then_some(self.limit_cap_m_s),
            set_speed_m_s: self.set_speed_m_s,
            wish: match self.lane_wish {
                -1 => LaneChoice::Left,
                0 => LaneChoice::Keep,
                1 => LaneChoice::Right,
                _ => return None,
            },
            changes: Vec::new(),
            command: Command {
                accelerator_pedal_frac: self.accelerator_pedal_frac,
                xbr_decel_m_s2: self.xbr_decel_m_s2,
                brake_mode: match self.brake_mode {
                    0 => BrakeMode::Off,
                    1 => BrakeMode::Addition,
                    2 => BrakeMode::Maximum,
                    _ => return None,
                },
                steering_wheel_rad: self.command_steering_wheel_rad,
                retarder_frac: self.command_retarder_frac,
                gear: match self.gear_request {
                    0 => GearRequest::Automatic,
                    1 => GearRequest::Gear(self.requested_gear),
                    2 => GearRequest::Neutral,
                    _ => return None,
                },
            },
        })
    }

    fn ego(&self) -> EgoState {
        EgoState {
            x_m: self.x_m,
            y_m: self.y_m,
            z_m: self.z_m,
            yaw_rad: self.yaw_rad,
            s_m: self.s_m,
            d_m: self.d_m,
            speed_m_s: self.speed_m_s,
            lateral_speed_m_s: self.lateral_speed_m_s,
            accel_x_m_s2: self.accel_x_m_s2,
            accel_y_m_s2: self.accel_y_m_s2,
            yaw_rate_rad_s: self.yaw_rate_rad_s,
            trailer: TrailerState {
                articulation_rad: self.articulation_rad,
                yaw_rate_rad_s: self.trailer_yaw_rate_rad_s,
            },
            road_wheel_rad: self.road_wheel_rad,
            steering_wheel_rad: self.steering_wheel_rad,
            load_transfer_ratio: self.load_transfer_ratio,
            powertrain: PowertrainSignals {
                engine_speed_rad_s: self.engine_speed_rad_s,
                engine_torque_nm: self.engine_torque_nm,
                engine_friction_torque_nm: self.engine_friction_torque_nm,
                drive_force_n: self.drive_force_n,
                brake_force_n: self.brake_force_n,
                brake_pressure_pa: self.brake_pressure_pa,
                retarder_force_n: self.retarder_force_n,
                gear: self.gear,
                shift_in_progress: self.shift_in_progress,
                fuel_rate_g_s: self.fuel_rate_g_s,
                fuel_used_g: self.fuel_used_g,
                engine_power_w: self.engine_power_w,
            },
        }
    }

    fn status(&self) -> VehicleStatus {
        let mut status = VehicleStatus::default();
        for ((bit, fault), since_ns) in (0..).zip(VehicleFault::ALL).zip(self.fault_since_ns) {
            if self.faults & 1 << bit != 0 {
                status.raise(fault, Time(since_ns));
            }
        }
        for ((bit, signal), age_s) in (0..).zip(SafetySignal::ALL).zip(self.signal_age_s) {
            if self.timed_signals & 1 << bit != 0 {
                status.set_age_s(signal, age_s);
            }
        }
        status
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topic::INPUT;

    #[test]
    fn a_step_comes_back_bit_for_bit_from_the_bytes_of_its_message() {
        let mut status = VehicleStatus::default();
        status.raise(VehicleFault::NotReady, Time(-7));
        status.set_age_s(SafetySignal::Pose, f64::INFINITY);
        status.set_age_s(SafetySignal::Engine, 0.1 + 0.2);
        let mut ego = EgoState { yaw_rad: -17.25, x_m: 0.1 + 0.2, ..EgoState::default() };
        ego.powertrain.engine_speed_rad_s = 123.456_789_012_345_67;
        ego.powertrain.gear = 9;
        let ego = Stamped { time: Time(12_345), value: ego };
        let scene = Scene { time: Time(99), neighbours: vec![Neighbour::default()] };
        let command = Command {
            brake_mode: BrakeMode::Addition,
            gear: GearRequest::Gear(7),
            steering_wheel_rad: -0.1,
            ..Command::default()
        };
        let text = crate::tests::sheet();
        let limits = VehicleLimits::from_sheet("sheet", &text).unwrap();
        let step = Step {
            now: Time(20_000_000),
            ego: Some(&ego),
            status: &status,
            scene: Some(&scene),
            limits: &limits,
            limit_cap_m_s: Some(16.7),
            set_speed_m_s: 22.2,
            wish: LaneChoice::Left,
            command: &command,
        };
        let mut notes = StepNotes::default();
        let note = notes.note(&step).unwrap();
        let again = VehicleLimits::from_sheet("sheet", &note.sheet_toml.unwrap()).unwrap();
        assert_eq!(again, limits);
        let bytes = INPUT.encode(&note.input).unwrap();
        let read = INPUT.decode(&bytes.cdr).unwrap();
        let given = read.step(&note.vehicles.unwrap(), None).unwrap();
        assert_eq!(
            given,
            GivenStep {
                now: step.now,
                ego: Some(ego),
                status,
                scene: Some(scene.clone()),
                limits: None,
                limit_cap_m_s: step.limit_cap_m_s,
                set_speed_m_s: step.set_speed_m_s,
                wish: step.wish,
                changes: Vec::new(),
                command,
            }
        );
        let next = notes.note(&Step { ego: None, limit_cap_m_s: None, ..step }).unwrap();
        assert!(next.vehicles.is_none() && next.sheet_toml.is_none(), "nothing changed");
        let given = next.input.step(&[], None).unwrap();
        assert_eq!((given.ego, given.limit_cap_m_s), (None, None));
    }
}
