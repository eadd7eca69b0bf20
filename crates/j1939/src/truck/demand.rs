//! A command as messages, and what a controller reads out of them: both ends in one file.

use tractrix_core::{BrakeMode, Command, GearRequest, PowertrainLimits};

use super::Torque;
use crate::Slot;
use crate::message::{Tc1, Tsc1, Xbr};

/// Hardest deceleration that an XBR asks for, m/s²: the end of its operating range (SPN 2920).
pub const XBR_DECEL_MAX_M_S2: f64 = 10.0;
/// TSC1 controls torque (SPN 695).
const TORQUE_CONTROL: u8 = 2;
/// TSC1 lets go (SPN 695).
const NO_OVERRIDE: u8 = 0;

/// How urgent a demand is (SPN 897 and 2915: 0 is the first, 3 the last).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Urgency {
    /// Planned driving.
    Normal,
    /// The minimal-risk manoeuvre.
    MinimalRisk,
}

impl Urgency {
    const fn priority(self) -> u8 {
        match self {
            Self::Normal => 2,
            Self::MinimalRisk => 0,
        }
    }
}

/// The engine's TSC1 for the pedal of a command at an engine speed, rad/s.
#[must_use]
pub fn engine_demand(
    command: &Command,
    limits: &PowertrainLimits,
    engine_speed_rad_s: f64,
    reference_nm: f64,
    urgency: Urgency,
    control_purpose: u8,
) -> Tsc1 {
    let torque_nm = limits.pedal_torque_nm(command.accelerator_pedal_frac, engine_speed_rad_s);
    torque_demand(torque_nm / reference_nm, urgency, control_purpose, Rate::Ms10)
}

/// A retarder's TSC1 for the retarder demand of a command.
#[must_use]
pub fn retarder_demand(command: &Command, urgency: Urgency, control_purpose: u8) -> Tsc1 {
    torque_demand(-command.retarder_frac, urgency, control_purpose, Rate::Ms50)
}

/// TSC1 that lets go.
#[must_use]
pub fn torque_release(control_purpose: u8) -> Tsc1 {
    Tsc1 {
        override_mode: Slot::Value(NO_OVERRIDE),
        speed_condition: Slot::Value(0),
        priority: Slot::Value(3),
        transmission_rate: Slot::Value(Rate::Ms10 as u8),
        control_purpose: Slot::Value(control_purpose),
        ..Tsc1::default()
    }
}

/// Rates in TSC1 (SPN 3349).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rate {
    Ms50 = 5,
    Ms10 = 7,
}

fn torque_demand(torque_frac: f64, urgency: Urgency, control_purpose: u8, rate: Rate) -> Tsc1 {
    let Torque { coarse_frac, fine_frac } = Torque::of_frac(torque_frac);
    Tsc1 {
        override_mode: Slot::Value(TORQUE_CONTROL),
        speed_condition: Slot::Value(0),
        priority: Slot::Value(urgency.priority()),
        transmission_rate: Slot::Value(rate as u8),
        control_purpose: Slot::Value(control_purpose),
        torque_request_frac: coarse_frac,
        torque_request_fine_frac: fine_frac,
        ..Tsc1::default()
    }
}

/// The torque that a TSC1 asks for, as a fraction of the reference torque; none where it lets go or
/// controls something else.
#[must_use]
pub fn torque_asked(message: &Tsc1) -> Option<f64> {
    let torque = Torque {
        coarse_frac: message.torque_request_frac,
        fine_frac: message.torque_request_fine_frac,
    };
    if message.override_mode == Slot::Value(TORQUE_CONTROL) { torque.frac() } else { None }
}

/// The XBR of a command. A deceleration beyond [`XBR_DECEL_MAX_M_S2`] is that one; a command without
/// one lets go.
#[must_use]
pub fn brake_demand(command: &Command, urgency: Urgency) -> Xbr {
    let mode = match command.brake_mode {
        BrakeMode::Off => 0,
        BrakeMode::Addition => 1,
        BrakeMode::Maximum => 2,
    };
    let decel = if mode == 0 { 0.0 } else { command.xbr_decel_m_s2 };
    Xbr {
        acceleration_demand_m_s2: Slot::Value(-decel.clamp(0.0, XBR_DECEL_MAX_M_S2)),
        // The retarder has its own demand
        endurance_brake_mode: Slot::Value(0),
        priority: Slot::Value(urgency.priority()),
        control_mode: Slot::Value(mode),
        compensation_mode: Slot::Value(0),
        urgency_frac: Slot::Value(if urgency == Urgency::MinimalRisk { 1.0 } else { 0.0 }),
        ..Xbr::default()
    }
}

/// The deceleration, m/s², and the mode that an XBR asks for; `Off` where it lets go.
#[must_use]
pub fn brakes_asked(message: &Xbr) -> (f64, BrakeMode) {
    let mode = match message.control_mode {
        Slot::Value(1) => BrakeMode::Addition,
        Slot::Value(2) => BrakeMode::Maximum,
        _ => return (0.0, BrakeMode::Off),
    };
    match message.acceleration_demand_m_s2 {
        // Zero lies between two steps of the signal: the nearest of them is zero
        Slot::Value(accel) if -accel > 0.5 * XBR_STEP_M_S2 => (-accel, mode),
        Slot::Value(_) => (0.0, mode),
        _ => (0.0, BrakeMode::Off),
    }
}

