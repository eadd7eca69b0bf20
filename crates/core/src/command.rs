//! The command to a truck: the paper's Table I with units, and a documented superset.

use crate::CoreError;
use serde::{Deserialize, Serialize};

/// How the external brake request acts (SAE J1939-71 SPN 2919, XBR control mode).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum BrakeMode {
    /// No external brake request (mode 0).
    #[default]
    Off,
    /// Deceleration request added to the driver's (mode 1).
    Addition,
    /// The larger of the driver's and this request (mode 2).
    Maximum,
}

/// What the gearbox is asked to do (TSC1/TC1 on the bus).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum GearRequest {
    /// The transmission control unit chooses.
    #[default]
    Automatic,
    /// Hold or reach this forward gear, 1-based; refused by the gearbox outside the engine's range.
    Gear(u8),
    /// Open the driveline (eco-roll).
    Neutral,
}

/// One command, valid on `[k, k+1)`. The first four are the paper's Table I.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Command {
    /// Accelerator pedal, 0 to 1 (PedalPos).
    pub accelerator_pedal_frac: f64,
    /// Requested deceleration, m/s², positive slows (XBR1_ExternalAccele with the sign turned).
    pub xbr_decel_m_s2: f64,
    /// External brake control mode (XBR1_ctrl_mode).
    pub brake_mode: BrakeMode,
    /// Hand-wheel angle, rad, positive left (SteerWhAngle).
    pub steering_wheel_rad: f64,
    /// Engine brake and retarder demand, 0 to 1 of the available torque.
    pub retarder_frac: f64,
    /// Gear request.
    pub gear: GearRequest,
}

impl Command {
    /// Checks that every number is finite.
    ///
    /// # Errors
    /// [`CoreError::NonFinite`] names the field.
    pub fn check_finite(&self) -> Result<(), CoreError> {
        crate::error::finite(self.numbers())
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.numbers().iter().all(|(_, value)| value.is_finite())
    }

    /// Every number of the command, with its name.
    #[must_use]
    pub fn numbers(&self) -> [(&'static str, f64); 4] {
        [
            ("accelerator_pedal_frac", self.accelerator_pedal_frac),
            ("xbr_decel_m_s2", self.xbr_decel_m_s2),
            ("steering_wheel_rad", self.steering_wheel_rad),
            ("retarder_frac", self.retarder_frac),
        ]
    }
}
