//! Diesel engine: full load, friction, torque build-up, governors, derating, fuel.
//!
//! | symbol | meaning |
//! |---|---|
//! | n | engine speed, rpm in the truck file, rad/s inside |
//! | T_full(n) | full-load brake torque, Nm |
//! | T_f = f0 + f1 n | friction torque, Nm |
//! | T_ind | indicated (gas) torque; brake torque is T_ind - T_f |
//!
//! The demand of a pedal is `pedal (T_full + T_f)` (an all-torque pedal), or a map over pedal and
//! speed where the truck file gives one. The cylinder charge follows with two first-order lags:
//! a slow one (turbocharger) while it rises above `lag_threshold_frac` of full load, a fast one
//! otherwise: charge that is there can be left unused at once. Over `lag_width_frac` of full load about
//! that threshold the one passes evenly into the other.
//! J1939 SPN 513 is T_ind over the reference torque.
//!
//! Left out: cylinder cut-off, exhaust after-treatment, cold-start enrichment.

use serde::{Deserialize, Serialize};
use tractrix_core::{Curve, FuelModel, Grid, RPM_PER_RAD_S};

use crate::bounds::Bounds;
use crate::effects::cooling::in_band;
use crate::effects::fuel::{FuelMap, FuelParameters, Range};

/// Width of the governor at the highest speed, over that speed: half of it on either side.
const GOVERNOR_FRAC: f64 = 0.04;

/// The engine block of a truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EngineParameters {
    /// Where the figures come from.
    pub source: String,
    /// Speeds of the full-load curve, rpm.
    pub full_load_speed_rpm: Vec<f64>,
    /// Full-load brake torque at those speeds, Nm.
    pub full_load_torque_nm: Vec<f64>,
    /// Friction torque at standstill, Nm (f0).
    pub friction_constant_nm: f64,
    /// Friction torque per speed, Nm/rpm (f1).
    pub friction_per_rpm_nm: f64,
    /// Factor on the friction torque, 1 = as given.
    #[serde(default = "one")]
    pub friction_scale_coeff: f64,
    /// Reference torque of the torque signals, Nm (SPN 544).
    pub reference_torque_nm: f64,
    /// Idle speed, rpm.
    pub idle_speed_rpm: f64,
    /// Governed speed at which the torque has fallen to zero, rpm.
    pub max_speed_rpm: f64,
    /// Inertia of crank, flywheel and clutch, kg m².
    pub inertia_kg_m2: f64,
    /// Lag of torque that falls or stays below the threshold, s.
    pub fast_lag_s: f64,
    /// Lag of torque that rises above the threshold, s (turbocharger).
    pub slow_lag_s: f64,
    /// Share of full load at which the lag changes.
    pub lag_threshold_frac: f64,
    /// Share of full load over which it does, half of it on either side.
    #[serde(default)]
    pub lag_width_frac: f64,
    /// Dead time from pedal to demand, s.
    pub pedal_delay_s: f64,
    /// Largest rise of the torque demand, Nm/s; none = unlimited.
    #[serde(default)]
    pub torque_rise_nm_s: Option<f64>,
    /// Largest fall of the torque demand, Nm/s; none = unlimited.
    #[serde(default)]
    pub torque_fall_nm_s: Option<f64>,
    /// Demand map: indicated torque over pedal and speed, instead of the all-torque pedal.
    #[serde(default)]
    pub pedal_map: Option<PedalMap>,
    /// Power of the auxiliaries at the crank, W.
    pub auxiliary_power_w: f64,
    /// Power of the cooling fan while it runs, W.
    #[serde(default)]
    pub fan_power_w: f64,
    /// Coolant temperature above which the fan runs, K.
    #[serde(default = "fan_on_k")]
    pub fan_on_k: f64,
    /// How far the coolant must fall below that for the fan to stop, K.
    #[serde(default)]
    pub fan_hysteresis_k: f64,
    /// Span of coolant temperature over which the fan comes and goes, as a viscous clutch lets it, K;
    /// 0: at once.
    #[serde(default)]
    pub fan_band_k: f64,
    /// Altitude above which full load falls, m.
    #[serde(default = "derate_altitude_m")]
    pub derate_altitude_m: f64,
    /// Loss of full load per metre above it, 1/m.
    #[serde(default)]
    pub derate_altitude_1_m: f64,
    /// Air temperature above which full load falls, K.
    #[serde(default = "derate_air_k")]
    pub derate_air_k: f64,
    /// Loss of full load per kelvin above it, 1/K.
    #[serde(default)]
    pub derate_air_1_k: f64,
    /// Coolant temperature above which full load falls, K.
    #[serde(default = "derate_coolant_k")]
    pub derate_coolant_k: f64,
    /// Loss of full load per kelvin above it, 1/K.
    #[serde(default)]
    pub derate_coolant_1_k: f64,
    /// Lag with which the controller follows the coolant, s.
    #[serde(default)]
    pub derate_coolant_lag_s: f64,
    /// Engine-brake torque at full demand, constant part, Nm.
    pub engine_brake_constant_nm: f64,
    /// Engine-brake torque at full demand per speed, Nm/rpm.
    pub engine_brake_per_rpm_nm: f64,
    /// Factor on the engine-brake torque, 1 = as given (valves or charge that hold less).
    #[serde(default = "one")]
    pub engine_brake_scale_coeff: f64,
    /// Lag of the engine brake, s.
    pub engine_brake_lag_s: f64,
    /// Fuel.
    pub fuel: FuelParameters,
    /// Fuel map, instead of the Willans line of `fuel`.
    #[serde(default)]
    pub fuel_map: Option<FuelMap>,
}

