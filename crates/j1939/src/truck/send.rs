//! What goes to the truck, and when.

use tractrix_core::{Command, PowertrainLimits, Time};

use super::demand::{
    Urgency, brake_demand, engine_demand, gear_demand, retarder_demand, torque_release,
};
use super::{BusTruckConfig, Engagement};
use crate::bus::{Bus, BusError};
use crate::check::Sealer;
use crate::message::{Adsc1, Tc1};
use crate::steering::{SteeringDemand, SteeringLink};
use crate::{Frame, GLOBAL_ADDRESS, J1939Error, Message, Slot};

const MS: i64 = 1_000_000;
/// A frame may go so much before its time: ticks jitter.
const SLACK: i64 = MS;

/// When something was sent last.
#[derive(Debug, Clone, Copy, Default)]
struct Sent(Option<Time>);

impl Sent {
    /// Whether it is time again; a clock that went back starts anew.
    fn due(&mut self, now: Time, period: i64) -> bool {
        let due = self.0.is_none_or(|last| {
            let passed = now.0.saturating_sub(last.0);
            passed < 0 || passed.saturating_add(SLACK) >= period
        });
        if due {
            self.0 = Some(now);
        }
        due
    }
}

/// What the present demand depends on besides the command.
#[derive(Debug, Clone, Copy)]
pub(super) struct Situation<'a> {
    pub limits: &'a PowertrainLimits,
    pub engine_speed_rad_s: f64,
    pub reference_nm: f64,
    pub state: Engagement,
    /// Our address.
    pub sa: u8,
}

/// Counters and times of everything that is sent.
#[derive(Debug, Clone)]
pub(super) struct Sender {
    engine: Sealer,
    retarders: [Sealer; 3],
    xbr: Sealer,
    engine_sent: Sent,
    retarders_sent: Sent,
    xbr_sent: Sent,
    brakes_asked: bool,
    gear_sent: Sent,
    gear: Option<Tc1>,
    consent_sent: Sent,
    steering_sent: Sent,
    /// Whether anything is asked of the truck at present.
    asking: bool,
    /// Frames that the bus had no room for.
    pub(super) unsent: u64,
}

impl Sender {
    pub(super) const fn new(config: &BusTruckConfig) -> Self {
        let never = Sent(None);
        Self {
            engine: Sealer::new(config.tsc1),
            retarders: [Sealer::new(config.tsc1); 3],
            xbr: Sealer::new(config.xbr),
            engine_sent: never,
            retarders_sent: never,
            xbr_sent: never,
            brakes_asked: false,
            gear_sent: never,
            gear: None,
            consent_sent: never,
            steering_sent: never,
            asking: false,
            unsent: 0,
        }
    }

    /// Sends what is due of a command.
    pub(super) fn demand(
        &mut self,
        now: Time,
        command: &Command,
        config: &BusTruckConfig,
        situation: &Situation<'_>,
        steering: Option<&mut impl SteeringLink>,
        bus: &mut impl Bus,
    ) -> Result<(), SendError> {
        self.asking = true;
        let Situation { limits, engine_speed_rad_s, reference_nm, state, sa } = *situation;
        let purpose = config.control_purpose;
        let urgency = match state {
            Engagement::MinimalRisk => Urgency::MinimalRisk,
            _ => Urgency::Normal,
        };
        if self.engine_sent.due(now, 10 * MS) {
            let torque =
                engine_demand(command, limits, engine_speed_rad_s, reference_nm, urgency, purpose);
            let frame = self.engine.seal(torque, config.engine, sa)?;
            self.put(now, &frame, bus)?;
        }
        let brakes_asked = command.brake_mode != tractrix_core::BrakeMode::Off;
        let period = if brakes_asked || self.brakes_asked { 20 * MS } else { 200 * MS };
        let began = brakes_asked && !self.brakes_asked;
        if self.xbr_sent.due(now, if began { 0 } else { period }) {
            self.brakes_asked = brakes_asked;
            let frame = self.xbr.seal(brake_demand(command, urgency), config.brakes, sa)?;
            self.put(now, &frame, bus)?;
        }
        if let Some(link) = steering
            && self.steering_sent.due(now, 10 * MS)
        {
            let demand = SteeringDemand {
                follow: true,
                steering_wheel_rad: command.steering_wheel_rad.clamp(-WHEEL_MAX, WHEEL_MAX),
                rate_max_rad_s: config.wheel_rate_max_rad_s,
            };
            let frame = link.demand(&demand, config.steering, sa)?;
            self.put(now, &frame, bus)?;
        }
        if self.retarders_sent.due(now, 50 * MS) {
            let torque = retarder_demand(command, urgency, purpose);
            for (sealer, da) in self.retarders.iter_mut().zip(config.retarders) {
                let Some(da) = da else { continue };
                put(now, &sealer.seal(torque, da, sa)?, bus, &mut self.unsent)?;
            }
        }
        self.ask_gear(now, gear_demand(command), config, sa, bus)?;
        if self.consent_sent.due(now, 1000 * MS) {
            self.put(now, &consent(true, sa)?, bus)?;
        }
        Ok(())
    }

