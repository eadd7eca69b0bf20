//! A truck that is read and commanded over its bus.

use tractrix_core::{
    Command, CoreError, EgoState, Motion, Pose, PoseSource, SafetySignal, Stamped, Time, Vehicle,
    VehicleFault, VehicleLimits, VehicleStatus,
};

use super::config::lost_after_s;
use super::ego::{ego_state, fuel_rate_g_s};
use super::engagement::{Clutch, Conditions};
use super::heard::Heard;
use super::send::{SendError, Sender, Situation};
use super::{BusTruckConfig, Engagement, Lead, watch};
use crate::bus::{Bus, BusError};
use crate::ident::Vin;
use crate::steering::{ExampleSteering, SteeringLink};
use crate::supervise::{BusEvent, BusFault};
use crate::{AddressClaim, BitRate, ClaimState, J1939Error, Request, TpEvent, Transport};

/// Frames that are taken from the bus in one tick; what is beyond waits for the next.
const FRAMES_A_TICK: usize = 4096;
/// So long wheel speed and engine speed may contradict each other (gears are told at 10 Hz), s.
const CONTRADICTED_S: f64 = 0.3;
/// Between two ticks no more time passes than this, s, unless the clock jumps.
const TICK_MAX_S: f64 = 0.5;

/// What can go wrong besides the bus, whose faults are in the status.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TruckError<P: core::error::Error> {
    /// There is no pose yet.
    #[error("no pose: {0}")]
    Pose(P),
    /// A command is not a number.
    #[error("command: {0}")]
    Command(CoreError),
    /// A command cannot be said on the bus.
    #[error(transparent)]
    Frame(J1939Error),
}

/// What driving over a bus needs besides fresh signals. `None`: not told yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readiness {
    /// Whether the address is ours.
    pub claim: ClaimState,
    /// Frames of others so far.
    pub frames: u64,
    /// Torque that the shares in EEC1 and TSC1 refer to, Nm (EC1).
    pub reference_torque_nm: Option<f64>,
    /// Whether the brakes take every demand (EBC5).
    pub brakes_accept: Option<bool>,
    /// Whether the engine takes the demands of an automated driving system (ADSS).
    pub engine_accepts: Option<bool>,
    /// Whether a position has come by satellite (VP1).
    pub has_fix: bool,
    /// The truck's number (VI), once somebody has asked the engine for it.
    pub vin: Option<Vin>,
    /// Mass of the combination, kg (CVW), once somebody has asked the brakes for it.
    pub mass_kg: Option<f64>,
}

/// A truck on a bus `B` whose pose comes from `P` and whose steering understands `S`.
///
/// Reading: [`Vehicle::ego`] takes all frames that have come in. Commanding: nothing but its address
/// claim is sent before the address is claimed, all signals are fresh, and [`Self::engage`] was
/// called; a driver who takes pedal or wheel ends it.
#[derive(Debug, Clone)]
pub struct BusTruck<B, P, S = ExampleSteering> {
    bus: B,
    pose: P,
    steering: Option<S>,
    limits: VehicleLimits,
    config: BusTruckConfig,
    claim: AddressClaim,
    transport: Transport<4, 128>,
    supervisor: watch::BusSupervisor,
    heard: Heard,
    clutch: Clutch,
    sender: Sender,
    last_pose: Option<Stamped<Pose>>,
    pose_told: [Option<Time>; 2],
    commanded: Command,
    wheel_off: Option<Time>,
    pedal_down: Option<Time>,
    contradicted: Option<Time>,
    fuel_used_g: f64,
    fuel_until: Option<Time>,
    status: VehicleStatus,
    now: Option<Time>,
    bus_error: Option<BusError>,
    stopping: bool,
}

impl<B: Bus, P: PoseSource, S: SteeringLink> BusTruck<B, P, S> {
    /// A truck with this sheet, not engaged. `steering` is the maker's steering frame; without one
    /// the truck is not steered.
    ///
    /// # Errors
    /// If the sheet cannot be planned with.
    pub fn new(
        bus: B,
        rate: BitRate,
        pose: P,
        steering: Option<S>,
        limits: VehicleLimits,
        config: BusTruckConfig,
    ) -> Result<Self, CoreError> {
        limits.check()?;
        Ok(Self {
            bus,
            pose,
            steering,
            limits,
            claim: AddressClaim::new(config.name, config.address, config.claim_delay_steps),
            transport: Transport::new(16),
            supervisor: watch::supervisor(rate, &config),
            heard: Heard::default(),
            clutch: Clutch::default(),
            sender: Sender::new(&config),
            config,
            last_pose: None,
            pose_told: [None; 2],
            commanded: Command::default(),
            wheel_off: None,
            pedal_down: None,
            contradicted: None,
            fuel_used_g: 0.0,
            fuel_until: None,
            status: VehicleStatus::default(),
            now: None,
            bus_error: None,
            stopping: false,
        })
    }

