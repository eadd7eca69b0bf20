//! From frames to the command that the truck's actuators follow.

use j1939::message::{Message, Tc1, Tsc1, Xbr};
use j1939::steering::{ExampleSteering, SteeringDemand, SteeringLink};
use j1939::truck::{brakes_asked, gear_asked, torque_asked};
use j1939::{Frame, J1939Error, Slot};
use tractrix_core::{BrakeMode, Command, GearRequest, PowertrainLimits, Time};

use super::asked::Asked;
use super::{EcuConfig, Unit};

const MS: i64 = 1_000_000;
/// A demand ends when five of its frames are missing, ns.
const ENGINE_TIMEOUT: i64 = 50 * MS;
const RETARDER_TIMEOUT: i64 = 250 * MS;
const BRAKE_TIMEOUT: i64 = 100 * MS;
const GEAR_TIMEOUT: i64 = 250 * MS;
const STEERING_TIMEOUT: i64 = 50 * MS;

/// All demands on the truck.
#[derive(Debug, Clone)]
pub(super) struct Demands {
    config: EcuConfig,
    engine: Asked<f64>,
    retarder: Asked<f64>,
    brakes: Asked<(f64, BrakeMode)>,
    gear: Asked<GearRequest>,
    steering: Asked<SteeringDemand>,
    link: ExampleSteering,
    /// The hand wheel as it is asked of the steering motor now, rad.
    wheel_rad: f64,
}

impl Demands {
    pub(super) fn new(config: EcuConfig, wheel_rad: f64) -> Self {
        let torque = Some(config.tsc1.protection);
        Self {
            engine: Asked::new(torque, ENGINE_TIMEOUT),
            retarder: Asked::new(torque, RETARDER_TIMEOUT),
            brakes: Asked::new(Some(config.xbr.protection), BRAKE_TIMEOUT),
            gear: Asked::new(None, GEAR_TIMEOUT),
            steering: Asked::new(None, STEERING_TIMEOUT),
            link: ExampleSteering::new(config.steering_key),
            config,
            wheel_rad,
        }
    }

    /// Takes a frame. The unit that refuses it, if it is a demand that must not act.
    pub(super) fn hear(&mut self, now: Time, frame: &Frame) -> Option<Unit> {
        let id = frame.id();
        let to = |unit: Unit| id.da() == unit.address();
        let (unit, result) = match id.pgn() {
            pgn if pgn == self.config.tsc1.pgn && to(Unit::Engine) => {
                (Unit::Engine, hear_torque(&mut self.engine, now, frame))
            }
            pgn if pgn == self.config.tsc1.pgn && to(Unit::Retarder) => {
                (Unit::Retarder, hear_torque(&mut self.retarder, now, frame))
            }
            pgn if pgn == self.config.xbr.pgn && to(Unit::Brakes) => {
                (Unit::Brakes, self.hear_brakes(now, frame))
            }
            pgn if pgn == Tc1::TABLE.pgn && to(Unit::Transmission) => {
                (Unit::Transmission, self.hear_gear(now, frame))
            }
            _ if to(Unit::Steering) => (Unit::Steering, self.hear_steering(now, frame)),
            _ => return None,
        };
        result.is_err().then_some(unit)
    }

    fn hear_brakes(&mut self, now: Time, frame: &Frame) -> Result<(), J1939Error> {
        let message = Xbr::decode(frame.id(), frame.bytes())?;
        let (decel_m_s2, mode) = brakes_asked(&message);
        let value = (mode != BrakeMode::Off).then_some((decel_m_s2, mode));
        self.brakes.hear(now, frame, priority(message.priority), value)
    }

    fn hear_gear(&mut self, now: Time, frame: &Frame) -> Result<(), J1939Error> {
        let asked = gear_asked(&Tc1::decode(frame.id(), frame.bytes())?);
        let value = (asked != GearRequest::Automatic).then_some(asked);
        self.gear.hear(now, frame, 0, value)
    }