/// Demand over pedal and speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PedalMap {
    /// Pedal positions, 0 to 1.
    pub pedal_frac: Vec<f64>,
    /// Speeds, rpm.
    pub speed_rpm: Vec<f64>,
    /// Indicated torque, Nm: one row per speed, one value per pedal position.
    pub torque_nm: Vec<Vec<f64>>,
}

fn one() -> f64 {
    1.0
}
fn fan_on_k() -> f64 {
    370.15
}
fn derate_altitude_m() -> f64 {
    1_500.0
}
fn derate_air_k() -> f64 {
    303.15
}
fn derate_coolant_k() -> f64 {
    371.15
}

impl EngineParameters {
    /// Friction torque as the file gives it, unscaled, over speed (rad/s), Nm.
    fn nominal_friction(&self) -> Result<Curve, tractrix_core::CoreError> {
        let rpm = [0.0, 10_000.0];
        let nm = rpm.map(|n| self.friction_constant_nm + self.friction_per_rpm_nm * n);
        Curve::new("friction", rpm.map(|n| n / RPM_PER_RAD_S).to_vec(), nm.to_vec())
    }

    pub(crate) fn violations(&self) -> Vec<String> {
        let mut b = Bounds::of("engine");
        b.curve("full_load_torque_nm", &self.full_load_speed_rpm, &self.full_load_torque_nm);
        let torque_ok = self.full_load_torque_nm.iter().all(|t| (0.0..=10_000.0).contains(t));
        b.require(torque_ok, "full_load_torque_nm must be within 0 to 10000".into());
        b.within("friction_constant_nm", self.friction_constant_nm, 0.0, 1_000.0);
        b.within("friction_per_rpm_nm", self.friction_per_rpm_nm, 0.0, 1.0);
        b.within("friction_scale_coeff", self.friction_scale_coeff, 0.1, 5.0);
        b.within("reference_torque_nm", self.reference_torque_nm, 100.0, 10_000.0);
        b.within("idle_speed_rpm", self.idle_speed_rpm, 300.0, 1_000.0);
        b.within("max_speed_rpm", self.max_speed_rpm, 1_200.0, 6_000.0);
        b.within("inertia_kg_m2", self.inertia_kg_m2, 0.1, 30.0);
        b.within("fast_lag_s", self.fast_lag_s, 0.005, 5.0);
        b.within("slow_lag_s", self.slow_lag_s, 0.005, 10.0);
        b.within("lag_threshold_frac", self.lag_threshold_frac, 0.0, 1.0);
        b.within("lag_width_frac", self.lag_width_frac, 0.0, 1.0);
        b.within("pedal_delay_s", self.pedal_delay_s, 0.0, crate::state::MAX_DELAY_S);
        b.within("torque_rise_nm_s", self.torque_rise_nm_s.unwrap_or(1.0), 1.0, 1e6);
        b.within("torque_fall_nm_s", self.torque_fall_nm_s.unwrap_or(1.0), 1.0, 1e6);
        b.within("auxiliary_power_w", self.auxiliary_power_w, 0.0, 60_000.0);
        b.within("fan_power_w", self.fan_power_w, 0.0, 80_000.0);
        b.within("fan_on_k", self.fan_on_k, 280.0, 450.0);
        b.within("fan_hysteresis_k", self.fan_hysteresis_k, 0.0, 30.0);
        b.within("fan_band_k", self.fan_band_k, 0.0, 30.0);
        b.within("derate_altitude_m", self.derate_altitude_m, -500.0, 6_000.0);
        b.within("derate_altitude_1_m", self.derate_altitude_1_m, 0.0, 1e-3);
        b.within("derate_air_k", self.derate_air_k, 250.0, 350.0);
        b.within("derate_air_1_k", self.derate_air_1_k, 0.0, 0.1);
        b.within("derate_coolant_k", self.derate_coolant_k, 330.0, 400.0);
        b.within("derate_coolant_1_k", self.derate_coolant_1_k, 0.0, 0.1);
        b.within("derate_coolant_lag_s", self.derate_coolant_lag_s, 0.0, 600.0);
        b.within("engine_brake_constant_nm", self.engine_brake_constant_nm, 0.0, 5_000.0);
        b.within("engine_brake_per_rpm_nm", self.engine_brake_per_rpm_nm, 0.0, 5.0);
        b.within("engine_brake_scale_coeff", self.engine_brake_scale_coeff, 0.0, 3.0);
        b.within("engine_brake_lag_s", self.engine_brake_lag_s, 0.005, 5.0);
        let range = Range {
            idle_rpm: self.idle_speed_rpm,
            max_rpm: self.max_speed_rpm,
            full_load_nm: self.peak_torque_nm(),
        };
        self.fuel.check(self.fuel_map.as_ref(), range, &mut b);
        if let Some(map) = &self.pedal_map {
            b.result("pedal_map", map.grid().map(|_| ()));
        }
        b.violations
    }