    /// The driver's wish to hand over; it holds for the next tick, and only when
    /// [`Self::engagement`] is ready then.
    pub const fn engage(&mut self) {
        self.clutch.wish();
    }

    /// The driver's wish to drive himself: the next command lets go of the truck.
    pub fn disengage(&mut self, now: Time) {
        self.stopping = false;
        self.clutch.release(now);
    }

    /// Asks for the minimal-risk manoeuvre, as if something were wrong: it lasts until the driver
    /// takes over or [`Self::disengage`]. Nothing happens while the driver drives.
    pub fn stop(&mut self, now: Time) {
        self.clutch.stop(now);
        self.stopping = self.clutch.state().actuates();
    }

    /// Asks a controller, or all of them, for a parameter group; [`Self::readiness`] has what they
    /// answer about the truck. Without an address of its own nothing is sent.
    ///
    /// # Errors
    /// When the bus cannot be used, or has no room at present.
    pub fn ask(&mut self, now: Time, pgn: u32, da: u8) -> Result<(), BusError> {
        let Some(sa) = self.claim.address() else { return Ok(()) };
        match (Request { pgn, da, sa }).frame() {
            Ok(frame) => self.bus.send(now, &frame),
            // No such group: there is nobody who could answer
            Err(_) => Ok(()),
        }
    }

    /// What driving over the bus needs besides fresh signals, as of the last [`Vehicle::ego`].
    #[must_use]
    pub fn readiness(&self) -> Readiness {
        Readiness {
            claim: self.claim.state(),
            frames: self.heard.frames,
            reference_torque_nm: self.heard.reference_nm.map(|nm| nm.value),
            brakes_accept: self.heard.xbr_state.map(|state| state.value == 0),
            engine_accepts: self.heard.engine_ready.map(|ready| ready.value),
            has_fix: self.heard.fix.is_some(),
            vin: self.heard.vin,
            mass_kg: self.heard.mass_kg.map(|mass| mass.value),
        }
    }

    /// Why the bus could not be used in the last [`Vehicle::ego`].
    #[must_use]
    pub const fn bus_error(&self) -> Option<&BusError> {
        self.bus_error.as_ref()
    }

    /// Who drives.
    #[must_use]
    pub const fn engagement(&self) -> Engagement {
        self.clutch.state()
    }

    /// The vehicle ahead as the truck's radar reports it (ACC1, 10 Hz, steps of 1 m and 1 km/h);
    /// outside `None`: nothing heard yet, inside: no vehicle.
    #[must_use]
    pub const fn lead(&self) -> Option<Stamped<Option<Lead>>> {
        self.heard.lead
    }

    /// What is wrong on the bus, in detail.
    pub fn events(&self) -> impl Iterator<Item = &BusEvent> {
        self.supervisor.events()
    }

    /// Share of the last second in which the bus was busy with others' frames, 0 to 1.
    #[must_use]
    pub fn load(&mut self, now: Time) -> f64 {
        self.supervisor.load(now)
    }

    /// Frames that the bus had no room for, and messages too short to decode.
    #[must_use]
    pub const fn losses(&self) -> (u64, u64) {
        (self.sender.unsent, self.heard.short)
    }

    /// The pose source, for who feeds it.
    pub const fn pose_source(&mut self) -> &mut P {
        &mut self.pose
    }

    /// The bus.
    pub const fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Takes what has come in by `now`.
    fn receive(&mut self, now: Time) -> Result<(), BusError> {
        for _ in 0..FRAMES_A_TICK {
            let Some(Stamped { time, value: frame }) = self.bus.receive(now)? else { break };
            self.claim.on_frame(time, &frame);
            self.transport.on_frame(time, &frame);
            self.supervisor.on_frame(time, &frame);
            self.heard.on_frame(time, &frame, &self.config);
            while let Some(event) = self.transport.event() {
                if let TpEvent::Received(message) = event {
                    self.claim.on_message(&message);
                    self.heard.on_message(&message, &self.config);
                }
            }
        }
        self.claim.poll(now, &mut self.bus)?;
        let address = self.claim.address();
        self.transport.set_address(address);
        self.supervisor.set_address(address);
        self.transport.poll(now, &mut self.bus)
    }