/// One step of the acceleration in XBR, m/s² (SPN 2920).
const XBR_STEP_M_S2: f64 = 1.0 / 2048.0;

/// The TC1 of a command; none where the transmission chooses itself.
#[must_use]
pub fn gear_demand(command: &Command) -> Option<Tc1> {
    match command.gear {
        GearRequest::Automatic => None,
        GearRequest::Neutral => {
            Some(Tc1 { disengage_driveline_request: Slot::Value(1), ..Tc1::default() })
        }
        GearRequest::Gear(gear) => Some(Tc1 {
            disengage_driveline_request: Slot::Value(0),
            requested_gear: Slot::Value(i16::from(gear.min(MOST_GEAR))),
            ..Tc1::default()
        }),
    }
}

/// The highest gear that TC1 can say (SPN 525).
const MOST_GEAR: u8 = 125;

/// What a TC1 asks of the transmission.
#[must_use]
pub fn gear_asked(message: &Tc1) -> GearRequest {
    let gear = message.requested_gear.value().and_then(|gear| u8::try_from(gear).ok());
    match (message.disengage_driveline_request, gear) {
        (Slot::Value(1), _) | (_, Some(0)) => GearRequest::Neutral,
        (_, Some(gear)) => GearRequest::Gear(gear),
        (_, None) => GearRequest::Automatic,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{Carrier, Sealer};
    use crate::{Id, Message};
    use proptest::prelude::*;

    fn xbr(command: &Command, urgency: Urgency) -> Xbr {
        let frame = Sealer::new(Carrier::XBR).seal(brake_demand(command, urgency), 0x0B, 0x27);
        let frame = frame.unwrap();
        Xbr::decode(frame.id(), frame.bytes()).unwrap()
    }

    proptest! {
        #[test]
        fn a_deceleration_arrives_within_half_a_step(decel in -1.0..14.0_f64, mode in 0..3_u8) {
            let brake_mode =
                [BrakeMode::Off, BrakeMode::Addition, BrakeMode::Maximum][usize::from(mode)];
            let command = Command { xbr_decel_m_s2: decel, brake_mode, ..Command::default() };
            let (asked, asked_mode) = brakes_asked(&xbr(&command, Urgency::Normal));
            prop_assert_eq!(asked_mode, brake_mode);
            let wanted = if mode == 0 { 0.0 } else { decel.clamp(0.0, XBR_DECEL_MAX_M_S2) };
            prop_assert!((asked - wanted).abs() <= 0.5 * XBR_STEP_M_S2 + 1e-9, "{} {}", asked, wanted);
        }

        #[test]
        fn a_retarder_demand_arrives_within_half_a_step(frac in 0.0..=1.0_f64) {
            let command = Command { retarder_frac: frac, ..Command::default() };
            let sent = retarder_demand(&command, Urgency::Normal, 6);
            let frame = Sealer::new(Carrier::TSC1).seal(sent, 0x29, 0x27).unwrap();
            let asked = torque_asked(&Tsc1::decode(frame.id(), frame.bytes()).unwrap()).unwrap();
            prop_assert!((asked + frac).abs() <= 0.5 * super::super::TORQUE_STEP_FRAC + 1e-12);
        }
    }

    #[test]
    fn no_brake_demand_is_exactly_none() {
        let command = Command { brake_mode: BrakeMode::Maximum, ..Command::default() };
        assert_eq!(brakes_asked(&xbr(&command, Urgency::Normal)), (0.0, BrakeMode::Maximum));
        assert_eq!(brakes_asked(&xbr(&Command::default(), Urgency::Normal)).1, BrakeMode::Off);
    }

    #[test]
    fn the_minimal_risk_manoeuvre_comes_first() {
        let xbr = xbr(&Command::default(), Urgency::MinimalRisk);
        assert_eq!((xbr.priority, xbr.urgency_frac), (Slot::Value(0), Slot::Value(1.0)));
        assert_eq!(brake_demand(&Command::default(), Urgency::Normal).priority, Slot::Value(2));
    }

    #[test]
    fn what_lets_go_asks_for_nothing() {
        let release = Sealer::new(Carrier::TSC1).seal(torque_release(6), 0, 0x27).unwrap();
        let release = Tsc1::decode(release.id(), release.bytes()).unwrap();
        assert_eq!(torque_asked(&release), None);
    }

    #[test]
    fn every_gear_request_arrives() {
        for gear in (1..=32).map(GearRequest::Gear).chain([GearRequest::Neutral]) {
            let sent = gear_demand(&Command { gear, ..Command::default() }).unwrap();
            let id = Id::from_raw(0x0C01_0327);
            let heard = Tc1::decode(id, &sent.encode().unwrap()).unwrap();
            assert_eq!(gear_asked(&heard), gear);
        }
        assert_eq!(gear_demand(&Command::default()), None);
        assert_eq!(gear_asked(&Tc1::default()), GearRequest::Automatic);
    }
}
