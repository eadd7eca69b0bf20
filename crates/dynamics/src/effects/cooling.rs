//! Cooling: where the heat of engine, engine brake and retarder goes, and what the retarder gives up
//! when the coolant is hot.
//!
//! ```text
//! C dT/dt = q_e P_ind + q_b P_engine brake + q_r P_retarder - G (T - T_air)
//! G       = G_body + o(T) (G_radiator + fan G_fan)       o: thermostat, 0 to 1 over a band
//! retarder torque <= limit * d(T)                        d: 1 below `derate_from_k`, 0 at `derate_to_k`
//! ```
//! `P` in W, the fan as the engine block switches it. A steady descent ends where the derated
//! retarder makes just what the radiator takes away at that temperature. The engine brake is not
//! derated: most of its heat leaves with the exhaust.
//!
//! Left out: oil and metal temperatures of their own, wind of travel through the radiator, pump
//! speed.

use serde::{Deserialize, Serialize};

use crate::bounds::Bounds;

/// The cooling block of a truck file. A file without one has a retarder that never tires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoolingParameters {
    /// Where the figures come from.
    pub source: String,
    /// Heat capacity of coolant and of what it flows through, J/K.
    pub heat_capacity_j_k: f64,
    /// Heat into the coolant per indicated power of the engine.
    pub engine_heat_frac: f64,
    /// Heat into the coolant per power of the engine brake.
    pub engine_brake_heat_frac: f64,
    /// Heat into the coolant per power of the retarder.
    pub retarder_heat_frac: f64,
    /// What engine and pipes give to the air, W/K.
    pub body_w_k: f64,
    /// What the radiator gives to the air with the thermostat open, W/K.
    pub radiator_w_k: f64,
    /// What the fan adds to that, W/K.
    pub fan_w_k: f64,
    /// Coolant temperature at which the thermostat begins to open, K.
    pub thermostat_from_k: f64,
    /// Coolant temperature at which it is open, K.
    pub thermostat_to_k: f64,
    /// Coolant temperature from which the retarder is derated, K.
    pub derate_from_k: f64,
    /// Coolant temperature at which nothing of it is left, K.
    pub derate_to_k: f64,
}

/// Power that ends in heat, W.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HeatSources {
    /// Indicated power of the engine.
    pub indicated_w: f64,
    /// Power of the engine brake.
    pub engine_brake_w: f64,
    /// Power of the retarder.
    pub retarder_w: f64,
}

/// Where `x` stands in a band, 0 at its beginning, 1 at its end.
pub(crate) fn in_band(x: f64, from: f64, to: f64) -> f64 {
    ((x - from) / (to - from)).clamp(0.0, 1.0)
}

impl CoolingParameters {
    pub(crate) fn violations(&self) -> Vec<String> {
        let mut b = Bounds::of("cooling");
        b.within("heat_capacity_j_k", self.heat_capacity_j_k, 1e4, 1e8);
        b.within("engine_heat_frac", self.engine_heat_frac, 0.0, 2.0);
        b.within("engine_brake_heat_frac", self.engine_brake_heat_frac, 0.0, 1.0);
        b.within("retarder_heat_frac", self.retarder_heat_frac, 0.0, 1.0);
        b.within("body_w_k", self.body_w_k, 0.0, 1e4);
        b.within("radiator_w_k", self.radiator_w_k, 10.0, 1e5);
        b.within("fan_w_k", self.fan_w_k, 0.0, 1e5);
        b.within("thermostat_from_k", self.thermostat_from_k, 300.0, 420.0);
        b.within("thermostat_to_k", self.thermostat_to_k, self.thermostat_from_k + 0.5, 450.0);
        b.within("derate_from_k", self.derate_from_k, 300.0, 450.0);
        b.within("derate_to_k", self.derate_to_k, self.derate_from_k + 0.5, 500.0);
        b.violations
    }

    /// Conductance from coolant to air, W/K.
    #[must_use]
    pub fn conductance_w_k(&self, coolant_k: f64, fan_on_frac: f64) -> f64 {
        let open = in_band(coolant_k, self.thermostat_from_k, self.thermostat_to_k);
        self.body_w_k + open * (self.radiator_w_k + fan_on_frac * self.fan_w_k)
    }

    /// Heat into the coolant, W.
    #[must_use]
    pub fn heat_w(&self, from: &HeatSources) -> f64 {
        self.engine_heat_frac * from.indicated_w
            + self.engine_brake_heat_frac * from.engine_brake_w
            + self.retarder_heat_frac * from.retarder_w
    }

    /// Coolant temperature after `dt_s`, K.
    #[must_use]
    pub fn step_k(
        &self,
        coolant_k: f64,
        fan_on_frac: f64,
        from: &HeatSources,
        air_k: f64,
        dt_s: f64,
    ) -> f64 {
        let out_w = self.conductance_w_k(coolant_k, fan_on_frac) * (coolant_k - air_k);
        coolant_k + dt_s * (self.heat_w(from) - out_w) / self.heat_capacity_j_k
    }

    /// Share of the retarder's limit that is left at a coolant temperature.
    #[must_use]
    pub fn retarder_left_frac(&self, coolant_k: f64) -> f64 {
        1.0 - in_band(coolant_k, self.derate_from_k, self.derate_to_k)
    }
}