    /// Highest full-load torque, Nm.
    #[must_use]
    pub fn peak_torque_nm(&self) -> f64 {
        self.full_load_torque_nm.iter().copied().fold(0.0, f64::max)
    }

    /// Multiplies the fuel flow everywhere, on the map or on the Willans line.
    pub fn scale_fuel(&mut self, factor: f64) {
        if let Some(map) = &mut self.fuel_map {
            let rows = map.fuel_g_s.iter_mut().chain(&mut map.bsfc_g_kwh).flatten().flatten();
            rows.chain(map.zero_torque_g_s.iter_mut().flatten()).for_each(|x| *x *= factor);
        }
        let fuel = &mut self.fuel;
        for part in [&mut fuel.constant_g_s, &mut fuel.per_rpm_g_s, &mut fuel.per_kw_g_s] {
            *part = part.map(|x| x * factor);
        }
    }
}

impl PedalMap {
    fn grid(&self) -> Result<Grid, tractrix_core::CoreError> {
        let n: Vec<f64> = self.speed_rpm.iter().map(|n| n / RPM_PER_RAD_S).collect();
        let rows = self.torque_nm.iter().flatten().copied().collect();
        let by_speed = Grid::new("pedal_map", n, self.pedal_frac.clone(), rows)?;
        let z = by_speed
            .y()
            .iter()
            .flat_map(|&p| by_speed.x().iter().map(move |&n| (n, p)))
            .map(|(n, p)| by_speed.at(n, p))
            .collect();
        Grid::new("pedal_map", by_speed.y().to_vec(), by_speed.x().to_vec(), z)
    }
}

