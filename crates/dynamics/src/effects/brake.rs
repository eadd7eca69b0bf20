//! Pneumatic service brakes under electronic control (EBS), with heat, fade and a reservoir.
//!
//! ```text
//! p_demand = m a_demand / K          (or a table over deceleration and mass)
//! p        dead time, then first-order lag within the fill and vent rates, per axle group
//! a_asked  a_demand + a_i,  da_i/dt = k_i (a_demand - a_felt) within 0 to a limit (an option)
//! F        = K p mu(T_l),  mu(T) = 1 - k_fade max(0, T - T_0), within the road's grip
//! C dT/dt  = F v - C (T - T_air)/tau
//! dT_l/dt  = (T - T_l)/tau_l         linings behind the discs
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
    /// Pressures of the drive axles in the table, Pa: one row per mass, one value per deceleration.
    #[serde(default)]
    pub table_pressure_pa: Vec<Vec<f64>>,
    /// Pressures of the steer axle in the same form, Pa; empty = as the drive axles.
    #[serde(default)]
    pub table_steer_pressure_pa: Vec<Vec<f64>>,
    /// Pressures of the trailer's axles in the same form, Pa; empty = as the drive axles.
    #[serde(default)]
    pub table_trailer_pressure_pa: Vec<Vec<f64>>,
    /// Every group's force follows the drive axles' pressure and the other pressures are only
    /// reported, for models that know one force per demand.
    #[serde(default)]
    pub force_from_drive_pressure: bool,
    /// The control unit's own loop on the deceleration; none = the demand alone.
    #[serde(default)]
    pub decel_feedback: Option<DecelFeedback>,
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
    /// Lag of the linings' temperature behind that of the discs, s (a lining's outer 3 to 10 mm at a
    /// diffusivity of 0.5 to 1 mm²/s: some 5 to 80 s); 0: none.
    #[serde(default)]
    pub lining_lag_s: f64,
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
    423.15
}
fn usual_k() -> [f64; GROUPS] {
    [BrakeParameters::START_K; GROUPS]
}
fn air_per_fill() -> f64 {
    0.04
}
fn refill_1_s() -> f64 {
    0.01
}

/// A control unit that asks for more while the truck brakes less than demanded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecelFeedback {
    /// Integral gain, 1/s.
    pub gain_1_s: f64,
    /// Largest deceleration that the loop adds, m/s².
    pub limit_m_s2: f64,
    /// What the unit takes for the deceleration, as a factor on the true one; 1 = right.
    #[serde(default = "one")]
    pub felt_scale_coeff: f64,
}

