//! Tyres that build their side force up over a distance, replayed as the truck model has them.

use dynamics::TruckParameters;
use dynamics::lateral::{LateralInputs, LateralModel, LateralState};

use super::*;
use crate::{Channel as C, Drive};

const RELAXATION: &str = "lateral.tyres.relaxation_length_m";
/// Steps of the truck model in a sample.
const STEPS: usize = 50;

fn with_length(name: &str, length_m: f64) -> TruckParameters {
    TruckParameters::load(name).unwrap().with_parameter(RELAXATION, length_m).unwrap()
}

/// Hand wheel of a driver who looks for his lane, rad.
fn hand_wheel_rad(time_s: f64) -> f64 {
    0.3 * (0.9 * time_s).sin() + 0.1 * (4.1 * time_s).sin()
}

/// What the truck model does at speeds from 6 to 24 m/s.
fn driven(truck: &TruckParameters) -> Drive {
    let model = LateralModel::new(&truck.lateral).unwrap();
    let n = 60 * 20;
    let mut drive = Drive::new("driven", 0.0, n);
    drive.reported_mass_kg = Some(truck.lateral.total_mass_kg());
    let speed_m_s = |i: usize| 15.0 - 9.0 * (i as f64 * 0.003).cos();
    let mut state = LateralState::default();
    let mut signals: [Vec<f64>; 5] = Default::default();
    for i in 0..n {
        let speed = speed_m_s(i);
        let mut inputs = LateralInputs { speed_m_s: speed, ..Default::default() };
        let time_s = i as f64 * Drive::STEP_S;
        let out = model.outputs(&state, &inputs);
        let now = [
            speed,
            hand_wheel_rad(time_s),
            out.yaw_rate_rad_s,
            out.trailer_yaw_rate_rad_s,
            out.tractor_accel_y_m_s2,
        ];
        signals.iter_mut().zip(now).for_each(|(s, x)| s.push(x));
        for k in 0..STEPS {
            let dt_s = Drive::STEP_S / STEPS as f64;
            inputs.steering_wheel_rad = hand_wheel_rad(time_s + (k as f64 + 1.0) * dt_s);
            state = model.step(&state, &inputs, dt_s);
        }
    }
    let channels =
        [C::SpeedMS, C::SteeringWheelRad, C::YawRateRadS, C::TrailerYawRateRadS, C::AccelYMS2];
    channels.into_iter().zip(signals).for_each(|(c, x)| drive.set(c, x));
    drive
}

/// Residuals over what was measured, mean squares' root: yaw rates and lateral acceleration.
fn left(drive: &Drive, truck: &TruckParameters) -> [f64; 3] {
    let plant = Plant::of_truck(truck).unwrap();
    let d = Prepared::new(drive, &plant);
    let mut out = Residuals::default();
    replay_group(&d, &plant, &[0.0; PARAMS], Group::Lateral, &mut out);
    let squares = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
    let of = |(m, c)| (squares(&out[m as usize]) / squares(drive.get(c).unwrap())).sqrt();
    [(M::Yaw, C::YawRateRadS), (M::TrailerYaw, C::TrailerYawRateRadS), (M::AccelY, C::AccelYMS2)]
        .map(of)
}

#[test]
fn tyres_that_relax_are_replayed_as_the_truck_model_has_them() {
    for length_m in [0.01, 0.1, 0.5, 1.2] {
        let drive = driven(&with_length("reference", length_m));
        let own = left(&drive, &with_length("reference", length_m));
        let rigid = left(&drive, &with_length("reference", 0.0));
        assert!(own.iter().all(|x| *x < 0.004), "{length_m} m: {own:?}");
        assert!(length_m < 0.4 || rigid.iter().all(|x| *x > 0.015), "{length_m} m: {rigid:?}");
    }
}

/// No speed and no length makes the replay's steps of 50 ms grow.
#[test]
fn no_length_makes_the_replay_unstable() {
    for name in TruckParameters::names() {
        for length_m in [0.0, 1e-6, 0.02, 0.1, 0.3, 1.0, 2.5, 5.0] {
            let truck = with_length(name, length_m);
            let own = left(&driven(&truck), &truck);
            assert!(own.iter().all(|x| *x < 0.05), "{name}, {length_m} m: {own:?}");
        }
    }
}
