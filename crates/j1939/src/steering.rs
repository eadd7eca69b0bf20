//! How a steering demand reaches an actuator.
//!
//! The standard has messages for what the steering does (VDC2, SAS, ESC1) and none that asks for an
//! angle: every maker has its own proprietary frame, known under contract only. [`SteeringLink`] is
//! the place for it. [`ExampleSteering`] is an example that shows what such a frame needs; no truck
//! understands it but the simulated one.

use crate::check::{Carrier, Checker, Formula, Policy, Protection, Sealer};
use crate::message::PROPRIETARY_A;
use crate::slot::data_max;
use crate::{Frame, J1939Error, Signal, Slot};

/// What is asked of the steering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteeringDemand {
    /// Whether the actuator shall follow; otherwise it lets go and the angle means nothing.
    pub follow: bool,
    /// Hand-wheel angle, rad, positive left.
    pub steering_wheel_rad: f64,
    /// The fastest that the hand wheel may turn, rad/s.
    pub rate_max_rad_s: f64,
}

/// A maker's steering frame, both ends: the driving system writes, a simulated actuator reads.
pub trait SteeringLink {
    /// The next frame with this demand, from `sa` to the actuator at `da`.
    ///
    /// # Errors
    /// For a demand outside the frame's range.
    fn demand(&mut self, demand: &SteeringDemand, da: u8, sa: u8) -> Result<Frame, J1939Error>;

    /// The demand in a received frame; `None` for a frame that is none of this link.
    ///
    /// # Errors
    /// For a demand that must not act: counter or checksum wrong, a signal not available.
    fn read(&mut self, frame: &Frame) -> Result<Option<SteeringDemand>, J1939Error>;
}

/// An example of a steering frame: Proprietary A to the actuator, priority 3.
///
/// | bytes | what | unit |
/// |---|---|---|
/// | 1-2 | hand-wheel angle | 1/1024 rad, -31.374 rad |
/// | 3-4 | fastest hand-wheel rate | 1/1024 rad/s |
/// | 5, bits 1-2 | 0 let go, 1 follow | |
/// | 8 | counter (low half, wraps at 16) and checksum (high half), formula of XBR with a key | |
///
/// All other bits are ones. Both ends must know the key.
#[derive(Debug, Clone, Copy)]
pub struct ExampleSteering {
    sealer: Sealer,
    checker: Checker,
}

const fn signal(name: &'static str, unit: &'static str, start_bit: u16, length_bits: u8) -> Signal {
    Signal {
        pgn: PROPRIETARY_A,
        spn: 0,
        name,
        unit,
        start_bit,
        length_bits,
        scale: 1.0,
        offset: 0.0,
        data_max: data_max(length_bits),
        is_code: true,
    }
}

const ANGLE: Signal = Signal {
    scale: 1.0 / 1024.0,
    offset: -31.374,
    is_code: false,
    ..signal("steering_wheel_rad", "rad", 0, 16)
};
const RATE: Signal =
    Signal { scale: 1.0 / 1024.0, is_code: false, ..signal("rate_max_rad_s", "rad/s", 16, 16) };
const MODE: Signal = signal("mode", "", 32, 2);

impl ExampleSteering {
    /// Both ends of a link with this key in the checksum.
    #[must_use]
    pub const fn new(key: u8) -> Self {
        let protection = Protection { formula: Formula::FourBits, counter_modulus: 16, key };
        let carrier = Carrier { pgn: PROPRIETARY_A, priority: 3, protection };
        Self { sealer: Sealer::new(carrier), checker: Checker::new(protection, Policy::Required) }
    }
}

impl SteeringLink for ExampleSteering {
    fn demand(&mut self, demand: &SteeringDemand, da: u8, sa: u8) -> Result<Frame, J1939Error> {
        let mut data = [0xFF; 8];
        ANGLE.write(&mut data, Slot::Value(demand.steering_wheel_rad))?;
        RATE.write(&mut data, Slot::Value(demand.rate_max_rad_s))?;
        MODE.write(&mut data, Slot::Value(f64::from(u8::from(demand.follow))))?;
        self.sealer.seal_bytes(data, da, sa)
    }

    fn read(&mut self, frame: &Frame) -> Result<Option<SteeringDemand>, J1939Error> {
        let (pgn, sa) = (frame.id().pgn(), frame.id().sa());
        if pgn != PROPRIETARY_A {
            return Ok(None);
        }
        let verdict = self.checker.check(frame);
        if !verdict.passes() {
            return Err(J1939Error::Unprotected { pgn, sa, verdict });
        }
        let number = |signal: Signal| {
            let missing = J1939Error::NoValue { pgn, sa, signal: signal.name };
            signal.decode(frame.bytes()).value().ok_or(missing)
        };
        Ok(Some(SteeringDemand {
            follow: number(MODE)? == 1.0,
            steering_wheel_rad: number(ANGLE)?,
            rate_max_rad_s: number(RATE)?,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::Verdict;

    const LEFT: SteeringDemand =
        SteeringDemand { follow: true, steering_wheel_rad: 0.75, rate_max_rad_s: 5.0 };

    #[test]
    fn a_demand_arrives_within_half_a_step() {
        let (mut here, mut there) = (ExampleSteering::new(9), ExampleSteering::new(9));
        for i in 0..40 {
            let demand = SteeringDemand { steering_wheel_rad: 0.01 * f64::from(i) - 0.2, ..LEFT };
            let frame = here.demand(&demand, 0x13, 0x27).unwrap();
            assert_eq!(frame.id().raw(), 0x0CEF_1327);
            let read = there.read(&frame).unwrap().unwrap();
            assert!((read.steering_wheel_rad - demand.steering_wheel_rad).abs() <= 0.5 / 1024.0);
            assert_eq!((read.follow, read.rate_max_rad_s), (true, 5.0));
        }
    }

    #[test]
    fn what_must_not_act_is_an_error() {
        let mut here = ExampleSteering::new(9);
        let frame = here.demand(&LEFT, 0x13, 0x27).unwrap();
        let refused = ExampleSteering::new(8).read(&frame).unwrap_err();
        assert!(matches!(
            refused,
            J1939Error::Unprotected { verdict: Verdict::Checksum { .. }, .. }
        ));
        let mut there = ExampleSteering::new(9);
        assert!(there.read(&frame).is_ok());
        let refused = there.read(&frame).unwrap_err();
        assert!(matches!(refused, J1939Error::Unprotected { verdict: Verdict::Stuck { .. }, .. }));
        let beyond = SteeringDemand { steering_wheel_rad: f64::NAN, ..LEFT };
        assert!(here.demand(&beyond, 0x13, 0x27).is_err());
    }

    #[test]
    fn frames_of_others_are_none_of_this_link() {
        let other = Frame::of(crate::Id::from_raw(0x0CF0_0400), [0; 8]);
        assert_eq!(ExampleSteering::new(0).read(&other), Ok(None));
    }
}
