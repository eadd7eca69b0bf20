//! What the engine control unit is doing: the state that the release of the paper's model keeps
//! as a state machine, read off the truck's state.

use serde::Serialize;

use crate::effects::shift::ShiftPhase;
use crate::{TruckModel, TruckState};

/// State of the engine control unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EcuState {
    /// The idle governor holds the engine.
    Idle,
    /// The pedal's torque is delivered.
    Driving,
    /// No fuel is injected.
    FuelCut,
    /// The engine brake works.
    EngineBrake,
    /// Torque is taken away or given back for a shift.
    ShiftReduction,
    /// The engine is brought to the new gear's speed with the driveline open.
    Synchronising,
    /// The speed governor cuts the torque back.
    SpeedLimiting,
}

impl TruckModel {
    /// What the engine control unit is doing in a state.
    #[must_use]
    pub fn ecu_state(&self, s: &TruckState) -> EcuState {
        let engine = &self.engine;
        match s.shift.phase {
            ShiftPhase::RampDown | ShiftPhase::RampUp => EcuState::ShiftReduction,
            ShiftPhase::Open => EcuState::Synchronising,
            ShiftPhase::Engaged if s.engine_brake_nm > 1.0 => EcuState::EngineBrake,
            ShiftPhase::Engaged if s.engine_speed_rad_s > 0.98 * engine.max_rad_s => {
                EcuState::SpeedLimiting
            }
            ShiftPhase::Engaged if s.engine_speed_rad_s < 1.15 * engine.idle_rad_s => {
                EcuState::Idle
            }
            ShiftPhase::Engaged if s.engine_torque_nm < 1.0 => EcuState::FuelCut,
            ShiftPhase::Engaged => EcuState::Driving,
        }
    }
}
