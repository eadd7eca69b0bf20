//! A truck's logger: what J1939 messages and sensors make of the true state.
//!
//! Resolutions are those of SAE J1939-71 (wheel speed 1/256 km/h, torque 1 %, engine speed
//! 0.125 rpm, pedal 0.4 %, yaw rate 1/8192 rad/s, ...); noise is that of ordinary truck sensors.
//! Left out: messages slower than the table, delays of the bus.

use dynamics::{RoadPatch, TruckModel};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tractrix_core::{BrakeMode, Command, EgoState, RPM_PER_RAD_S, ZERO_DEGC_K};

use crate::Channel;
use crate::data::channel::CHANNELS;

/// Number of columns of a truck's own logger.
pub const ON_BOARD: usize = CHANNELS - 1;

/// Seeded random numbers.
#[derive(Debug, Clone)]
pub struct Draw(ChaCha8Rng);

impl Draw {
    /// The sequence of a seed.
    #[must_use]
    pub fn of_seed(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }

    /// Normal with this standard deviation (sum of twelve uniform numbers).
    pub fn normal(&mut self, sigma: f64) -> f64 {
        sigma * ((0..12).map(|_| self.uniform()).sum::<f64>() - 6.0)
    }
}

/// What a simulated truck is at one sample, and what the map says there.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// The truck.
    pub model: &'a TruckModel,
    /// Its true state.
    pub ego: &'a EgoState,
    /// The command that acts.
    pub command: &'a Command,
    /// Road and air.
    pub patch: &'a RoadPatch,
    /// Coolant, K.
    pub coolant_k: f64,
    /// Grade of the map, rise over run.
    pub map_grade_frac: f64,
    /// Curvature of the map, 1/m.
    pub map_curvature_1_m: f64,
}

impl Sample<'_> {
    /// A row of the drive table in the order of [`Channel::on_board`], through the truck's own
    /// instruments, without noise.
    #[must_use]
    pub fn row(&self) -> [f64; ON_BOARD] {
        let (truth, c, patch) = (self.ego, self.command, self.patch);
        let e = self.model.measured(truth);
        let p = &e.powertrain;
        let [accel_x_m_s2, accel_y_m_s2] = self.model.specific_force_m_s2(truth, patch);
        [
            truth.s_m,
            e.speed_m_s,
            truth.speed_m_s,
            patch.altitude_m,
            e.yaw_rad,
            accel_x_m_s2,
            c.accelerator_pedal_frac,
            100.0 * p.engine_torque_nm / self.model.parameters().engine.reference_torque_nm,
            p.engine_speed_rad_s * RPM_PER_RAD_S,
            f64::from(p.gear),
            f64::from(u8::from(p.shift_in_progress)),
            c.retarder_frac,
            if c.brake_mode == BrakeMode::Off { 0.0 } else { c.xbr_decel_m_s2 },
            p.brake_pressure_pa * 1e-3,
            e.steering_wheel_rad,
            e.yaw_rate_rad_s,
            e.trailer.yaw_rate_rad_s,
            accel_y_m_s2,
            p.fuel_rate_g_s,
            self.coolant_k - ZERO_DEGC_K,
            patch.air_temperature_k - ZERO_DEGC_K,
            patch.air_pressure_pa,
            self.map_grade_frac,
            self.map_curvature_1_m,
        ]
    }
}

/// What the sensor and the message of a channel make of a true value.
pub fn as_logged(channel: Channel, value: f64, draw: &mut Draw) -> f64 {
    let (noise, step) = sensor(channel);
    let noisy = if noise > 0.0 { value + draw.normal(noise) } else { value };
    if step > 0.0 { (noisy / step).round() * step } else { noisy }
}

/// Standard deviation of a channel's noise, and its resolution (0: none), in its unit.
fn sensor(channel: Channel) -> (f64, f64) {
    use Channel as C;
    match channel {
        C::SMapM => (0.3, 0.0),
        C::SpeedMS => (0.01, 1.0 / 256.0 / 3.6),
        C::GpsSpeedMS => (0.03, 0.0),
        C::GpsAltitudeM => (1.0, 0.0),
        C::HeadingRad => (0.005, 0.0),
        C::AccelXMS2 => (0.05, 0.0),
        C::AcceleratorPedalFrac | C::EngineBrakeFrac => (0.0, 0.004),
        C::EngineTorquePercent => (0.5, 1.0),
        C::EngineSpeedRpm => (1.5, 0.125),
        C::XbrDecelMS2 => (0.0, 1.0 / 2048.0),
        C::BrakePressureKpa => (0.0, 4.0),
        C::SteeringWheelRad => (0.0, 1.0 / 1024.0),
        C::YawRateRadS | C::TrailerYawRateRadS => (8e-4, 1.0 / 8192.0),
        C::AccelYMS2 => (0.05, 1.0 / 2048.0),
        C::FuelRateGS => (0.0, 0.0116),
        C::CoolantTempDegc => (0.0, 1.0),
        C::Co2RateGS => (0.2, 0.0),
        C::Gear
        | C::ShiftInProcess
        | C::AmbientTempDegc
        | C::BaroPressurePa
        | C::GradeFrac
        | C::Curvature1M => (0.0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logged_value_lies_on_the_messages_grid_near_the_truth() {
        let mut draw = Draw::of_seed(1);
        for channel in Channel::all() {
            let (noise, step) = sensor(channel);
            let y = as_logged(channel, 12.345, &mut draw);
            assert!((y - 12.345).abs() <= 6.0 * noise + 0.5 * step + 1e-12, "{}", channel.name());
            assert!(step == 0.0 || (y / step - (y / step).round()).abs() < 1e-6);
        }
    }
}