/// What is left of full load where a quantity is above a threshold and takes `loss` per unit.
#[inline]
#[must_use]
pub fn left_frac(loss: f64, x: f64, from: f64) -> f64 {
    (1.0 - loss * (x - from).max(0.0)).max(0.0)
}

/// The engine with its tables in SI, ready to run.
#[derive(Debug, Clone, PartialEq)]
pub struct Engine {
    /// The truck file's block.
    pub parameters: EngineParameters,
    /// Full-load brake torque over speed (rad/s), Nm.
    pub full_load_nm: Curve,
    /// Demand over (pedal, speed rad/s), Nm, if the truck file gives one.
    pub pedal_map_nm: Option<Grid>,
    /// Idle speed, rad/s.
    pub idle_rad_s: f64,
    /// Governed speed, rad/s.
    pub max_rad_s: f64,
    /// Fuel flow: the same model that planner and diagnosis read.
    pub fuel: FuelModel,
    /// Highest fuel flow at full load, g/s.
    pub most_fuel_g_s: f64,
}

impl Engine {
    /// Builds the tables of checked parameters.
    ///
    /// # Errors
    /// [`tractrix_core::CoreError::BadTable`] names a table that cannot be used.
    pub fn new(p: EngineParameters) -> Result<Self, tractrix_core::CoreError> {
        let speed: Vec<f64> = p.full_load_speed_rpm.iter().map(|n| n / RPM_PER_RAD_S).collect();
        let fuel = p.fuel.model(p.fuel_map.as_ref(), p.nominal_friction()?)?;
        let full_load = p.full_load_speed_rpm.iter().zip(&p.full_load_torque_nm);
        let flows_g_s = full_load.map(|(rpm, brake_nm)| {
            let friction_nm = p.friction_constant_nm + p.friction_per_rpm_nm * rpm;
            fuel.rate_g_s(rpm / RPM_PER_RAD_S, brake_nm + friction_nm)
        });
        Ok(Self {
            most_fuel_g_s: flows_g_s.fold(0.0, f64::max),
            fuel,
            full_load_nm: Curve::new("full_load_torque_nm", speed, p.full_load_torque_nm.clone())?,
            pedal_map_nm: p.pedal_map.as_ref().map(PedalMap::grid).transpose()?,
            idle_rad_s: p.idle_speed_rpm / RPM_PER_RAD_S,
            max_rad_s: p.max_speed_rpm / RPM_PER_RAD_S,
            parameters: p,
        })
    }

    /// Friction torque T_f, Nm, positive.
    #[inline]
    #[must_use]
    pub fn friction_nm(&self, speed_rad_s: f64) -> f64 {
        let p = &self.parameters;
        p.friction_scale_coeff
            * (p.friction_constant_nm + p.friction_per_rpm_nm * speed_rad_s * RPM_PER_RAD_S)
    }

    /// Full-load brake torque with altitude and heat derating, Nm; the coolant by how far the controller
    /// holds it to be too hot ([`Self::overheat_step_k`]).
    #[must_use]
    pub fn full_load_at_nm(
        &self,
        speed_rad_s: f64,
        altitude_m: f64,
        air_k: f64,
        overheat_k: f64,
    ) -> f64 {
        let p = &self.parameters;
        let thin = left_frac(p.derate_altitude_1_m, altitude_m, p.derate_altitude_m);
        let hot = left_frac(p.derate_air_1_k, air_k, p.derate_air_k);
        let boiling = left_frac(p.derate_coolant_1_k, overheat_k, 0.0);
        self.full_load_nm.at(speed_rad_s) * (thin * hot * boiling)
    }

    /// How far the controller holds the coolant to be too hot after `dt_s`, K.
    #[must_use]
    pub fn overheat_step_k(&self, overheat_k: f64, coolant_k: f64, dt_s: f64) -> f64 {
        let p = &self.parameters;
        let over_k = (coolant_k - p.derate_coolant_k).max(0.0);
        overheat_k + (over_k - overheat_k) * (dt_s / p.derate_coolant_lag_s.max(dt_s))
    }