    /// Every 50 ms while a gear is asked for, at once when it changes; one frame without a wish
    /// gives the choice back.
    fn ask_gear(
        &mut self,
        now: Time,
        gear: Option<Tc1>,
        config: &BusTruckConfig,
        sa: u8,
        bus: &mut impl Bus,
    ) -> Result<(), SendError> {
        let changed = gear != self.gear;
        if !changed && gear.is_none() || !self.gear_sent.due(now, if changed { 0 } else { 50 * MS })
        {
            return Ok(());
        }
        self.gear = gear;
        let frame = gear.unwrap_or_default().frame(config.transmission, sa)?;
        self.put(now, &frame, bus)
    }

    /// Lets go of the truck: one frame of each kind, then silence.
    pub(super) fn release(
        &mut self,
        now: Time,
        config: &BusTruckConfig,
        sa: Option<u8>,
        steering: Option<&mut impl SteeringLink>,
        bus: &mut impl Bus,
    ) -> Result<(), SendError> {
        if !core::mem::take(&mut self.asking) {
            return Ok(());
        }
        let gear_asked = self.gear.take().is_some();
        self.brakes_asked = false;
        for sent in [
            &mut self.engine_sent,
            &mut self.retarders_sent,
            &mut self.xbr_sent,
            &mut self.gear_sent,
            &mut self.consent_sent,
            &mut self.steering_sent,
        ] {
            sent.0 = None;
        }
        // Without an address there is nobody who could say it: the controllers' timeouts act
        let Some(sa) = sa else { return Ok(()) };
        let idle = torque_release(config.control_purpose);
        let frame = self.engine.seal(idle, config.engine, sa)?;
        self.put(now, &frame, bus)?;
        for (sealer, da) in self.retarders.iter_mut().zip(config.retarders) {
            let Some(da) = da else { continue };
            put(now, &sealer.seal(idle, da, sa)?, bus, &mut self.unsent)?;
        }
        let none = brake_demand(&Command::default(), Urgency::Normal);
        let frame = self.xbr.seal(none, config.brakes, sa)?;
        self.put(now, &frame, bus)?;
        if let Some(link) = steering {
            let none =
                SteeringDemand { follow: false, steering_wheel_rad: 0.0, rate_max_rad_s: 0.0 };
            let frame = link.demand(&none, config.steering, sa)?;
            self.put(now, &frame, bus)?;
        }
        if gear_asked {
            self.put(now, &Tc1::default().frame(config.transmission, sa)?, bus)?;
        }
        self.put(now, &consent(false, sa)?, bus)
    }

    fn put(&mut self, now: Time, frame: &Frame, bus: &mut impl Bus) -> Result<(), SendError> {
        put(now, frame, bus, &mut self.unsent)
    }
}

/// The farthest hand wheel that is asked for, rad: the range of SPN 1807.
const WHEEL_MAX: f64 = 31.0;

fn put(now: Time, frame: &Frame, bus: &mut impl Bus, unsent: &mut u64) -> Result<(), SendError> {
    match bus.send(now, frame) {
        // The next period brings a newer one
        Err(BusError::Full(_)) => *unsent += 1,
        result => result?,
    }
    Ok(())
}

/// ADSC1: whether this system uses TSC1 with the purpose of automated driving; it never asks for a
/// speed itself.
fn consent(engaged: bool, sa: u8) -> Result<Frame, J1939Error> {
    let inhibit = u8::from(!engaged);
    Adsc1 { tsc1_p7_inhibit: Slot::Value(inhibit), speed_control_consent: Slot::Value(0) }
        .frame(GLOBAL_ADDRESS, sa)
}

/// Why nothing went out.
#[derive(Debug, thiserror::Error)]
pub(super) enum SendError {
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Frame(#[from] J1939Error),
}