    fn hear_steering(&mut self, now: Time, frame: &Frame) -> Result<(), J1939Error> {
        let Some(demand) = self.link.read(frame)? else { return Ok(()) };
        self.steering.hear(now, frame, 0, demand.follow.then_some(demand))
    }

    /// Demands that ended because nobody repeated them.
    pub(super) fn expire(&mut self, now: Time) -> impl Iterator<Item = Unit> + use<> {
        let ended = [
            (Unit::Engine, self.engine.expire(now)),
            (Unit::Retarder, self.retarder.expire(now)),
            (Unit::Brakes, self.brakes.expire(now)),
            (Unit::Transmission, self.gear.expire(now)),
            (Unit::Steering, self.steering.expire(now)),
        ];
        ended.into_iter().filter_map(|(unit, ended)| ended.then_some(unit))
    }

    /// Whether anything is asked of the truck at `now`.
    pub(super) fn is_any(&self, now: Time) -> bool {
        self.engine.acting(now).is_some()
            || self.brakes.acting(now).is_some()
            || self.steering.acting(now).is_some()
    }

    /// Who controls the engine now.
    pub(super) fn engine_master(&self, now: Time) -> Option<u8> {
        self.engine.acting(now).map(|d| d.sa)
    }

    /// Who controls the retarder now.
    pub(super) fn retarder_master(&self, now: Time) -> Option<u8> {
        self.retarder.acting(now).map(|d| d.sa)
    }

    /// How the brakes are asked to act now.
    pub(super) fn brake_mode(&self, now: Time) -> BrakeMode {
        self.brakes.acting(now).map_or(BrakeMode::Off, |d| d.value.1)
    }

    /// Forgets what a unit was asked.
    pub(super) fn forget(&mut self, unit: Unit) {
        match unit {
            Unit::Engine => self.engine.forget(),
            Unit::Transmission => self.gear.forget(),
            Unit::Brakes => self.brakes.forget(),
            Unit::Steering => self.steering.forget(),
            Unit::Retarder => self.retarder.forget(),
            Unit::Radar | Unit::Cab => {}
        }
    }

    /// The command of all demands that act at `now`, after `passed_s` of time. Without a demand the
    /// engine idles, brakes and retarder are released, the transmission chooses, and the steering
    /// wheel stays where it is.
    pub(super) fn command(
        &mut self,
        now: Time,
        passed_s: f64,
        limits: &PowertrainLimits,
        reference_nm: f64,
        engine_speed_rad_s: f64,
    ) -> Command {
        if let Some(demand) = self.steering.acting(now) {
            let farthest_rad = demand.value.rate_max_rad_s * passed_s;
            let turn_rad = demand.value.steering_wheel_rad - self.wheel_rad;
            self.wheel_rad += turn_rad.clamp(-farthest_rad, farthest_rad);
        }
        let (xbr_decel_m_s2, brake_mode) =
            self.brakes.acting(now).map_or((0.0, BrakeMode::Off), |d| d.value);
        let torque_nm = self.engine.acting(now).map_or(0.0, |d| d.value * reference_nm);
        Command {
            accelerator_pedal_frac: limits.pedal_frac(torque_nm, engine_speed_rad_s),
            xbr_decel_m_s2,
            brake_mode,
            steering_wheel_rad: self.wheel_rad,
            retarder_frac: self.retarder.acting(now).map_or(0.0, |d| (-d.value).clamp(0.0, 1.0)),
            gear: self.gear.acting(now).map_or(GearRequest::Automatic, |d| d.value),
        }
    }
}

fn hear_torque(asked: &mut Asked<f64>, now: Time, frame: &Frame) -> Result<(), J1939Error> {
    let message = Tsc1::decode(frame.id(), frame.bytes())?;
    asked.hear(now, frame, priority(message.priority), torque_asked(&message))
}

/// The least urgent where none is given.
fn priority(slot: Slot<u8>) -> u8 {
    slot.value().unwrap_or(3)
}
