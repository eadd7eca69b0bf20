//! Pneumatic service brakes under electronic control (EBS), with heat, fade and a reservoir.
//!
//! ```text
//! p_demand = m a_demand / K          (or a table over deceleration and mass)
//! p        dead time, then first-order lag within the fill and vent rates, per axle group
//! F        = K p mu(T),  mu(T) = 1 - k_fade max(0, T - T_0), within the road's grip
//! C dT/dt  = F v - C (T - T_air)/tau
//! ```
//! The pressure of an axle group follows its static load share (load-dependent distribution,
//! ECE R13), so that all axles use the same grip. The anti-lock system holds each group's force
//! at the adhesion limit. Filling takes air from the reservoir; an empty one limits the pressure.

use serde::{Deserialize, Serialize};
use tractrix_core::{CoreError, Curve, Grid};

use crate::bounds::Bounds;

/// Axle groups: steer, drive, trailer.
pub const GROUPS: usize = 3;

/// The brake block of a truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BrakeParameters {
    /// Where the figures come from.
    pub source: String,
    /// Total braking force per mean pressure K, N/Pa.
    pub gain_n_pa: f64,
    /// Factor on the force, 1 = as given (worn or glazed linings).
    #[serde(default = "one")]
    pub gain_scale_coeff: f64,
    /// Deceleration demands of the pressure table, m/s²; empty = pressure from mass and K.
    #[serde(default)]
    pub table_decel_m_s2: Vec<f64>,
    /// Masses of the table, kg: the load-dependent distribution.
    #[serde(default)]
    pub table_mass_kg: Vec<f64>,
    /// Pressures of the table, Pa: one row per mass, one value per deceleration.
    #[serde(default)]
    pub table_pressure_pa: Vec<Vec<f64>>,
    /// Largest pressure, Pa.
    pub max_pressure_pa: f64,
    /// Dead time from demand to pressure, s.
    pub dead_time_s: f64,
    /// Lag of the pressure, s.
    pub lag_s: f64,
    /// Largest rise of pressure, Pa/s.
    pub fill_rate_pa_s: f64,
    /// Largest fall of pressure, Pa/s.
    pub vent_rate_pa_s: f64,
    /// Heat capacity of all discs together, J/K.
    pub heat_capacity_j_k: f64,
    /// Time constant of their cooling, s.
    pub cooling_s: f64,
    /// Temperature above which the linings fade, K.
    #[serde(default = "fade_from_k")]
    pub fade_from_k: f64,
    /// Loss of force per kelvin above it, 1/K.
    #[serde(default)]
    pub fade_1_k: f64,
    /// Air that a full application takes, share of the reservoir.
    #[serde(default = "air_per_fill")]
    pub air_per_fill_frac: f64,
    /// Refill of the reservoir, share per second.
    #[serde(default = "refill_1_s")]
    pub refill_1_s: f64,
}

fn one() -> f64 {
    1.0
}
fn fade_from_k() -> f64 {
    523.15
}
fn air_per_fill() -> f64 {
    0.04
}
fn refill_1_s() -> f64 {
    0.01
}

/// What the brakes remember.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BrakeState {
    /// Pressure per axle group, Pa.
    pub pressure_pa: [f64; GROUPS],
    /// Disc temperature per axle group, K.
    pub temperature_k: [f64; GROUPS],
    /// Air in the reservoir, 0 to 1.
    pub reservoir_frac: f64,
}

/// Friction left in linings that lose `loss_1_k` per kelvin above `from_k`, 0.1 to 1.
#[inline]
#[must_use]
pub fn friction_left_frac(loss_1_k: f64, temperature_k: f64, from_k: f64) -> f64 {
    (1.0 - loss_1_k * (temperature_k - from_k).max(0.0)).max(0.1)
}

