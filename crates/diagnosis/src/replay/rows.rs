//! Which rows of a drive count, per module.

use dynamics::effects::driveline::RELEASED_PEDAL_FRAC;
use tractrix_core::RPM_PER_RAD_S;

use super::co2;
use super::prepared::Prepared;
use super::{MODULES, Module as M};
use crate::{Channel as C, Plant};

/// Indicated torque up to which a message of 1 % a bit with its noise may be zero, percent of the
/// reference torque: what burns no more than this is not judged.
const CUT_OFF_PERCENT: f64 = 2.5;
/// Torque above which nobody brakes who has a foot on the accelerator, percent, and samples until brakes that were on are off.
const PULLS: f64 = 3.0;
const RELEASE: i32 = 30;
/// Fuel rate below which an engine that runs may be said not to burn any, g/s: half of idling.
const LEAST_FUEL_G_S: f64 = 0.2;
/// Samples after which a pressure that rests under a demand that rests says nothing new: a truck
/// that is held for an hour repeats the rounding of one message.
const RESTS: usize = 20;

impl Prepared {
    /// Where brakes that no channel shows may act: with the demand if that is there, otherwise
    /// wherever the engine does not pull.
    fn may_be_held(&self) -> Vec<bool> {
        let unseen = !self.has(&[C::BrakePressureKpa]);
        let demanded = unseen && self.has(&[C::XbrDecelMS2]);
        let coasting = unseen && !demanded || !self.has(&[C::EngineBrakeFrac]);
        let released = self.has(&[C::AcceleratorPedalFrac]);
        let mut left = 0;
        (0..self.n)
            .map(|i| {
                let pulls =
                    self.torque[i] >= PULLS && !(released && self.pedal[i] < RELEASED_PEDAL_FRAC);
                let held = demanded && self.xbr[i] > 0.0 || coasting && !pulls;
                left = if held { RELEASE } else { (left - 1).max(0) };
                left > 0
            })
            .collect()
    }

    pub(super) fn mask(&mut self, plant: &Plant) {
        let n = self.n;
        let rows = |m: M, ok: &dyn Fn(usize, usize) -> bool| -> Vec<bool> {
            let step = m.row_step();
            (0..(n / step).saturating_sub(2)).map(|k| ok(k * step, (k + 1) * step)).collect()
        };
        let seconds =
            |m: M, ok: &dyn Fn(usize) -> bool| rows(m, &|a, b| (a..(b + 4).min(n)).all(ok));
        let mut valid: [Vec<bool>; MODULES] = Default::default();
        let pulled = self.has(&[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear]);
        if (pulled || self.coasts) && self.has(&[C::GradeFrac]) {
            let held = self.may_be_held();
            let rolls = |i: usize| self.coasts || self.engaged[i] && !held[i];
            valid[M::Force as usize] = seconds(M::Force, &|i| rolls(i) && self.speed[i] > 3.0);
        }
        if self.has(&[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm]) {
            let idle = plant.truck.engine.idle_speed_rpm + 80.0;
            valid[M::Torque as usize] = rows(M::Torque, &|a, b| {
                (a..b).all(|i| self.engaged[i] && self.rpm[i] > idle && self.speed[i] > 3.0)
            });
        }
        if self.has(&[C::XbrDecelMS2, C::BrakePressureKpa]) {
            let tells: Vec<bool> = (0..n)
                .map(|i| {
                    let since = |samples: usize| i.saturating_sub(samples)..=i;
                    let held = since(RESTS).all(|j| {
                        self.pressure[j] == self.pressure[i] && self.xbr[j] == self.xbr[i]
                    });
                    !held && since(30).any(|j| self.xbr[j] > 0.0 || self.pressure[j] > 0.0)
                })
                .collect();
            valid[M::Brake as usize] = rows(M::Brake, &|a, b| (a..b).all(|i| tells[i]));
        }
        if self.has(&[C::ShiftInProcess]) {
            valid[M::Shift as usize] = vec![true; self.shifts.len()];
        }
        if self.has(&[C::FuelRateGS, C::EngineTorquePercent, C::EngineSpeedRpm]) {
            let reference_nm = plant.truck.engine.reference_torque_nm;
            let least_nm = 0.01 * CUT_OFF_PERCENT * reference_nm;
            let least_g_s: Vec<f64> = self
                .rpm
                .iter()
                .map(|rpm| plant.engine.fuel_rate_g_s(rpm / RPM_PER_RAD_S, least_nm))
                .collect();
            valid[M::Fuel as usize] = rows(M::Fuel, &|a, b| {
                // No fuel at all is the overrun cut-off of the engine control, not its map, and
                // near zero the torque message is cut at zero. Judged by the fuel: rows chosen by
                // a noisy torque are rows whose noise has one sign.
                (a..b)
                    .all(|i| self.engaged[i] && self.speed[i] > 3.0 && self.fuel[i] > least_g_s[i])
            });
        }
        if self.has(&[C::SteeringWheelRad]) {
            let moving: Vec<bool> = {
                let mut since = 0;
                self.speed
                    .iter()
                    .map(|v| {
                        since = if *v > 5.0 { since + 1 } else { 0 };
                        since > 80
                    })
                    .collect()
            };
            for (m, c) in [
                (M::Yaw, C::YawRateRadS),
                (M::TrailerYaw, C::TrailerYawRateRadS),
                (M::AccelY, C::AccelYMS2),
            ] {
                if self.has(&[c]) {
                    valid[m as usize] = rows(m, &|a, b| (a..b).all(|i| moving[i]));
                }
            }
        }
        if self.has(&[C::GpsSpeedMS]) {
            valid[M::Gps as usize] = rows(M::Gps, &|a, b| (a..b).all(|i| self.speed[i] > 2.0));
        }
        if self.has(&[C::GpsAltitudeM, C::GradeFrac]) {
            valid[M::Altitude as usize] = rows(M::Altitude, &|_, _| true);
        }
        if self.has(&[C::HeadingRad, C::YawRateRadS]) {
            valid[M::Heading as usize] = rows(M::Heading, &|_, _| true);
        }
        if self.has(&[C::AccelXMS2, C::GradeFrac]) {
            valid[M::Imu as usize] = seconds(M::Imu, &|i| self.speed[i] > 3.0);
        }
        if self.has(&[C::FuelRateGS, C::Co2RateGS]) {
            // An engine that stands still has no ratio, and what is measured first was burnt before
            // the log.
            let burns = |i: usize| self.fuel[i] > LEAST_FUEL_G_S;
            valid[M::Co2 as usize] = rows(M::Co2, &|a, b| a >= co2::TRANSPORT && (a..b).all(burns));
        }
        for (a, v) in self.available.iter_mut().zip(&valid) {
            *a = v.iter().filter(|x| **x).count() >= 8;
        }
        self.valid = valid;
    }
}
