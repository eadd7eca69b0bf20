//! The virtual truck on a bus: seven control units around a [`SimTruck`].
//!
//! | file | holds |
//! |---|---|
//! | `config` | which units there are: addresses, NAMEs, carriers |
//! | `asked`, `demands` | what they are asked to do, and what of it they refuse |
//! | `messages` | the truck's state as messages |
//! | `schedule` | which message goes out when |
//! | `unit` | address claim, long messages, requests, trouble codes of one unit |
//!
//! **Times.** The units work every 5 ms, the plant's substep. A demand acts from the next step after
//! its frame's end: a dead time of 5 ms at most, before those of the actuators. A message says what
//! was true at the step at which it was sent. A unit whose demand is not repeated five times lets go.

mod asked;
mod config;
mod demands;
mod messages;
mod schedule;
mod unit;

use dynamics::SUBSTEP_S;
use j1939::bus::Bus;
use j1939::check::{Carrier, Sealer};
use j1939::dm::Dtc;
use j1939::message::{Cvw, Message};
use j1939::{ACKNOWLEDGMENT_PGN, ADDRESS_CLAIMED_PGN, GLOBAL_ADDRESS, Id, Request, ident};
use planner::localise::MapProjection;
use tractrix_core::{Command, EgoState, Stamped, Time, Vehicle};

pub use config::{EcuConfig, Unit};
pub use messages::Ahead;
pub use unit::EcuError;

use self::demands::Demands;
use self::messages::Snapshot;
use self::schedule::{Outgoing, Schedule};
use self::unit::{ControlUnit, put};
use crate::{SimError, SimTruck, Simulated};

/// Frames that are taken from the bus in one step; what is beyond waits for the next.
const FRAMES_A_STEP: usize = 1024;
/// Steps that a pause is made up for; beyond, the truck goes on from where it is.
const STEPS_AT_ONCE: i64 = 400;
/// In wall time messages are not sent that were due so many steps ago.
const LATE_STEPS: i64 = 4;
/// Failure modes of trouble codes (SAE J1939-73, appendix A): a network message comes at an abnormal
/// rate, or is in error.
const ABNORMAL_RATE: u8 = 9;
const IN_ERROR: u8 = 19;
/// Vehicle identification number that the engine tells: no maker has this one.
const VIN: &str = "TRACTRIX000000001";

/// What can be broken about the virtual truck.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EcuFault {
    /// A control unit neither sends nor does what it is asked.
    Silent(Unit),
    /// The wheel speed sensors report what they reported when the fault began.
    FrozenWheels,
}

/// The virtual truck on bus `B`. Who moves it is whoever sends the right demands.
#[derive(Debug, Clone)]
pub struct EcuSim<B> {
    truck: SimTruck,
    bus: B,
    units: [ControlUnit; Unit::ALL.len()],
    demands: Demands,
    schedule: Schedule,
    sas: Sealer,
    sas_due: Time,
    ahead: Option<Ahead>,
    /// Speed that frozen wheel sensors report, m/s.
    frozen_m_s: Option<f64>,
    start_s_m: f64,
    ego: Stamped<EgoState>,
    step: Time,
    /// Messages that were due by then are not sent.
    silent_until: Time,
    /// Bus time at which the truck was let go; before it, it is held where it stands or rolls.
    let_go: Option<Time>,
    refused: u64,
    /// What the satellite receiver tells the place with.
    projection: Option<MapProjection>,
}

impl<B> Simulated for EcuSim<B> {
    fn sim(&self) -> &SimTruck {
        &self.truck
    }
}

impl<B: Bus> EcuSim<B> {
    /// The virtual truck; its units begin to claim their addresses at `start`. It is held as it is
    /// until `let_go`; without such a time until somebody asks it to do something.
    ///
    /// # Errors
    /// [`SimError`] if the truck cannot be read.
    pub fn new(
        mut truck: SimTruck,
        bus: B,
        config: EcuConfig,
        start: Time,
        let_go: Option<Time>,
    ) -> Result<Self, SimError> {
        let ego = truck.ego(Time::ZERO)?;
        // A map that is nowhere on the earth has no satellites
        let reference = truck.road().geo_reference();
        let projection = reference.and_then(|reference| MapProjection::new(reference).ok());
        Ok(Self {
            projection,
            bus,
            units: Unit::ALL.map(|unit| ControlUnit::new(unit, start)),
            demands: Demands::new(config, ego.value.steering_wheel_rad),
            schedule: Schedule::new(start),
            sas: Sealer::new(Carrier::SAS),
            sas_due: start,
            ahead: None,
            frozen_m_s: None,
            start_s_m: ego.value.s_m,
            ego,
            truck,
            step: start,
            silent_until: start,
            let_go,
            refused: 0,
        })
    }

