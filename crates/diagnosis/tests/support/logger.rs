//! The logger: J1939 resolution, rates by sample and hold, sensor noise; and a laboratory that measures
//! CO2 in the exhaust beside it.

use std::collections::VecDeque;

use diagnosis::{Channel as C, Drive};
use rand_chacha::ChaCha8Rng;

use super::random::normal;

/// Channel, samples held, resolution, noise (of the rate for fuel).
const CHANNELS: &[(C, usize, f64, f64)] = &[
    (C::SMapM, 4, 0.1, 0.0),
    (C::SpeedMS, 2, 1.0 / 921.6, 0.0),
    (C::GpsSpeedMS, 2, 0.01, 0.03),
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
    (C::BrakePressureKpa, 2, 5.0, 1.5),
    (C::SteeringWheelRad, 1, 1.0 / 1024.0, 0.0028),
    (C::YawRateRadS, 1, 1.0 / 8192.0, 0.0015),
    (C::TrailerYawRateRadS, 1, 1.0 / 8192.0, 0.002),
    (C::AccelYMS2, 1, 1.0 / 2048.0, 0.1),
    (C::FuelRateGS, 2, 0.05 * 0.835 / 3.6, 0.01),
    (C::CoolantTempDegc, 1, 1.0, 0.0),
    (C::AmbientTempDegc, 1, 0.25, 0.0),
    (C::BaroPressurePa, 1, 500.0, 0.0),
    (C::GradeFrac, 1, 0.0, 0.0),
    (C::Curvature1M, 1, 0.0, 0.0),
];

/// Number of logged channels.
pub(crate) const LOGGED: usize = 24;

/// Writes true signals into a drive as a bus would show them.
pub(crate) fn log(drive: &mut Drive, truth: &[Vec<f64>], rng: &mut ChaCha8Rng) {
    for ((channel, hold, step, noise), x) in CHANNELS.iter().zip(truth) {
        let slow = match channel {
            C::SpeedMS => running_mean(x.len(), 10, 0.0125, rng),
            C::GpsAltitudeM => smooth(x.len(), 5.0, 0.6, rng),
            _ => vec![0.0; x.len()],
        };
        let mut held = 0.0;
        let samples = x.iter().enumerate().map(|(i, v)| {
            if i % hold == 0 {
                let released = *channel == C::BrakePressureKpa && *v < 1.0;
                let quiet = *noise == 0.0 || released;
                let e = if quiet { 0.0 } else { noise * normal(rng) };
                let y = if *channel == C::FuelRateGS { v * (1.0 + e) } else { v + slow[i] + e };
                held = if *step > 0.0 { (y / step).round() * step } else { y };
            }
            held
        });
        let samples = samples.collect();
        drive.set(*channel, samples);
    }
}

/// CO2 in the exhaust, through exhaust, tunnel and analyser. Its random numbers are its own, so that
/// the rest of a drive is what it was without it.
pub(crate) struct Exhaust {
    rng: ChaCha8Rng,
    scale: f64,
    late: VecDeque<f64>,
    keep: f64,
    mixed: f64,
    measured: Vec<f64>,
}

impl Exhaust {
    /// Carbon of diesel as CO2, g/g.
    const PER_FUEL: f64 = 3.169;
    /// Noise of the rate, and the analyser's scatter from day to day.
    const NOISE: [f64; 2] = [0.02, 0.006];

    /// With this dead time and mixing time, s.
    pub(crate) fn new(dead_s: f64, mixing_s: f64, tolerance: f64, rng: &ChaCha8Rng) -> Self {
        let mut rng = rng.clone();
        rng.set_stream(rng.get_stream() + (1 << 32));
        Self {
            scale: 1.0 + tolerance * Self::NOISE[1] * normal(&mut rng),
            late: vec![0.5; (dead_s / Drive::STEP_S) as usize].into(),
            keep: (-Drive::STEP_S / mixing_s).exp(),
            mixed: 0.5,
            measured: Vec::new(),
            rng,
        }
    }

    /// One sample: fuel burnt, g/s, and a factor of the meter.
    pub(crate) fn burn(&mut self, fuel: f64, factor: f64) {
        self.late.push_back(fuel * factor);
        let now = self.late.pop_front().unwrap_or(fuel);
        self.mixed = now + (self.mixed - now) * self.keep;
        let noise = 1.0 + Self::NOISE[0] * normal(&mut self.rng);
        self.measured.push(Self::PER_FUEL * self.mixed * self.scale * noise);
    }

    pub(crate) fn log(self, drive: &mut Drive) {
        drive.set(C::Co2RateGS, self.measured);
    }
}

/// Noise of a counter that averages over `window` samples.
fn running_mean(n: usize, window: usize, sigma: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let scale = sigma / (window as f64).sqrt();
    let white: Vec<f64> = (0..n + window).map(|_| scale * normal(rng)).collect();
    let mut sum: f64 = white[..window].iter().sum();
    (0..n)
        .map(|i| {
            sum += white[i + window] - white[i];
            sum
        })
        .collect()
}

/// Noise of two poles of `tau_s`, s.
pub(crate) fn smooth(n: usize, tau_s: f64, sigma: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let a = Drive::STEP_S / tau_s;
    let (mut x, mut y) = (sigma * normal(rng), 0.0);
    (0..n)
        .map(|_| {
            x += -a * x + (2.0 * a).sqrt() * 2.0_f64.sqrt() * sigma * normal(rng);
            y += a * (x - y);
            y
        })
        .collect()
}