    /// Fuel since the last tick, at the rate that was heard last.
    fn meter_fuel(&mut self, now: Time) {
        let passed_s = self.fuel_until.map_or(0.0, |until| now.seconds_since(until));
        self.fuel_until = Some(now);
        if passed_s > 0.0 && passed_s <= TICK_MAX_S {
            self.fuel_used_g += fuel_rate_g_s(&self.heard, &self.limits) * passed_s;
        }
    }

    /// Tells the pose source what the truck's sensors and receivers say.
    fn tell_pose(&mut self) {
        let [told_motion, told_fix] = &mut self.pose_told;
        if let (Some(speed), Some(yaw_rate)) = (self.heard.speed_m_s, self.heard.yaw_rate_rad_s) {
            let time = speed.time.max(yaw_rate.time);
            if told_motion.replace(time) != Some(time) {
                let value = Motion { speed_m_s: speed.value, yaw_rate_rad_s: yaw_rate.value };
                self.pose.moved(&Stamped { time, value });
            }
        }
        if let Some(fix) = self.heard.fix
            && told_fix.replace(fix.time) != Some(fix.time)
        {
            self.pose.fixed(&fix);
        }
    }

    /// Age of a signal, s; infinite if it never came, or if others contradict it.
    fn age_s(&self, signal: SafetySignal, now: Time) -> f64 {
        let wrong = |since| now.seconds_since(since) >= CONTRADICTED_S;
        if signal == SafetySignal::RoadSpeed && self.contradicted.is_some_and(wrong) {
            return f64::INFINITY;
        }
        let time = match signal {
            SafetySignal::Pose => self.last_pose.map(|pose| pose.time),
            other => self.heard.time_of(other),
        };
        time.map_or(f64::INFINITY, |time| now.seconds_since(time))
    }

    /// Whether the driver holds a pedal, or the wheel against what is asked.
    fn driver_acts(&mut self, now: Time) -> bool {
        let c = &self.config;
        let beyond = |field: Option<Stamped<f64>>, frac| field.is_some_and(|f| f.value > frac);
        let pedal = beyond(self.heard.accelerator_frac(), c.driver_accelerator_frac)
            || beyond(self.heard.brake_pedal_frac, c.driver_brake_frac)
            || self.heard.brake_pedal_pressed;
        let asked = self.steering.is_some() && self.clutch.state().actuates();
        let off = self.heard.steering_wheel_rad.is_some_and(|wheel| {
            (wheel.value - self.commanded.steering_wheel_rad).abs() > c.driver_wheel_rad
        });
        let since = |acts: bool, before: Option<Time>| acts.then(|| before.unwrap_or(now));
        self.pedal_down = since(pedal, self.pedal_down);
        self.wheel_off = since(asked && off, self.wheel_off);
        let held = |since: Option<Time>, s| since.is_some_and(|t| now.seconds_since(t) >= s);
        held(self.pedal_down, c.driver_pedal_s) || held(self.wheel_off, c.driver_wheel_s)
    }

    /// Whether engine and brakes take demands: state 1 takes those of the first priority alone,
    /// which is not enough for planned driving.
    fn accepted(&self) -> bool {
        let brakes = self.heard.xbr_state.is_some_and(|state| state.value == 0);
        let engine = match self.heard.engine_ready {
            Some(ready) => ready.value,
            None => !self.config.needs_adss,
        };
        brakes && engine
    }

    /// Status and engagement of this tick.
    fn judge(&mut self, now: Time, clock_jumped: bool) {
        let contradicts = self.heard.speed_contradicts(&self.limits.powertrain);
        self.contradicted = contradicts.then(|| self.contradicted.unwrap_or(now));
        let mut status = VehicleStatus::default();
        let mut fresh = self.heard.reference_nm.is_some_and(|nm| nm.value > 0.0) && !clock_jumped;
        for signal in SafetySignal::ALL {
            let age_s = self.age_s(signal, now);
            status.set_age_s(signal, age_s.abs());
            if age_s.abs() > lost_after_s(signal) {
                fresh = false;
            }
        }
        if !fresh {
            status.raise(VehicleFault::SignalLost, now);
        }
        for event in self.supervisor.events() {
            status.raise(fault_of(event.fault), event.since);
        }
        if self.bus_error.is_some() {
            status.raise(VehicleFault::BusOff, now);
        }
        let present = |fault| status.since(fault).is_some();
        let conditions = Conditions {
            claimed: self.claim.address().is_some(),
            fresh: !present(VehicleFault::SignalLost),
            accepted: self.accepted(),
            driver: self.driver_acts(now),
            wrong: [
                VehicleFault::CounterJump,
                VehicleFault::Checksum,
                VehicleFault::RateViolation,
                VehicleFault::BusOff,
                VehicleFault::Flooded,
            ]
            .into_iter()
            .any(present),
            intruder: present(VehicleFault::Spoofed) || present(VehicleFault::AddressConflict),
        };
        self.clutch.update(now, conditions);
        if !self.clutch.state().actuates() {
            status.raise(VehicleFault::DriverOverride, self.clutch.since());
        }
        self.stopping &= self.clutch.state().actuates();
        if !conditions.claimed || !conditions.accepted || self.stopping {
            status.raise(VehicleFault::NotReady, now);
        }
        for known in self.status.faults() {
            if status.since(known.fault).is_some() {
                status.raise(known.fault, known.since);
            }
        }
        self.status = status;
    }
}

