//! Addresses and carriers of the virtual truck's control units.

use j1939::Name;
use j1939::check::Carrier;

/// A control unit of the virtual truck.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Unit {
    /// Engine, address 00.
    Engine,
    /// Transmission, address 03.
    Transmission,
    /// Brakes, address 0B.
    Brakes,
    /// Steering, address 13.
    Steering,
    /// Retarder, address 29.
    Retarder,
    /// Radar, address 2A.
    Radar,
    /// Cab controller, address 31.
    Cab,
}

impl Unit {
    /// All of them, in the order of their addresses.
    pub const ALL: [Self; 7] = [
        Self::Engine,
        Self::Transmission,
        Self::Brakes,
        Self::Steering,
        Self::Retarder,
        Self::Radar,
        Self::Cab,
    ];

    /// Its preferred address (SAE J1939 appendix B, table B2).
    #[must_use]
    pub const fn address(self) -> u8 {
        match self {
            Self::Engine => 0x00,
            Self::Transmission => 0x03,
            Self::Brakes => 0x0B,
            Self::Steering => 0x13,
            Self::Retarder => 0x29,
            Self::Radar => 0x2A,
            Self::Cab => 0x31,
        }
    }

    /// Its NAME: on-highway equipment that cannot choose another address, the function after
    /// SAE J1939 appendix B, table B11 (the radar's is that of cruise control), no manufacturer.
    #[must_use]
    pub const fn name(self) -> Name {
        /// On-highway equipment (SAE J1939 appendix B, table B1).
        const ON_HIGHWAY: u64 = 1 << 60;
        let function: u64 = match self {
            Self::Engine => 0,
            Self::Transmission => 3,
            Self::Brakes => 9,
            Self::Steering => 16,
            Self::Retarder => 12,
            Self::Radar => 14,
            Self::Cab => 29,
        };
        Name(ON_HIGHWAY | (function << 40) | (1 + self as u64))
    }
}

/// What the virtual truck has set. The default understands the standard's messages and the example
/// steering frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EcuConfig {
    /// What TSC1 must travel in.
    pub tsc1: Carrier,
    /// What XBR must travel in.
    pub xbr: Carrier,
    /// Key in the checksum of the example steering frame.
    pub steering_key: u8,
}

impl Default for EcuConfig {
    fn default() -> Self {
        Self { tsc1: Carrier::TSC1, xbr: Carrier::XBR, steering_key: STEERING_KEY }
    }
}

/// Key of the example steering frame on the virtual truck.
const STEERING_KEY: u8 = 0x5A;
