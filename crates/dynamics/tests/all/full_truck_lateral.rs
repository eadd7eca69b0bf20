//! The full truck turns as the lateral model alone does.

use dynamics::lateral::{LateralInputs, LateralModel, LateralState};
use dynamics::{RoadPatch, SUBSTEP_S, TruckModel, TruckParameters};
use tractrix_core::Command;

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