    /// Control units in wall time: what a pause of the program kept from being said is not said any
    /// more, as a unit that stood still would not either.
    pub fn say_nothing_late(&mut self, now: Time) {
        let step_ns = Time::from_seconds(SUBSTEP_S).0;
        self.silent_until = now.plus_nanos(-LATE_STEPS * step_ns);
    }

    /// Moves units and truck to `now`, in steps of 5 ms, and tells the truck's state as its
    /// instruments have it.
    ///
    /// # Errors
    /// [`SimError`] when the bus cannot be used or the truck's state is no longer finite.
    pub fn advance(&mut self, now: Time) -> Result<Stamped<EgoState>, SimError> {
        let step_ns = Time::from_seconds(SUBSTEP_S).0;
        if (now.0 - self.step.0) / step_ns > STEPS_AT_ONCE {
            self.step = now;
        }
        while self.step.plus_nanos(step_ns) <= now {
            self.step = self.step.plus_nanos(step_ns);
            self.one_step()?;
        }
        Ok(self.ego)
    }

    /// Shows the radar what is ahead.
    pub const fn see(&mut self, ahead: Option<Ahead>) {
        self.ahead = ahead;
    }

    /// When the truck was, or will be, let go.
    #[must_use]
    pub const fn let_go(&self) -> Option<Time> {
        self.let_go
    }

    /// Breaks something, or mends it.
    pub fn set_fault(&mut self, fault: EcuFault, is_on: bool) {
        match fault {
            EcuFault::Silent(unit) => self.unit(unit).is_silent = is_on,
            EcuFault::FrozenWheels => {
                self.frozen_m_s = is_on.then_some(self.ego.value.speed_m_s);
            }
        }
    }

    /// The state that was told last.
    #[must_use]
    pub const fn ego(&self) -> &Stamped<EgoState> {
        &self.ego
    }

    /// Demands that were refused because counter, checksum or length were wrong.
    #[must_use]
    pub const fn refused(&self) -> u64 {
        self.refused
    }

    /// Active trouble codes of a unit.
    #[must_use]
    pub fn trouble_codes(&self, unit: Unit) -> Vec<Dtc> {
        self.units.iter().find(|u| u.unit == unit).map_or(Vec::new(), |u| u.active(self.step))
    }

    /// The bus.
    pub const fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    fn unit(&mut self, unit: Unit) -> &mut ControlUnit {
        let [engine, transmission, brakes, steering, retarder, radar, cab] = &mut self.units;
        match unit {
            Unit::Engine => engine,
            Unit::Transmission => transmission,
            Unit::Brakes => brakes,
            Unit::Steering => steering,
            Unit::Retarder => retarder,
            Unit::Radar => radar,
            Unit::Cab => cab,
        }
    }

    fn one_step(&mut self) -> Result<(), SimError> {
        let now = self.step;
        if let Some(let_go) = self.let_go.filter(|let_go| now >= *let_go) {
            let ego = self.truck.ego(now.plus_nanos(-let_go.0))?;
            self.ego = Stamped { time: now, ..ego };
        }
        self.listen(now)?;
        if self.let_go.is_none() && self.demands.is_any(now) {
            self.let_go = Some(now);
        }
        let command = self.command(now);
        self.truck.command(now, &command)?;
        if now > self.silent_until {
            self.speak(now)?;
        }
        Ok(())
    }

    /// Takes what has come in: demands, claims, requests.
    fn listen(&mut self, now: Time) -> Result<(), EcuError> {
        for _ in 0..FRAMES_A_STEP {
            let Some(Stamped { value: frame, .. }) = self.bus.receive(now)? else { break };
            if let Some(unit) = self.demands.hear(now, &frame) {
                self.refused += 1;
                self.unit(unit).note(now, demanded_spn(unit), IN_ERROR);
            }
            for at in 0..self.units.len() {
                let Some(unit) = self.units.get_mut(at) else { break };
                if let Some(request) = unit.hear(now, &frame) {
                    self.answer(now, at, request)?;
                }
            }
        }
        for unit in self.demands.expire(now) {
            self.unit(unit).note(now, demanded_spn(unit), ABNORMAL_RATE);
        }
        Ok(())
    }