    /// Indicated torque that a pedal demands, Nm.
    #[inline]
    #[must_use]
    pub fn pedal_demand_nm(&self, pedal_frac: f64, speed_rad_s: f64, full_load_nm: f64) -> f64 {
        match &self.pedal_map_nm {
            Some(map) => map.at(pedal_frac, speed_rad_s.max(self.idle_rad_s)),
            None => pedal_frac * (full_load_nm + self.friction_nm(speed_rad_s)),
        }
    }

    /// Speed beyond which nothing is injected, rad/s.
    #[inline]
    #[must_use]
    pub fn most_rad_s(&self) -> f64 {
        (1.0 + 0.5 * GOVERNOR_FRAC) * self.max_rad_s
    }

    /// The demand within what the engine can give, under the governor at its highest speed, Nm.
    #[inline]
    #[must_use]
    pub fn governed_nm(&self, demand_nm: f64, speed_rad_s: f64, full_load_nm: f64) -> f64 {
        let band = GOVERNOR_FRAC * self.max_rad_s;
        let governor = ((self.most_rad_s() - speed_rad_s) / band).clamp(0.0, 1.0);
        demand_nm.min(full_load_nm + self.friction_nm(speed_rad_s)) * governor
    }

    /// Lag of the torque on its way from a level to a target, s.
    #[must_use]
    pub fn lag_s(&self, indicated_nm: f64, target_nm: f64, full_load_nm: f64) -> f64 {
        let p = &self.parameters;
        if target_nm <= indicated_nm {
            return p.fast_lag_s;
        }
        let from_nm = (p.lag_threshold_frac - 0.5 * p.lag_width_frac) * full_load_nm;
        let over_nm = indicated_nm - from_nm;
        let width_nm = p.lag_width_frac * full_load_nm;
        if over_nm <= 0.0 {
            p.fast_lag_s
        } else if over_nm >= width_nm {
            p.slow_lag_s
        } else {
            p.fast_lag_s + (p.slow_lag_s - p.fast_lag_s) * over_nm / width_nm
        }
    }

    /// How far the fan is on at a coolant temperature, 0 to 1, given how far it was before: play between
    /// the ramp on which it comes and the one, a hysteresis below, on which it goes.
    #[must_use]
    pub fn fan_on_frac(&self, before_frac: f64, coolant_k: f64) -> f64 {
        let p = &self.parameters;
        let over = |from_k: f64| {
            if p.fan_band_k > 0.0 {
                in_band(coolant_k, from_k, from_k + p.fan_band_k)
            } else if coolant_k > from_k {
                1.0
            } else {
                0.0
            }
        };
        before_frac.clamp(over(p.fan_on_k), over(p.fan_on_k - p.fan_hysteresis_k))
    }

    /// Torque that the auxiliaries take from the crank, Nm.
    #[must_use]
    pub fn auxiliary_nm(&self, speed_rad_s: f64, fan_on_frac: f64) -> f64 {
        let p = &self.parameters;
        self.crank_nm(p.auxiliary_power_w + fan_on_frac * p.fan_power_w, speed_rad_s)
    }

    /// Torque that takes a power from the crank, Nm.
    #[inline]
    #[must_use]
    pub fn crank_nm(&self, power_w: f64, speed_rad_s: f64) -> f64 {
        power_w / speed_rad_s.max(0.5 * self.idle_rad_s)
    }

    /// Engine-brake torque at full demand, Nm, positive.
    #[must_use]
    pub fn engine_brake_nm(&self, speed_rad_s: f64) -> f64 {
        let p = &self.parameters;
        if speed_rad_s < 1.2 * self.idle_rad_s {
            return 0.0;
        }
        p.engine_brake_scale_coeff
            * (p.engine_brake_constant_nm + p.engine_brake_per_rpm_nm * speed_rad_s * RPM_PER_RAD_S)
    }

    /// Fuel flow, g/s, at a speed and an indicated torque.
    #[inline]
    #[must_use]
    pub fn fuel_rate_g_s(&self, speed_rad_s: f64, indicated_nm: f64) -> f64 {
        self.fuel.rate_g_s(speed_rad_s, indicated_nm)
    }
}
