//! What the engine control unit says that it is doing.

use dynamics::{EcuState, RoadPatch, TruckModel, TruckParameters};
use tractrix_core::Command;

#[test]
fn the_ecu_passes_through_its_states_on_a_drive() {
    let model = TruckModel::new(TruckParameters::load("reference").unwrap(), 30_000.0).unwrap();
    let mut seen = Vec::new();
    let mut s = model.initial_state(0.0, 0.0, 0.0, 0.0);
    for i in 0..16_000 {
        let t = f64::from(i) * 0.005;
        let command = Command {
            accelerator_pedal_frac: if t > 2.0 && t < 40.0 { 0.8 } else { 0.0 },
            retarder_frac: if t > 55.0 { 1.0 } else { 0.0 },
            ..Command::default()
        };
        s = model.step(&s, &command, &RoadPatch::default(), 0.005).unwrap();
        let state = model.ecu_state(&s);
        if !seen.contains(&state) {
            seen.push(state);
        }
    }
    for state in [
        EcuState::Idle,
        EcuState::Driving,
        EcuState::ShiftReduction,
        EcuState::Synchronising,
        EcuState::FuelCut,
        EcuState::EngineBrake,
    ] {
        assert!(seen.contains(&state), "{state:?} not in {seen:?}");
    }
}
