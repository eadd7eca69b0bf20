//! What is wrong with a truck as seen from its bus: faults with their first time, ages of signals.

use serde::{Deserialize, Serialize};

use crate::Time;

/// What a truck, or the bus before it, can report as wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VehicleFault {
    /// A safety-relevant signal did not come in time.
    SignalLost,
    /// A message counter stands still or jumps.
    CounterJump,
    /// A message's checksum is wrong.
    Checksum,
    /// A message comes more often than its sender sends it.
    RateViolation,
    /// Somebody else sends a message that belongs to another controller.
    Spoofed,
    /// Somebody claims an address that is in use, or with a NAME that cannot be.
    AddressConflict,
    /// The bus is gone: the controller is off, or nothing can be sent.
    BusOff,
    /// More traffic or transport sessions than a bus in order has.
    Flooded,
    /// The driver brakes, accelerates or steers.
    DriverOverride,
    /// The truck does not take commands (yet, or any more).
    NotReady,
}

impl VehicleFault {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::SignalLost,
        Self::CounterJump,
        Self::Checksum,
        Self::RateViolation,
        Self::Spoofed,
        Self::AddressConflict,
        Self::BusOff,
        Self::Flooded,
        Self::DriverOverride,
        Self::NotReady,
    ];
}

/// Signals that driving depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SafetySignal {
    /// Speed of the truck over ground, m/s.
    RoadSpeed,
    /// Yaw rate, rad/s.
    YawRate,
    /// Angle of the hand wheel, rad.
    SteeringAngle,
    /// Position and heading on the map.
    Pose,
    /// Engine speed and torque.
    Engine,
    /// Gear and shift.
    Transmission,
    /// State of the service brakes.
    Brakes,
    /// The driver's pedals.
    Pedals,
}

impl SafetySignal {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::RoadSpeed,
        Self::YawRate,
        Self::SteeringAngle,
        Self::Pose,
        Self::Engine,
        Self::Transmission,
        Self::Brakes,
        Self::Pedals,
    ];

    /// Whether the truck cannot be steered without it.
    #[must_use]
    pub const fn steers(self) -> bool {
        matches!(self, Self::RoadSpeed | Self::YawRate | Self::SteeringAngle | Self::Pose)
    }
}

/// A fault that is present.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ActiveFault {
    /// What is wrong.
    pub fault: VehicleFault,
    /// When it was first seen, without a break since.
    pub since: Time,
}

/// What is wrong with the truck now, at most one entry a kind. The default is a truck in order whose
/// signals are not timed one by one (a simulated truck that is read directly).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct VehicleStatus {
    since: [Option<Time>; VehicleFault::ALL.len()],
    age_s: [Option<f64>; SafetySignal::ALL.len()],
}

impl VehicleStatus {
    /// Notes a fault; one that is present already keeps its earlier time.
    pub fn raise(&mut self, fault: VehicleFault, since: Time) {
        if let Some(entry) = self.since.get_mut(fault as usize) {
            *entry = Some(entry.map_or(since, |earlier| earlier.min(since)));
        }
    }

    /// Takes a fault back.
    pub fn clear(&mut self, fault: VehicleFault) {
        if let Some(entry) = self.since.get_mut(fault as usize) {
            *entry = None;
        }
    }

    /// Since when a fault is present; `None`: it is not.
    #[must_use]
    pub fn since(&self, fault: VehicleFault) -> Option<Time> {
        self.since.get(fault as usize).copied().flatten()
    }

    /// The faults that are present, in the order of [`VehicleFault::ALL`].
    pub fn faults(&self) -> impl Iterator<Item = ActiveFault> {
        VehicleFault::ALL
            .into_iter()
            .filter_map(|fault| Some(ActiveFault { fault, since: self.since(fault)? }))
    }

    /// Notes the age of a signal, s; infinite if it never came.
    pub fn set_age_s(&mut self, signal: SafetySignal, age_s: f64) {
        if let Some(entry) = self.age_s.get_mut(signal as usize) {
            *entry = Some(age_s);
        }
    }

    /// Age of a signal, s; infinite if it never came, `None` if the truck does not time it.
    #[must_use]
    pub fn age_s(&self, signal: SafetySignal) -> Option<f64> {
        self.age_s.get(signal as usize).copied().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_keeps_its_first_time_until_it_is_taken_back() {
        let mut status = VehicleStatus::default();
        assert_eq!(status.faults().count(), 0);
        status.raise(VehicleFault::Spoofed, Time(7));
        status.raise(VehicleFault::Spoofed, Time(9));
        status.raise(VehicleFault::NotReady, Time(3));
        let spoofed = ActiveFault { fault: VehicleFault::Spoofed, since: Time(7) };
        assert!(
            status
                .faults()
                .eq([spoofed, ActiveFault { fault: VehicleFault::NotReady, since: Time(3) }])
        );
        status.clear(VehicleFault::NotReady);
        assert!(status.faults().eq([spoofed]));
    }

    #[test]
    fn every_fault_and_every_signal_has_its_own_place() {
        let mut status = VehicleStatus::default();
        for (i, fault) in VehicleFault::ALL.into_iter().enumerate() {
            status.raise(fault, Time(i as i64));
        }
        for (i, signal) in SafetySignal::ALL.into_iter().enumerate() {
            status.set_age_s(signal, i as f64);
        }
        for (i, fault) in VehicleFault::ALL.into_iter().enumerate() {
            assert_eq!(status.since(fault), Some(Time(i as i64)));
        }
        for (i, signal) in SafetySignal::ALL.into_iter().enumerate() {
            assert_eq!(status.age_s(signal), Some(i as f64));
        }
    }
}
