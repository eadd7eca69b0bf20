//! The full truck turns as the lateral model alone does.

use dynamics::lateral::{LateralInputs, LateralModel, LateralState};
use dynamics::{RoadPatch, SUBSTEP_S, TruckModel, TruckParameters};
use tractrix_core::{Command, EgoState};

/// Mean relative difference of two signals.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    let error: f64 = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
    error / b.iter().map(|b| b.abs()).sum::<f64>()
}

/// A sine of the wheel at 70 km/h, driven by the full truck and by the lateral model alone at the
/// same speeds; the only thing that the latter lacks are the drive and braking forces of the axles.
#[test]
fn a_sine_of_the_wheel_is_answered_as_by_the_lateral_model_alone() {
    for payload_kg in [0.0, 36_000.0] {
        let truck =
            TruckModel::new(TruckParameters::load("reference").unwrap(), payload_kg).unwrap();
        let alone = LateralModel::new(&truck.parameters().lateral).unwrap();
        let mut s = truck.initial_state(0.0, 0.0, 0.0, 70.0 / 3.6);
        let mut l = LateralState::at(0.0, 0.0, 0.0);
        let (mut full, mut reference): ([Vec<f64>; 4], [Vec<f64>; 4]) = Default::default();
        for k in 0..4_000 {
            let steering_wheel_rad = 0.4 * (0.6 * f64::from(k) * SUBSTEP_S).sin();
            let command =
                Command { accelerator_pedal_frac: 0.4, steering_wheel_rad, ..Command::default() };
            let before_m_s = s.speed_m_s;
            s = truck.step(&s, &command, &RoadPatch::default(), SUBSTEP_S).unwrap();
            let inputs = LateralInputs {
                speed_m_s: 0.5 * (before_m_s + s.speed_m_s),
                accel_x_m_s2: (s.speed_m_s - before_m_s) / SUBSTEP_S,
                steering_wheel_rad,
                ..LateralInputs::default()
            };
            l = alone.step(&l, &inputs, SUBSTEP_S);
            for (out, state) in [(&mut full, &s.lateral), (&mut reference, &l)] {
                let signals = [
                    state.yaw_rate_rad_s,
                    state.trailer_yaw_rate_rad_s,
                    state.articulation_rad,
                    state.y_m,
                ];
                for (o, v) in out.iter_mut().zip(signals) {
                    o.push(v);
                }
            }
        }
        for (i, (a, b)) in full.iter().zip(&reference).enumerate() {
            let d = difference(a, b);
            assert!(d < 0.01, "payload {payload_kg} kg, signal {i}: {d}");
        }
    }
}

/// Simulated logs and the brake unit's VDC2 left gravity out on a banked road, where an accelerometer
/// that is fixed to the body cannot tell it from a turn.
#[test]
fn an_accelerometer_measures_gravity_on_a_grade_and_on_a_bank() {
    let mut truck = TruckParameters::load("reference").unwrap();
    // The road is steeper and more banked than the map has it.
    truck.instruments.grade_bias_frac = 0.01;
    truck.instruments.bank_offset_rad = -0.01;
    let model = TruckModel::new(truck, 0.0).unwrap();
    let standing = EgoState::default();
    let map = RoadPatch { grade_rad: 0.03, bank_rad: 0.05, ..RoadPatch::default() };
    let [along, across] = model.specific_force_m_s2(&standing, &map);
    let g = tractrix_core::GRAVITY_M_S2;
    assert!((along - g * (0.03_f64.tan() + 0.01).atan().sin()).abs() < 1e-9, "{along}");
    assert!((across - g * 0.04_f64.sin()).abs() < 1e-9, "{across}");
    let turning = EgoState { accel_x_m_s2: -1.0, accel_y_m_s2: 2.0, ..standing };
    let moved = model.specific_force_m_s2(&turning, &map);
    assert!((moved[0] - along + 1.0).abs() < 1e-12 && (moved[1] - across - 2.0).abs() < 1e-12);
}