    /// What the actuators are to follow now.
    fn command(&mut self, now: Time) -> Command {
        for unit in self.units.iter().filter(|u| u.is_silent) {
            self.demands.forget(unit.unit);
        }
        let reference_nm = self.truck.model().parameters().engine.reference_torque_nm;
        let engine_speed_rad_s = self.ego.value.powertrain.engine_speed_rad_s;
        let limits = &self.truck.limits().powertrain;
        self.demands.command(now, SUBSTEP_S, limits, reference_nm, engine_speed_rad_s)
    }

    /// The truck as it is now, for its messages.
    fn snapshot(&self, now: Time) -> Snapshot<'_> {
        let ego = &self.ego.value;
        Snapshot {
            truck: &self.truck,
            ego,
            wheel_speed_m_s: self.frozen_m_s.unwrap_or(ego.speed_m_s),
            ahead: self.ahead,
            driven_m: ego.s_m - self.start_s_m,
            engine_master: self.demands.engine_master(now),
            retarder_master: self.demands.retarder_master(now),
            brake_mode: self.demands.brake_mode(now),
            projection: self.projection.as_ref(),
        }
    }

    /// Sends what is due.
    fn speak(&mut self, now: Time) -> Result<(), EcuError> {
        for unit in &mut self.units {
            unit.poll(now, &mut self.bus)?;
        }
        let addresses = self.units.each_ref().map(ControlUnit::address);
        let address = |unit: Unit| addresses.get(unit as usize).copied().flatten();
        let mut schedule = self.schedule.clone();
        let messages = schedule.take(now, &self.snapshot(now), address)?;
        self.schedule = schedule;
        for (unit, message) in messages {
            match message {
                Outgoing::Frame(frame) => put(now, &frame, &mut self.bus)?,
                Outgoing::None => {}
                Outgoing::Long(table, bytes, len) => {
                    let bytes = bytes.get(..len).unwrap_or(&bytes);
                    let unit = self.unit(unit);
                    unit.send_long(now, table.priority, table.pgn, GLOBAL_ADDRESS, bytes)?;
                }
            }
        }
        if now >= self.sas_due
            && let Some(sa) = address(Unit::Steering)
        {
            self.sas_due = now.plus_nanos(SAS_PERIOD);
            let frame = self.sas.seal(self.snapshot(now).sas(), GLOBAL_ADDRESS, sa)?;
            put(now, &frame, &mut self.bus)?;
        }
        Ok(())
    }

    /// Answers a request that a unit got.
    fn answer(&mut self, now: Time, at: usize, request: Request) -> Result<(), EcuError> {
        let Some(unit) = self.units.get(at).map(|u| u.unit) else { return Ok(()) };
        let (sa, mut buffer) = (unit.address(), [0; 128]);
        let id = Id::new(6, request.pgn, GLOBAL_ADDRESS, sa).ok();
        let snapshot = self.snapshot(now);
        let message = match (request.pgn, id) {
            // The claim answers these itself, and who asks for acknowledgments gets none
            (ADDRESS_CLAIMED_PGN | ACKNOWLEDGMENT_PGN, _) => return Ok(()),
            (pgn, _) if unit == Unit::Brakes && pgn == Cvw::TABLE.pgn => {
                Some(snapshot.cvw().encode()?.to_vec())
            }
            (ident::VI, Some(id)) if unit == Unit::Engine => {
                Some(ident::write(id, &[VIN], &mut buffer)?.to_vec())
            }
            (ident::CI, Some(id)) => {
                let fields = ["TRCTX", "VIRTUAL", "1", "1"];
                Some(ident::write(id, &fields, &mut buffer)?.to_vec())
            }
            (pgn, _) => match schedule::requested(unit, pgn, &snapshot, sa).transpose()? {
                Some(Outgoing::Frame(frame)) => Some(frame.bytes().to_vec()),
                Some(Outgoing::Long(_, bytes, len)) => {
                    Some(bytes.get(..len).unwrap_or(&bytes).to_vec())
                }
                Some(Outgoing::None) | None => None,
            },
        };
        match self.units.get_mut(at) {
            Some(unit) => unit.answer(now, request, message.as_deref(), &mut self.bus),
            None => Ok(()),
        }
    }
}

/// Period of SAS, ns.
const SAS_PERIOD: i64 = 10_000_000;

/// The signal in whose trouble code a unit says that its demand cannot be used: the checksum of TSC1
/// and of XBR, the gear of TC1, and the first of the makers' numbers for the steering.
const fn demanded_spn(unit: Unit) -> u32 {
    match unit {
        Unit::Brakes => 3_188,
        Unit::Transmission => 525,
        Unit::Steering => 516_096,
        Unit::Engine | Unit::Retarder | Unit::Radar | Unit::Cab => 4_207,
    }
}
