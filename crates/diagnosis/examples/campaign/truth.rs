//! What a hidden cause's size is called in `diagnosis.json`, and how far a found one is off.

use diagnosis::Diagnosis;
use serde::{Deserialize, Serialize};

use super::support::effects::{Effect, Shape};

/// A named size beside the hidden one, both in the unit in which it was hidden.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Interval {
    pub(crate) id: String,
    pub(crate) key: String,
    pub(crate) hidden: f64,
    pub(crate) found: f64,
    pub(crate) sigma: f64,
}

impl Interval {
    /// Standard deviations between them.
    pub(crate) fn off(&self) -> f64 {
        (self.found - self.hidden) / self.sigma
    }

    /// Whether the 90 % interval covers.
    pub(crate) fn covers(&self) -> bool {
        self.off().abs() <= 1.645
    }
}

/// Keys with the value that means nothing is wrong, the sign of the hidden size, and the hidden
/// size itself. One of several keys may be fitted (gates of a retarder, temperatures of a derating). A loss
/// per 100 K is what is lost 100 K above where fade begins: the generators' laws are curves. A driveline's
/// loss is that of its direct gear.
fn keys((id, family): (&str, u32), size: f64, shape: &Shape) -> Vec<(&'static str, f64, f64, f64)> {
    let one = |key, neutral, sign| vec![(key, neutral, sign, size)];
    match id {
        "rolling_resistance" => one("coefficient_scale", 1.0, 1.0),
        "air_drag" => one("cd_a_scale", 1.0, 1.0),
        "headwind" => one("headwind_m_s", 0.0, 1.0),
        "wind" => {
            let (sin, cos) = shape.at(0, 0.0, core::f64::consts::TAU).sin_cos();
            vec![("wind_to_x_m_s", 0.0, 1.0, size * cos), ("wind_to_y_m_s", 0.0, 1.0, size * sin)]
        }
        "mass" => one("mass_scale", 1.0, 1.0),
        // The map's error; the diagnosis states what the map must be corrected by.
        "grade_bias" => one("grade_frac", 0.0, -1.0),
        "map_shift" => one("shift_m", 0.0, -1.0),
        "tyre_warmup" => one("cold_extra_frac", 0.0, 1.0),
        "driveline_loss" => {
            let direct = if family == 1 { 1.0 } else { 1.0 - shape.at(0, 0.0, 0.2) };
            vec![("extra_loss_frac", 0.0, 1.0, size * direct)]
        }
        "fan_load" => one("fan_power_kw", 0.0, 1.0),
        "dragging_brake" => one("force_n", 0.0, 1.0),
        "engine_friction" => one("friction_scale", 1.0, 1.0),
        "altitude_derate" => one("torque_loss_per_km", 0.0, 1.0),
        "heat_derate" => vec![
            ("torque_loss_per_10_k_air", 0.0, 1.0, size),
            ("torque_loss_per_10_k_coolant", 0.0, 1.0, size),
        ],
        "turbo_lag" | "steering_lag" => one("lag_s", 0.0, 1.0),
        "pedal_delay" | "brake_delay" => one("delay_s", 0.0, 1.0),
        "shift_duration" => one("extra_time_s", 0.0, 1.0),
        "fuel_map_low_load" => one("extra_frac", 0.0, 1.0),
        "brake_gain" => one("gain_scale", 1.0, 1.0),
        "brake_fade" => {
            let lost = if family == 1 { size / (1.0 + size) } else { 1.0 - (-size).exp() };
            vec![("loss_per_100_k", 0.0, 1.0, lost)]
        }
        "hidden_retarder" => ["torque_nm", "torque_per_stage_nm", "torque_downhill_nm"]
            .map(|key| (key, 0.0, 1.0, size))
            .to_vec(),
        "engine_brake_torque" => one("torque_scale", 1.0, 1.0),
        "speed_scale" | "fuel_flow_scale" | "co2_scale" => one("scale", 1.0, 1.0),
        "yaw_rate_bias" => one("bias_rad_s", 0.0, 1.0),
        "steering_ratio" => one("ratio_scale", 1.0, 1.0),
        "steering_offset" => one("offset_rad", 0.0, 1.0),
        "steering_free_play" => one("free_play_rad", 0.0, 1.0),
        "cornering_stiffness_front"
        | "cornering_stiffness_drive"
        | "cornering_stiffness_trailer" => one("stiffness_scale", 1.0, 1.0),
        "payload_position" => one("shift_rearward_m", 0.0, 1.0),
        "road_bank" => one("bank_rad", 0.0, 1.0),
        "crosswind" => one("wind_to_left_m_s", 0.0, 1.0),
        _ => Vec::new(),
    }
}

/// The sizes that were named of what was hidden.
pub(crate) fn intervals(family: u32, hidden: &[Effect], d: &Diagnosis) -> Vec<Interval> {
    let mut out = Vec::new();
    for e in hidden {
        let Effect::Cause { id, size, shape } = e else { continue };
        let Some(cause) = d.causes.iter().find(|c| c.id == *id) else { continue };
        for (key, neutral, sign, hidden) in keys((id, family), *size, shape) {
            if let Some(p) = cause.parameters.get(key) {
                out.push(Interval {
                    id: (*id).to_owned(),
                    key: key.to_owned(),
                    hidden,
                    found: sign * (p.value - neutral),
                    sigma: p.sigma,
                });
            }
        }
    }
    out
}
