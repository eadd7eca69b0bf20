//! What the truck remembers between steps, and where it drives.

use serde::{Deserialize, Serialize};

use crate::effects::brake::BrakeState;
use crate::effects::shift::ShiftState;
use crate::lateral::LateralState;

/// Length of the internal step, s (200 Hz).
pub const SUBSTEP_S: f64 = 0.005;
/// Places of the delay line; 127 substeps are 0.635 s.
const DELAY: usize = 128;
/// Longest dead time that the delay line holds, s.
pub const MAX_DELAY_S: f64 = (DELAY - 1) as f64 * SUBSTEP_S;

/// A signal delayed by whole substeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayLine {
    values: [f64; DELAY],
    next: u8,
}

impl Default for DelayLine {
    fn default() -> Self {
        Self { values: [0.0; DELAY], next: 0 }
    }
}

impl DelayLine {
    /// Puts a value in and takes out the one of `steps` substeps ago.
    pub(crate) fn pass(&mut self, value: f64, steps: u8) -> f64 {
        let at = |i: u8| usize::from(i) % DELAY;
        self.values[at(self.next)] = value;
        let out = self.values[at(self.next.wrapping_sub(steps))];
        self.next = self.next.wrapping_add(1);
        out
    }
}

/// Where the truck drives at the moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RoadPatch {
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
    /// Bank, rad, left side up.
    pub bank_rad: f64,
    /// Wind velocity (blowing towards), map frame, m/s.
    pub wind_m_s: (f64, f64),
    /// Air temperature, K.
    pub air_temperature_k: f64,
    /// Air pressure, Pa.
    pub air_pressure_pa: f64,
    /// Altitude, m.
    pub altitude_m: f64,
    /// Friction coefficient between tyre and road.
    pub adhesion_coeff: f64,
}

impl Default for RoadPatch {
    /// Level, dry, calm, standard atmosphere at sea level.
    fn default() -> Self {
        Self {
            grade_rad: 0.0,
            bank_rad: 0.0,
            wind_m_s: (0.0, 0.0),
            air_temperature_k: 288.15,
            air_pressure_pa: 101_325.0,
            altitude_m: 0.0,
            adhesion_coeff: 0.8,
        }
    }
}

/// The whole state of a truck. A copy is a snapshot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruckState {
    /// Pose, yaw, sideslip, steering.
    pub lateral: LateralState,
    /// Longitudinal speed of the reference point, m/s.
    pub speed_m_s: f64,
    /// Its time derivative over the last substep, m/s².
    pub accel_m_s2: f64,
    /// Distance driven, m.
    pub distance_m: f64,
    /// Time simulated, substeps.
    pub substeps: u64,
    /// Engine speed, rad/s.
    pub engine_speed_rad_s: f64,
    /// Indicated torque, Nm.
    pub engine_torque_nm: f64,
    /// Engine-brake torque at the crank, Nm, positive.
    pub engine_brake_nm: f64,
    /// Retarder torque at the propeller shaft, Nm, positive.
    pub retarder_nm: f64,
    /// Whether the clutch is locked.
    pub clutch_locked: bool,
    /// How far a slipping clutch is closed, 0 to 1.
    pub clutch_frac: f64,
    /// Heat put into the clutch, J.
    pub clutch_heat_j: f64,
    /// Gearbox.
    pub shift: ShiftState,
    /// Brakes.
    pub brake: BrakeState,
    /// Tyre warm-up, 0 cold to 1 warm.
    pub tyre_warmth: f64,
    /// Coolant temperature, K.
    pub coolant_k: f64,
    /// How far the engine's controller holds it to be too hot, K.
    pub overheat_k: f64,
    /// How far the cooling fan is on, 0 to 1.
    pub fan_on_frac: f64,
    /// Fuel used, g.
    pub fuel_g: f64,
    /// Fuel flow, g/s.
    pub fuel_rate_g_s: f64,
    /// Forces of the last substep.
    pub forces: Forces,
    pub(crate) pedal_line: DelayLine,
    pub(crate) brake_line: DelayLine,
}

/// Longitudinal forces of a substep, N; all but `drive_n` positive against forward motion.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Forces {
    /// Driveline at the wheels, retarder excluded; negative under engine braking.
    pub drive_n: f64,
    /// Retarder and hidden retarder at the wheels, within the grip of the drive axles.
    pub retarder_n: f64,
    /// The retarder's own part of it, whose power heats the coolant.
    pub retarder_heat_n: f64,
    /// Service brakes.
    pub brake_n: f64,
    /// Rolling resistance and parasitic force.
    pub rolling_n: f64,
    /// Air drag.
    pub drag_n: f64,
    /// Grade.
    pub grade_n: f64,
    /// Induced drag of side forces.
    pub curve_n: f64,
    /// Fitted tables, positive forward.
    pub table_n: f64,
    /// Mass with rotating parts, kg.
    pub effective_mass_kg: f64,
}
