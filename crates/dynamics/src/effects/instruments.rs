//! What instruments, map and load sheet say against what is true; neutral by default.
//!
//! The plant itself is never wrong about itself: [`crate::TruckModel::measured`] turns true
//! signals into measured ones, [`crate::TruckModel::true_patch`] turns what the map says of the
//! road into what the truck drives on, [`InstrumentParameters::map_position_m`] says where the map
//! has the place at which the truck is. Left out: noise, quantisation and delays of signals, which
//! belong to the bus.

use serde::{Deserialize, Serialize};

use crate::RoadPatch;
use crate::bounds::Bounds;
use crate::effects::fuel::CO2_PER_FUEL;

/// Faults of the instruments, the map and the load sheet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InstrumentParameters {
    /// Wheel-based speed over true speed.
    pub speed_scale_coeff: f64,
    /// Bias of the yaw rate sensor, rad/s.
    pub yaw_rate_bias_rad_s: f64,
    /// True grade minus the map's, rise over run.
    pub grade_bias_frac: f64,
    /// How far the map lies ahead of the truth, m.
    pub map_shift_m: f64,
    /// True bank minus the map's, rad, left side up.
    pub bank_offset_rad: f64,
    /// True mass over the mass of the load sheet.
    pub mass_scale_coeff: f64,
    /// Fuel rate as reported over the true one at the engine's highest rate.
    pub fuel_flow_scale_coeff: f64,
    /// Power of the rate with which that error grows: 0 at all rates alike, 1 in proportion, -1 an
    /// offset of the rate.
    pub fuel_flow_exponent_coeff: f64,
    /// CO2 rate as measured over the true one at the engine's highest rate.
    pub co2_scale_coeff: f64,
    /// Power of the rate with which that error grows.
    pub co2_exponent_coeff: f64,
}

impl Default for InstrumentParameters {
    fn default() -> Self {
        Self {
            speed_scale_coeff: 1.0,
            yaw_rate_bias_rad_s: 0.0,
            grade_bias_frac: 0.0,
            map_shift_m: 0.0,
            bank_offset_rad: 0.0,
            mass_scale_coeff: 1.0,
            fuel_flow_scale_coeff: 1.0,
            fuel_flow_exponent_coeff: 0.0,
            co2_scale_coeff: 1.0,
            co2_exponent_coeff: 0.0,
        }
    }
}

impl InstrumentParameters {
    pub(crate) fn violations(&self) -> Vec<String> {
        let mut b = Bounds::of("instruments");
        b.within("speed_scale_coeff", self.speed_scale_coeff, 0.5, 2.0);
        b.within("yaw_rate_bias_rad_s", self.yaw_rate_bias_rad_s, -0.2, 0.2);
        b.within("grade_bias_frac", self.grade_bias_frac, -0.1, 0.1);
        b.within("map_shift_m", self.map_shift_m, -500.0, 500.0);
        b.within("bank_offset_rad", self.bank_offset_rad, -0.2, 0.2);
        b.within("mass_scale_coeff", self.mass_scale_coeff, 0.3, 3.0);
        b.within("fuel_flow_scale_coeff", self.fuel_flow_scale_coeff, 0.3, 3.0);
        b.within("fuel_flow_exponent_coeff", self.fuel_flow_exponent_coeff, -2.0, 5.0);
        b.within("co2_scale_coeff", self.co2_scale_coeff, 0.3, 3.0);
        b.within("co2_exponent_coeff", self.co2_exponent_coeff, -2.0, 5.0);
        b.violations
    }

    /// The road under the truck where the map says `patch`.
    #[must_use]
    pub fn true_patch(&self, patch: &RoadPatch) -> RoadPatch {
        let grade_rad = if self.grade_bias_frac == 0.0 {
            patch.grade_rad
        } else {
            libm::atan(libm::tan(patch.grade_rad) + self.grade_bias_frac)
        };
        RoadPatch { grade_rad, bank_rad: patch.bank_rad + self.bank_offset_rad, ..*patch }
    }

    /// Where on the map the properties of the true place `s_m` are written, m.
    #[must_use]
    pub fn map_position_m(&self, s_m: f64) -> f64 {
        s_m + self.map_shift_m
    }

    /// True payload, kg, of a truck of `empty_kg` whose load sheet says `payload_kg`.
    #[must_use]
    pub fn true_payload_kg(&self, empty_kg: f64, payload_kg: f64) -> f64 {
        if self.mass_scale_coeff == 1.0 {
            payload_kg
        } else {
            (empty_kg + payload_kg) * self.mass_scale_coeff - empty_kg
        }
    }

    /// Fuel rate that is reported, g/s, of a true one; `most_g_s` is the engine's highest.
    #[must_use]
    pub fn reported_fuel_g_s(&self, true_g_s: f64, most_g_s: f64) -> f64 {
        let error_frac = self.fuel_flow_scale_coeff - 1.0;
        true_g_s * scale_at_rate(error_frac, self.fuel_flow_exponent_coeff, true_g_s / most_g_s)
    }

    /// CO2 rate that is measured, g/s, while fuel burns at a true rate.
    #[must_use]
    pub fn measured_co2_g_s(&self, fuel_g_s: f64, most_g_s: f64) -> f64 {
        let (error_frac, exponent) = (self.co2_scale_coeff - 1.0, self.co2_exponent_coeff);
        CO2_PER_FUEL * fuel_g_s * scale_at_rate(error_frac, exponent, fuel_g_s / most_g_s)
    }
}

/// What an instrument says over what is true at a rate, whose part of the highest rate is
/// `rate_frac`; its error is `error_frac` at the highest rate and grows with a power of the rate
/// (from a thousandth of it on).
#[inline]
#[must_use]
pub fn scale_at_rate(error_frac: f64, exponent: f64, rate_frac: f64) -> f64 {
    if error_frac == 0.0 {
        return 1.0;
    }
    1.0 + error_frac * libm::pow(rate_frac.max(1e-3), exponent)
}