/// What an event on the bus is to the guard.
const fn fault_of(fault: BusFault) -> VehicleFault {
    match fault {
        BusFault::SignalLost { .. } => VehicleFault::SignalLost,
        BusFault::CounterJump { .. } | BusFault::CounterStuck { .. } => VehicleFault::CounterJump,
        BusFault::Checksum { .. } => VehicleFault::Checksum,
        BusFault::RateViolation { .. } => VehicleFault::RateViolation,
        BusFault::Spoofed { .. } => VehicleFault::Spoofed,
        BusFault::AddressConflict { .. } | BusFault::NullName { .. } => {
            VehicleFault::AddressConflict
        }
        BusFault::Flooded | BusFault::Overloaded => VehicleFault::Flooded,
    }
}

impl<B: Bus, P: PoseSource, S: SteeringLink> Vehicle for BusTruck<B, P, S> {
    type Error = TruckError<P::Error>;

    /// The state as of what has come in by `now`, stamped with the time of the pose; the ages of all
    /// other signals are in [`Vehicle::status`]. A bus that fails is a fault in the status.
    fn ego(&mut self, now: Time) -> Result<Stamped<EgoState>, Self::Error> {
        let clock_jumped = self.now.replace(now).is_some_and(|last| {
            let passed_s = now.seconds_since(last);
            !(0.0..=TICK_MAX_S).contains(&passed_s)
        });
        self.bus_error = self.receive(now).err();
        self.supervisor.poll(now);
        self.meter_fuel(now);
        self.tell_pose();
        let pose = match self.pose.pose(now) {
            Ok(pose) => {
                self.last_pose = Some(pose);
                Ok(pose)
            }
            Err(error) => self.last_pose.ok_or(TruckError::Pose(error)),
        };
        self.judge(now, clock_jumped);
        let Stamped { time, value } = pose?;
        let asked = match self.clutch.state().actuates() {
            true => self.commanded.xbr_decel_m_s2,
            false => 0.0,
        };
        let ego = ego_state(&self.heard, &value, &self.limits, asked, self.fuel_used_g);
        Ok(Stamped { time, value: ego })
    }

    /// Sends what is due of the command, if the system is engaged; otherwise lets go, once.
    fn command(&mut self, now: Time, command: &Command) -> Result<(), Self::Error> {
        command.check_finite().map_err(TruckError::Command)?;
        self.commanded = *command;
        let (address, state) = (self.claim.address(), self.clutch.state());
        let sent = match (address, self.heard.reference_nm) {
            (Some(sa), Some(reference)) if state.actuates() => {
                let situation = Situation {
                    limits: &self.limits.powertrain,
                    engine_speed_rad_s: self.heard.engine_speed_rad_s.map_or(0.0, |n| n.value),
                    reference_nm: reference.value,
                    state,
                    sa,
                };
                let (config, steering) = (&self.config, self.steering.as_mut());
                self.sender.demand(now, command, config, &situation, steering, &mut self.bus)
            }
            _ => {
                let (config, steering) = (&self.config, self.steering.as_mut());
                self.sender.release(now, config, address, steering, &mut self.bus)
            }
        };
        match sent {
            Ok(()) => Ok(()),
            Err(SendError::Frame(error)) => Err(TruckError::Frame(error)),
            // The next tick's status says so
            Err(SendError::Bus(_)) => Ok(()),
        }
    }

    fn limits(&self) -> &VehicleLimits {
        &self.limits
    }

    fn status(&self) -> VehicleStatus {
        self.status
    }
}
