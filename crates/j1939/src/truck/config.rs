//! What a truck needs set before it can be driven over its bus.

use tractrix_core::SafetySignal;

use crate::Name;
use crate::check::Carrier;

/// Addresses, carriers and limits of a [`super::BusTruck`]. The default is the standard's: preferred
/// addresses of SAE J1939 appendix B, no proprietary frames.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
pub struct BusTruckConfig {
    /// NAME of the driving system.
    pub name: Name,
    /// Address that it claims.
    pub address: u8,
    /// Delay before "cannot claim", steps of 0.6 ms: a random number.
    pub claim_delay_steps: u8,
    /// Address of the engine.
    pub engine: u8,
    /// Address of the transmission.
    pub transmission: u8,
    /// Address of the brakes.
    pub brakes: u8,
    /// Address of the cab controller.
    pub cab: u8,
    /// Address of the radar.
    pub radar: u8,
    /// Addresses that get the retarder demand.
    pub retarders: [Option<u8>; 3],
    /// Address of the steering actuator.
    pub steering: u8,
    /// What TSC1 travels in.
    pub tsc1: Carrier,
    /// What XBR travels in.
    pub xbr: Carrier,
    /// Control purpose in TSC1 (SPN 3350); 6 is P7, automated driving.
    pub control_purpose: u8,
    /// An engine that does not say in ADSS that it is ready for an automated driving system is not
    /// driven. Only engines since 2020 have this message.
    pub needs_adss: bool,
    /// Accelerator pedal from which on the driver has taken over, 0 to 1.
    pub driver_accelerator_frac: f64,
    /// Brake pedal from which on the driver has taken over, 0 to 1.
    pub driver_brake_frac: f64,
    /// A pedal has to be there for so long, s: longer than two messages of the slowest sender, as a
    /// single wrong one is no foot.
    pub driver_pedal_s: f64,
    /// A hand wheel this far from what was asked is held by the driver, rad.
    pub driver_wheel_rad: f64,
    /// It has to be there for so long, s.
    pub driver_wheel_s: f64,
    /// Fastest hand wheel that is asked for, rad/s.
    pub wheel_rate_max_rad_s: f64,
    /// Time constant of the filter that makes acceleration of wheel speeds, s.
    pub acceleration_filter_s: f64,
}

impl Default for BusTruckConfig {
    fn default() -> Self {
        Self {
            // Can take another address, on-highway, function 14 (cruise control), no maker's number
            name: Name(0x9000_0E00_0000_0001),
            address: 0x27,
            claim_delay_steps: 0,
            engine: 0x00,
            transmission: 0x03,
            brakes: 0x0B,
            cab: 0x31,
            radar: 0x2A,
            retarders: [Some(0x0F), Some(0x10), Some(0x29)],
            steering: 0x13,
            tsc1: Carrier::TSC1,
            xbr: Carrier::XBR,
            control_purpose: 6,
            needs_adss: false,
            driver_accelerator_frac: 0.05,
            driver_brake_frac: 0.03,
            driver_wheel_rad: 0.6,
            driver_pedal_s: 0.25,
            driver_wheel_s: 0.3,
            wheel_rate_max_rad_s: 12.0,
            acceleration_filter_s: 0.1,
        }
    }
}

/// A signal that is older has been lost, s: several periods of the slowest sender seen (tractors of
/// 2014 send EEC1 at 50 Hz), below 100 ms where the message is that fast.
#[must_use]
pub const fn lost_after_s(signal: SafetySignal) -> f64 {
    match signal {
        SafetySignal::RoadSpeed
        | SafetySignal::YawRate
        | SafetySignal::SteeringAngle
        | SafetySignal::Engine => 0.085,
        SafetySignal::Pose => 0.15,
        SafetySignal::Pedals => 0.22,
        SafetySignal::Transmission | SafetySignal::Brakes => 0.35,
    }
}
