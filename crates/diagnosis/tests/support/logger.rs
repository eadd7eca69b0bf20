//! The logger: J1939 resolution, rates by sample and hold, sensor noise.

use diagnosis::{Channel as C, Drive};
use rand_chacha::ChaCha8Rng;

use super::road::normal;

/// Channel, samples held, resolution, noise.
const CHANNELS: &[(C, usize, f64, f64)] = &[
    (C::SMapM, 1, 0.1, 0.0),
    (C::SpeedMS, 2, 1.0 / 921.6, 0.012),
    (C::GpsSpeedMS, 2, 0.01, 0.05),
    (C::GpsAltitudeM, 4, 0.1, 0.3),
    (C::HeadingRad, 1, 1.0 / 1024.0, 0.003),
    (C::AccelXMS2, 1, 0.005, 0.12),
    (C::AcceleratorPedalFrac, 1, 0.004, 0.0),
    (C::EngineTorquePercent, 1, 0.125, 0.0),
    (C::EngineSpeedRpm, 1, 0.125, 2.0),
    (C::Gear, 1, 1.0, 0.0),
    (C::ShiftInProcess, 1, 1.0, 0.0),
    (C::EngineBrakeFrac, 1, 0.01, 0.0),
    (C::XbrDecelMS2, 1, 1.0 / 2048.0, 0.0),
    (C::BrakePressureKpa, 2, 5.0, 0.0),
    (C::SteeringWheelRad, 1, 1.0 / 1024.0, 0.002),
    (C::YawRateRadS, 1, 1.0 / 8192.0, 0.0015),
    (C::TrailerYawRateRadS, 1, 1.0 / 8192.0, 0.002),
    (C::AccelYMS2, 1, 1.0 / 2048.0, 0.1),
    (C::FuelRateGS, 2, 0.0116, 0.0),
    (C::CoolantTempDegc, 20, 1.0, 0.0),
    (C::AmbientTempDegc, 20, 0.25, 0.0),
    (C::BaroPressurePa, 20, 500.0, 0.0),
    (C::GradeFrac, 1, 0.0, 0.0),
    (C::Curvature1M, 1, 0.0, 0.0),
];

/// Writes true signals into a drive as a bus would show them.
pub(crate) fn log(drive: &mut Drive, truth: &[Vec<f64>], rng: &mut ChaCha8Rng) {
    for ((channel, hold, step, noise), x) in CHANNELS.iter().zip(truth) {
        let mut held = 0.0;
        let samples = x
            .iter()
            .enumerate()
            .map(|(i, v)| {
                if i % hold == 0 {
                    let mut y = v + if *noise > 0.0 { noise * normal(rng) } else { 0.0 };
                    if *channel == C::FuelRateGS {
                        y *= 1.0 + 0.015 * normal(rng);
                    }
                    held = if *step > 0.0 { (y / step).round() * step } else { y };
                }
                held
            })
            .collect();
        drive.set(*channel, samples);
    }
}

/// Number of logged channels.
pub(crate) const LOGGED: usize = 24;