/// What the brakes remember.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct BrakeState {
    /// Pressure per axle group, Pa.
    pub pressure_pa: [f64; GROUPS],
    /// Disc temperature per axle group, K.
    pub temperature_k: [f64; GROUPS],
    /// Temperature of the linings per axle group, K.
    #[serde(default = "usual_k")]
    pub lining_k: [f64; GROUPS],
    /// Air in the reservoir, 0 to 1.
    pub reservoir_frac: f64,
    /// Deceleration that the control unit's loop adds to the demand, m/s².
    pub feedback_m_s2: f64,
    /// Deceleration that a test bench tells the control unit instead of the truck's, m/s².
    pub bench_decel_m_s2: Option<f64>,
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
        b.result("table_pressure_pa", self.pressure_tables(0.0).map(|_| ()));
        if let Some(f) = &self.decel_feedback {
            b.within("decel_feedback.gain_1_s", f.gain_1_s, 0.0, 50.0);
            b.within("decel_feedback.limit_m_s2", f.limit_m_s2, 0.0, 10.0);
            b.within("decel_feedback.felt_scale_coeff", f.felt_scale_coeff, 0.0, 20.0);
        }
        b.within("max_pressure_pa", self.max_pressure_pa, 1e5, 2e6);
        b.within("dead_time_s", self.dead_time_s, 0.0, crate::state::MAX_DELAY_S);
        b.within("lag_s", self.lag_s, 0.005, 2.0);
        b.within("fill_rate_pa_s", self.fill_rate_pa_s, 1e4, 1e8);
        b.within("vent_rate_pa_s", self.vent_rate_pa_s, 1e4, 1e8);
        b.within("heat_capacity_j_k", self.heat_capacity_j_k, 1e3, 1e7);
        b.within("cooling_s", self.cooling_s, 10.0, 1e5);
        b.within("fade_from_k", self.fade_from_k, 300.0, 1_500.0);
        b.within("fade_1_k", self.fade_1_k, 0.0, 0.02);
        b.within("lining_lag_s", self.lining_lag_s, 0.0, 600.0);
        b.within("air_per_fill_frac", self.air_per_fill_frac, 0.0, 1.0);
        b.within("refill_1_s", self.refill_1_s, 0.0, 1.0);
        b.violations
    }

    /// The drive axles' pressure table at a mass: pressure (Pa) over deceleration (m/s²). `None`
    /// without one.
    ///
    /// # Errors
    /// [`CoreError::BadTable`] if the table cannot be used.
    pub fn pressure_table(&self, mass_kg: f64) -> Result<Option<Curve>, CoreError> {
        Ok(self.pressure_tables(mass_kg)?.map(|[_, drive, _]| drive))
    }

    /// The tables of the steer, drive and trailer axles at a mass: pressure (Pa) over deceleration
    /// (m/s²). `None` without tables.
    ///
    /// # Errors
    /// [`CoreError::BadTable`] if a table cannot be used.
    pub fn pressure_tables(&self, mass_kg: f64) -> Result<Option<[Curve; GROUPS]>, CoreError> {
        let (x, y) = (&self.table_mass_kg, &self.table_decel_m_s2);
        let tables = [
            &self.table_steer_pressure_pa,
            &self.table_pressure_pa,
            &self.table_trailer_pressure_pa,
        ];
        if x.is_empty() && y.is_empty() && tables.iter().all(|t| t.is_empty()) {
            return Ok(None);
        }
        let of = |name, own: &Vec<Vec<f64>>| {
            let table = if own.is_empty() { &self.table_pressure_pa } else { own };
            let rows = table.iter().flatten().copied().collect();
            let grid = Grid::new(name, x.clone(), y.clone(), rows)?;
            let at_mass = y.iter().map(|&a| grid.at(mass_kg, a)).collect();
            Curve::new(name, y.clone(), at_mass)
        };
        Ok(Some([
            of("table_steer_pressure_pa", tables[0])?,
            of("table_pressure_pa", tables[1])?,
            of("table_trailer_pressure_pa", tables[2])?,
        ]))
    }

    /// Deceleration that the control unit asks of the brakes, m/s²: the demand, and what its own
    /// loop adds after `dt_s` at the truck's acceleration.
    #[must_use]
    pub fn asked_decel_m_s2(
        &self,
        state: &mut BrakeState,
        demand_m_s2: f64,
        accel_m_s2: f64,
        dt_s: f64,
    ) -> f64 {
        let Some(f) = &self.decel_feedback else { return demand_m_s2 };
        if demand_m_s2 <= 0.0 {
            state.feedback_m_s2 = 0.0;
            return demand_m_s2;
        }
        let felt = state.bench_decel_m_s2.unwrap_or(f.felt_scale_coeff * (-accel_m_s2).max(0.0));
        let next = state.feedback_m_s2 + dt_s * f.gain_1_s * (demand_m_s2 - felt);
        state.feedback_m_s2 = next.clamp(0.0, f.limit_m_s2);
        demand_m_s2 + state.feedback_m_s2
    }

    /// Pressure that a group's force follows, Pa.
    #[must_use]
    pub fn acting_pressure_pa(&self, state: &BrakeState, group: usize) -> f64 {
        state.pressure_pa[if self.force_from_drive_pressure { 1 } else { group }]
    }

    /// Pressure that a deceleration demand asks for, Pa: from an axle group's table, or from mass
    /// and K.
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

    /// Temperature of discs and linings before the first braking, K.
    pub const START_K: f64 = 293.15;

    /// Braking force of a group, N, positive slows: `share` of K at its pressure, with linings as hot
    /// as `lining_k`.
    #[must_use]
    pub fn force_n(&self, share: f64, pressure_pa: f64, lining_k: f64) -> f64 {
        self.cold_force_n(share, pressure_pa)
            * friction_left_frac(self.fade_1_k, lining_k, self.fade_from_k)
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

    /// Temperature of the linings after `dt_s` on discs of `disc_k`, K; `lag_s` behind them.
    #[inline]
    #[must_use]
    pub fn lining_step_k(lining_k: f64, disc_k: f64, lag_s: f64, dt_s: f64) -> f64 {
        if lag_s <= 0.0 {
            return disc_k;
        }
        disc_k + (lining_k - disc_k) * libm::exp(-dt_s / lag_s)
    }
}
