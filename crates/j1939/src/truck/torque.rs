//! Torque in TSC1 and EEC1: a share of a reference torque, in percent and eighths of a percent.
//!
//! Both ends use this file: who asks for torque and who delivers it. The percent steps are those of
//! SPN 518 and 513, the eighths those of SPN 4191 and 4154. A pedal is a torque at the present
//! engine speed ([`tractrix_core::PowertrainLimits::pedal_torque_nm`] and its inverse).

use crate::Slot;

/// One step of a torque with its fine part, as a fraction of the reference torque.
pub const TORQUE_STEP_FRAC: f64 = 0.001_25;
/// Steps of the fine part in one step of the coarse one.
const FINE_STEPS: f64 = 8.0;
/// The least and the most that the coarse part can say, percent.
const RANGE_PERCENT: (f64, f64) = (-125.0, 125.0);

/// A torque as the two signals of a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Torque {
    /// Whole percent, as a fraction of the reference torque.
    pub coarse_frac: Slot<f64>,
    /// What is to be added, as a fraction of the reference torque.
    pub fine_frac: Slot<f64>,
}

impl Torque {
    /// The nearest torque that a message can say; beyond -125 % and +125 % the outermost, and "not
    /// available" for what is not a number.
    #[must_use]
    pub fn of_frac(torque_frac: f64) -> Self {
        if torque_frac.is_nan() {
            return Self { coarse_frac: Slot::NotAvailable, fine_frac: Slot::NotAvailable };
        }
        let (least, most) = RANGE_PERCENT;
        let percent = (100.0 * torque_frac).clamp(least, most);
        let steps = libm::round(percent * FINE_STEPS).min(most * FINE_STEPS);
        let coarse = libm::floor(steps / FINE_STEPS);
        Self {
            coarse_frac: Slot::Value(0.01 * coarse),
            fine_frac: Slot::Value(TORQUE_STEP_FRAC * (steps - coarse * FINE_STEPS)),
        }
    }

    /// The torque, as a fraction of the reference torque; none where the coarse part is no number.
    /// A sender without a fine part sends whole percent.
    #[must_use]
    pub fn frac(self) -> Option<f64> {
        Some(self.coarse_frac.value()? + self.fine_frac.value().unwrap_or(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Eec1, Tsc1};
    use crate::{Id, Message};

    /// A torque through the bytes of both messages and back.
    fn through_the_wire(torque_frac: f64) -> [Option<f64>; 2] {
        let Torque { coarse_frac, fine_frac } = Torque::of_frac(torque_frac);
        let id = Id::from_raw(0x0C00_0027);
        let asked = Tsc1 {
            override_mode: Slot::Value(2),
            speed_condition: Slot::Value(0),
            priority: Slot::Value(0),
            transmission_rate: Slot::Value(0),
            control_purpose: Slot::Value(6),
            counter: Slot::Value(0),
            checksum: Slot::Value(0),
            torque_request_frac: coarse_frac,
            torque_request_fine_frac: fine_frac,
            ..Tsc1::default()
        };
        let asked = Tsc1::decode(id, &asked.encode().unwrap()).unwrap();
        let given = Eec1 {
            torque_mode: Slot::Value(0),
            torque_frac: coarse_frac,
            torque_fine_frac: fine_frac,
            ..Eec1::default()
        };
        let given = Eec1::decode(id, &given.encode().unwrap()).unwrap();
        [
            Torque {
                coarse_frac: asked.torque_request_frac,
                fine_frac: asked.torque_request_fine_frac,
            },
            Torque { coarse_frac: given.torque_frac, fine_frac: given.torque_fine_frac },
        ]
        .map(Torque::frac)
    }

    #[test]
    fn a_torque_arrives_within_half_a_step() {
        for i in -125_000..=125_000 {
            let torque_frac = f64::from(i) * 1e-5;
            for arrived in through_the_wire(torque_frac) {
                let off = (arrived.unwrap() - torque_frac).abs();
                assert!(off <= 0.5 * TORQUE_STEP_FRAC + 1e-12, "{torque_frac}: {off}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_the_outermost_and_what_is_no_number_is_not_sent() {
        assert_eq!(through_the_wire(9.0), [Some(1.25); 2]);
        assert_eq!(through_the_wire(f64::NEG_INFINITY), [Some(-1.25); 2]);
        assert_eq!(through_the_wire(f64::NAN), [None; 2]);
    }

    #[test]
    fn a_sender_without_a_fine_part_sends_whole_percent() {
        let torque = Torque { coarse_frac: Slot::Value(0.5), fine_frac: Slot::NotAvailable };
        assert_eq!(torque.frac(), Some(0.5));
    }
}