impl BrakeParameters {
    pub(crate) fn violations(&self) -> Vec<String> {
        let mut b = Bounds::of("brake");
        b.within("gain_n_pa", self.gain_n_pa, 0.01, 10.0);
        b.within("gain_scale_coeff", self.gain_scale_coeff, 0.05, 3.0);
        b.result("table_pressure_pa", self.pressure_table(0.0).map(|_| ()));
        b.within("max_pressure_pa", self.max_pressure_pa, 1e5, 2e6);
        b.within("dead_time_s", self.dead_time_s, 0.0, crate::state::MAX_DELAY_S);
        b.within("lag_s", self.lag_s, 0.005, 2.0);
        b.within("fill_rate_pa_s", self.fill_rate_pa_s, 1e4, 1e8);
        b.within("vent_rate_pa_s", self.vent_rate_pa_s, 1e4, 1e8);
        b.within("heat_capacity_j_k", self.heat_capacity_j_k, 1e3, 1e7);
        b.within("cooling_s", self.cooling_s, 10.0, 1e5);
        b.within("fade_from_k", self.fade_from_k, 300.0, 1_500.0);
        b.within("fade_1_k", self.fade_1_k, 0.0, 0.02);
        b.within("air_per_fill_frac", self.air_per_fill_frac, 0.0, 1.0);
        b.within("refill_1_s", self.refill_1_s, 0.0, 1.0);
        b.violations
    }

    /// The pressure table at a mass: pressure (Pa) over deceleration (m/s²). `None` without one.
    ///
    /// # Errors
    /// [`CoreError::BadTable`] if the table cannot be used.
    pub fn pressure_table(&self, mass_kg: f64) -> Result<Option<Curve>, CoreError> {
        let (x, y) = (&self.table_mass_kg, &self.table_decel_m_s2);
        if x.is_empty() && y.is_empty() && self.table_pressure_pa.is_empty() {
            return Ok(None);
        }
        let rows = self.table_pressure_pa.iter().flatten().copied().collect();
        let grid = Grid::new("table_pressure_pa", x.clone(), y.clone(), rows)?;
        let at_mass = y.iter().map(|&a| grid.at(mass_kg, a)).collect();
        Curve::new("table_pressure_pa", y.clone(), at_mass).map(Some)
    }

    /// Mean pressure that a deceleration demand asks for, Pa.
    #[must_use]
    pub fn demand_pa(&self, decel_m_s2: f64, mass_kg: f64, table: Option<&Curve>) -> f64 {
        let p = match table {
            Some(curve) if decel_m_s2 > 0.0 => curve.at(decel_m_s2),
            _ => mass_kg * decel_m_s2.max(0.0) / self.gain_n_pa,
        };
        p.min(self.max_pressure_pa)
    }

    /// One step of a chamber's pressure towards the (already delayed) demand, Pa.
    #[must_use]
    pub fn pressure_step_pa(&self, pressure_pa: f64, demand_pa: f64, dt_s: f64) -> f64 {
        let towards = (demand_pa - pressure_pa) * (dt_s / self.lag_s).min(1.0);
        let change = towards.clamp(-self.vent_rate_pa_s * dt_s, self.fill_rate_pa_s * dt_s);
        (pressure_pa + change).max(0.0)
    }

    /// Friction left in hot linings, 0 to 1.
    #[must_use]
    pub fn fade_frac(&self, temperature_k: f64) -> f64 {
        friction_left_frac(self.fade_1_k, temperature_k, self.fade_from_k)
    }

    /// Braking force of a group, N, positive slows: `share` of K at its pressure, faded.
    #[must_use]
    pub fn force_n(&self, share: f64, pressure_pa: f64, temperature_k: f64) -> f64 {
        self.cold_force_n(share, pressure_pa) * self.fade_frac(temperature_k)
    }

    /// The same with linings that do not fade.
    #[inline]
    #[must_use]
    pub fn cold_force_n(&self, share: f64, pressure_pa: f64) -> f64 {
        self.gain_n_pa * self.gain_scale_coeff * share * pressure_pa
    }

    /// Disc temperature after `dt_s` of braking with `power_w` into `share` of the heat capacity, K.
    #[must_use]
    pub fn temperature_step_k(
        &self,
        temperature_k: f64,
        power_w: f64,
        share: f64,
        air_k: f64,
        dt_s: f64,
    ) -> f64 {
        let heating = power_w / (self.heat_capacity_j_k * share);
        temperature_k + dt_s * (heating - (temperature_k - air_k) / self.cooling_s)
    }
}
