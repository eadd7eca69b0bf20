//! The extended truck: what was found, as an overlay on the truck file that the simulator, the
//! planner and the server load.
//!
//! The diagnosis fits sizes in the terms of its replay (a factor on the coefficient, kilowatts of
//! a fan, seconds of a delay); the truck file has figures. This table says which figure carries
//! which size. Prior bounds are those of [`dynamics::catalogue::CATALOGUE`]; a value beyond what the
//! catalogue considers is limited to it and says so in its source.
//!
//! Left out: derating by coolant temperature, which no figure of the truck file carries; such
//! parameters come back in [`Extension::not_carried`].

use std::collections::BTreeMap;

use dynamics::{Overlay, OverlayValue, TruckParameters};
use tractrix_core::RPM_PER_RAD_S;

use crate::causes::param::P;
use crate::replay::{CRUISE_RPM, LOW_LOAD_FRAC, RETARDER_LAG_S, RETARDER_POWER_W};
use crate::{Cause, NotObservable};

/// An overlay and what could not go into it.
#[derive(Debug, Clone, PartialEq)]
pub struct Extension {
    /// The overlay; none if no figure of the truck file carries what was found.
    pub overlay: Option<Overlay>,
    /// Causes that the truck file cannot carry, and why.
    pub not_carried: Vec<NotObservable>,
}

/// How a fitted parameter becomes a figure of the truck file.
enum Carry {
    /// `figure * value`.
    Times(&'static str),
    /// `figure + factor * value`.
    Plus(&'static str, f64),
    /// `figure * exp(value)`.
    Exp(&'static str),
    /// Share of the driveline's power that is lost on top.
    Loss,
    /// Seconds on top of the three phases of a shift.
    Shift,
    /// Load below which consumption rises, as a power.
    LowLoad,
    /// Torque per stage of a retarder.
    Retarder,
    /// Force per brake demand.
    BrakeDemand,
    /// The simulator does it without being told, or another parameter stands for it.
    Implied,
}

fn carry(id: &str, key: &str) -> Option<Carry> {
    use Carry::{Exp, Plus, Times};
    Some(match (id, key) {
        ("rolling_resistance", "coefficient_scale") => Times("resistance.rolling_coeff"),
        ("air_drag", "cd_a_scale") => Times("resistance.drag_area_m2"),
        ("headwind", "headwind_m_s") => Plus("resistance.headwind_m_s", 1.0),
        ("wind", "wind_to_x_m_s") => Plus("resistance.wind_to_x_m_s", 1.0),
        ("wind", "wind_to_y_m_s") => Plus("resistance.wind_to_y_m_s", 1.0),
        ("wind" | "crosswind", "tractor_share_offset_frac") => {
            Plus("resistance.side_force_tractor_frac", 1.0)
        }
        ("wind" | "crosswind", "trailer_behind_cg_m") => {
            Plus("resistance.side_force_trailer_behind_cg_m", 1.0)
        }
        ("mass", "mass_scale") => Times("instruments.mass_scale_coeff"),
        ("grade_bias", "grade_frac") => Plus("instruments.grade_bias_frac", 1.0),
        ("map_shift", "shift_m") => Plus("instruments.map_shift_m", 1.0),
        ("tyre_warmup", "cold_extra_frac") => Plus("resistance.cold_tyre_extra_frac", 1.0),
        ("tyre_warmup", "ln_time_constant") => Exp("resistance.tyre_warmup_s"),
        ("driveline_loss", "extra_loss_frac") => Carry::Loss,
        ("driveline_loss", "mesh_loss_frac") => Plus("driveline.mesh_loss_frac", 1.0),
        ("fan_load", "fan_power_kw") => Plus("engine.fan_power_w", 1e3),
        ("fan_load", "coolant_start_offset_k") => Plus("engine.fan_on_k", 1.0),
        ("fan_load", "band_k") => Plus("engine.fan_band_k", 1.0),
        ("fan_load", "hysteresis_k") => Plus("engine.fan_hysteresis_k", 1.0),
        ("mass" | "payload_position", "stiffness_follows_load") => Carry::Implied,
        ("dragging_brake", "force_n") => Plus("resistance.parasitic_force_n", 1.0),
        ("engine_friction", "friction_scale") => Times("engine.friction_scale_coeff"),
        ("altitude_derate", "torque_loss_per_km") => Plus("engine.derate_altitude_1_m", 1e-3),
        ("altitude_derate", "start_offset_m") => Plus("engine.derate_altitude_m", 1.0),
        ("heat_derate", "torque_loss_per_10_k_air") => Plus("engine.derate_air_1_k", 0.1),
        ("heat_derate", "air_start_offset_k") => Plus("engine.derate_air_k", 1.0),
        ("heat_derate", "torque_loss_per_10_k_coolant") => Plus("engine.derate_coolant_1_k", 0.1),
        ("heat_derate", "coolant_start_offset_k") => Plus("engine.derate_coolant_k", 1.0),
        ("heat_derate", "derating_lag_s") => Plus("engine.derate_coolant_lag_s", 1.0),
        ("turbo_lag", "lag_s") => Plus("engine.slow_lag_s", 1.0),
        ("turbo_lag", "threshold_offset_frac") => Plus("engine.lag_threshold_frac", 1.0),
        ("turbo_lag", "threshold_width_frac") => Plus("engine.lag_width_frac", 1.0),
        ("pedal_delay", "delay_s") => Plus("engine.pedal_delay_s", 1.0),
        // The truck file's delay carries the sum of dead time and lag.
        ("pedal_delay", "lag_frac") => Carry::Implied,
        ("shift_duration", "extra_time_s") => Carry::Shift,
        ("fuel_map_low_load", "extra_frac") => Plus("engine.fuel.low_load_extra_frac", 1.0),
        ("fuel_map_low_load", "ln_load") => Carry::LowLoad,
        // The truck file's extra consumption follows power.
        ("fuel_map_low_load", "over") => Carry::Implied,
        ("engine_brake_torque", "torque_scale") => Times("engine.engine_brake_scale_coeff"),
        ("brake_gain", "gain_scale") => Times("brake.gain_scale_coeff"),
        ("brake_fade", "loss_per_100_k") => Plus("brake.fade_1_k", 0.01),
        ("brake_fade", "start_offset_k") => Plus("brake.fade_from_k", 1.0),
        ("brake_fade", "lining_lag_s") => Plus("brake.lining_lag_s", 1.0),
        ("brake_delay", "delay_s") => Plus("brake.dead_time_s", 1.0),
        ("hidden_retarder", "torque_per_stage_nm") => Carry::Retarder,
        ("hidden_retarder", "force_n_per_m_s2") => Carry::BrakeDemand,
        ("hidden_retarder", "torque_downhill_nm") => {
            Plus("driveline.hidden_retarder_downhill_nm", 1.0)
        }
        ("hidden_retarder", "descent_from_frac") => {
            Plus("driveline.hidden_retarder_from_descent_frac", 1.0)
        }
        // A gain of the brakes, which stands for it, has no limit.
        ("hidden_retarder", "saturation_s2_m") => Carry::Implied,
        ("hidden_retarder", "torque_nm") => Plus("driveline.hidden_retarder_torque_nm", 1.0),
        ("hidden_retarder", "start_offset_m_s") => Plus("driveline.hidden_retarder_from_m_s", 1.0),
        ("speed_scale", "scale") => Times("instruments.speed_scale_coeff"),
        ("fuel_flow_scale", "scale") => Times("instruments.fuel_flow_scale_coeff"),
        ("fuel_flow_scale", "rate_exponent") => Plus("instruments.fuel_flow_exponent_coeff", 1.0),
        ("co2_scale", "scale") => Times("instruments.co2_scale_coeff"),
        ("co2_scale", "rate_exponent") => Plus("instruments.co2_exponent_coeff", 1.0),
        ("yaw_rate_bias", "bias_rad_s") => Plus("instruments.yaw_rate_bias_rad_s", 1.0),
        ("steering_ratio", "ratio_scale") => Times("lateral.steering.ratio"),
        ("steering_offset", "offset_rad") => Plus("lateral.steering.offset_rad", 1.0),
        ("steering_free_play", "free_play_rad") => Plus("lateral.steering.free_play_rad", 1.0),
        ("steering_free_play", "centring_1_s") => {
            Plus("lateral.steering.free_play_centring_1_s", 1.0)
        }
        ("steering_lag", "lag_s") => Plus("lateral.steering.lag_s", 1.0),
        // The truck file's lag carries the sum of lag and dead time.
        ("steering_lag", "pure_delay_frac") => Carry::Implied,
        ("cornering_stiffness_front", "stiffness_scale") => {
            Times("lateral.tyres.stiffness_scale[0]")
        }
        ("cornering_stiffness_drive", "stiffness_scale") => {
            Times("lateral.tyres.stiffness_scale[1]")
        }
        ("cornering_stiffness_trailer", "stiffness_scale") => {
            Times("lateral.tyres.stiffness_scale[2]")
        }
        ("payload_position", "gyration_squared_scale") => {
            Times("lateral.payload.yaw_gyration_squared_m2")
        }
        ("payload_position", "shift_rearward_m") => Plus("lateral.payload.cg_behind_hitch_m", 1.0),
        ("road_bank", "bank_rad") => Plus("instruments.bank_offset_rad", 1.0),
        ("crosswind", "wind_to_left_m_s") => Plus("resistance.crosswind_to_left_m_s", 1.0),
        _ => return None,
    })
}

/// A figure of the truck file with its standard deviation.
struct Figure {
    path: &'static str,
    value: f64,
    sigma: f64,
}

impl Carry {
    /// Figures that carry a fitted value, given the truck's present figures.
    fn figures(&self, truck: &TruckParameters, value: f64, sigma: f64) -> Vec<Figure> {
        let now = |path| truck.parameter(path).unwrap_or(f64::NAN);
        let one = |path, value, sigma: f64| vec![Figure { path, value, sigma: sigma.abs() }];
        match *self {
            Self::Times(path) => one(path, now(path) * value, now(path) * sigma),
            Self::Plus(path, k) => one(path, now(path) + k * value, k * sigma),
            Self::Exp(path) => {
                let figure = now(path) * value.exp();
                one(path, figure, figure * sigma)
            }
            Self::Loss => {
                let d = &truck.driveline;
                let nominal = 1.0 - d.gearbox_efficiency_frac * d.axle_efficiency_frac;
                if nominal < 1e-6 {
                    // A driveline that loses nothing has nothing to scale.
                    let path = "driveline.axle_efficiency_frac";
                    return one(path, now(path) * (1.0 - value), now(path) * sigma);
                }
                let per_loss = d.direct_efficiency_frac() / nominal;
                let path = "driveline.loss_scale_coeff";
                one(path, now(path) + per_loss * value, per_loss * sigma)
            }
            Self::Shift => {
                let s = &truck.shift;
                let length_s = (s.ramp_down_s + s.open_s + s.ramp_up_s).max(1e-6);
                let path = "shift.duration_scale_coeff";
                one(path, now(path) + value / length_s, sigma / length_s)
            }
            Self::LowLoad => {
                let power_kw = LOW_LOAD_FRAC * value.exp() * full_load_nm(truck, CRUISE_RPM)
                    / RPM_PER_RAD_S
                    * CRUISE_RPM
                    * 1e-3;
                one("engine.fuel.low_load_kw", power_kw, power_kw * sigma)
            }
            Self::Retarder => {
                let (torque, power) =
                    ("driveline.retarder_torque_nm", "driveline.retarder_power_w");
                let mut out = one(torque, now(torque) + value, sigma);
                out.extend(one(power, now(power).max(RETARDER_POWER_W), 0.0));
                if now(torque) == 0.0 {
                    out.extend(one("driveline.retarder_lag_s", RETARDER_LAG_S, 0.0));
                }
                out
            }
            Self::BrakeDemand => {
                let per_mass = 1.0 / truck.lateral.total_mass_kg();
                let path = "brake.gain_scale_coeff";
                one(path, now(path) * (1.0 + value * per_mass), now(path) * sigma * per_mass)
            }
            Self::Implied => Vec::new(),
        }
    }
}

/// The figure of a truck file that carries a parameter of a cause, with a size.
pub(crate) fn figure(
    truck: &TruckParameters,
    id: &str,
    p: P,
    size: f64,
) -> Option<(&'static str, f64)> {
    let key = p.spec().key;
    let value = if key.ends_with("scale") { 1.0 + size } else { size };
    let figures = carry(id, key)?.figures(truck, value, 0.0);
    figures.first().map(|f| (f.path, f.value))
}

fn full_load_nm(truck: &TruckParameters, rpm: f64) -> f64 {
    let e = &truck.engine;
    tractrix_core::Curve::new(
        "full_load_torque_nm",
        e.full_load_speed_rpm.clone(),
        e.full_load_torque_nm.clone(),
    )
    .map_or(0.0, |c| c.at(rpm))
}

/// The truck with the causes that were found, as an overlay named `name` on `base` (a built-in
/// name, or a file beside the overlay). `origin` says where the figures come from.
///
/// A cause that makes the truck file unusable (a figure outside what the simulator takes) is left
/// out and comes back as not carried.
#[must_use]
pub fn extend(
    truck: &TruckParameters,
    base: &str,
    name: &str,
    causes: &[Cause],
    origin: &str,
) -> Extension {
    let mut extended = truck.clone();
    let mut set = BTreeMap::new();
    let mut not_carried = Vec::new();
    for cause in causes {
        match carried(&extended, cause, origin) {
            Ok((values, next)) => {
                set.extend(values);
                extended = next;
            }
            Err(why) => {
                not_carried.push(NotObservable { id: cause.id, why, missing_channels: Vec::new() })
            }
        }
    }
    let overlay = (!set.is_empty()).then(|| Overlay {
        schema: 1,
        base: base.to_owned(),
        name: name.to_owned(),
        set,
        table_effects: Vec::new(),
    });
    Extension { overlay, not_carried }
}

type Values = BTreeMap<String, OverlayValue>;

/// The figures of one cause, and the truck with them.
fn carried(
    truck: &TruckParameters,
    cause: &Cause,
    origin: &str,
) -> Result<(Values, TruckParameters), String> {
    let mut set = Values::new();
    for (key, p) in &cause.parameters {
        let carry =
            carry(cause.id, key).ok_or_else(|| format!("no figure carries its parameter {key}"))?;
        for figure in carry.figures(truck, p.value, p.sigma) {
            let bounds = bounds(truck, cause.id, figure.path);
            let mut source = format!("{origin}: {} = {:.6} {}", cause.id, p.value, p.unit);
            let mut value = figure.value;
            if let Some([low, high]) = bounds
                && !(low..=high).contains(&value)
            {
                source += &format!(", limited from {value:.6} to what the catalogue considers");
                value = value.clamp(low, high);
            }
            let sigma = (figure.sigma > 0.0).then_some(figure.sigma);
            set.insert(figure.path.to_owned(), OverlayValue { value, sigma, bounds, source });
        }
    }
    let overlay = Overlay {
        schema: 1,
        base: String::new(),
        name: truck.name.clone(),
        set,
        table_effects: Vec::new(),
    };
    let next = truck.with_overlay(&overlay).map_err(|e| e.to_string())?;
    Ok((overlay.set, next))
}

/// Bounds that the catalogue gives a figure of a cause.
fn bounds(truck: &TruckParameters, id: &str, path: &str) -> Option<[f64; 2]> {
    let p = dynamics::catalogue::cause(id)?.parameters().find(|p| p.path == path)?;
    let nominal = truck.parameter(path)?;
    Some(p.bounds.map(|b| p.value(nominal, b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameter;
    use crate::causes::hypothesis::CATALOGUE;

    fn cause(id: &'static str, parameters: &[(&'static str, f64, f64)]) -> Cause {
        Cause {
            id,
            kind: crate::CauseKind::Value,
            sentence: String::new(),
            parameters: parameters
                .iter()
                .map(|(k, value, sigma)| {
                    (*k, Parameter { value: *value, sigma: *sigma, unit: "1" })
                })
                .collect(),
            evidence: 40.0,
            probability: 1.0,
            confused_with: Vec::new(),
        }
    }

    fn one(c: Cause) -> Values {
        let truck = TruckParameters::load("reference").unwrap();
        extend(&truck, "reference", "x", &[c], "test").overlay.unwrap().set
    }

    #[test]
    fn every_parameter_of_every_hypothesis_has_a_place() {
        let truck = TruckParameters::load("reference").unwrap();
        for h in CATALOGUE {
            for p in h.params() {
                let carry = carry(h.id, p.spec().key)
                    .unwrap_or_else(|| panic!("{}: {} is not carried", h.id, p.spec().key));
                for f in carry.figures(&truck, 0.1, 0.01) {
                    assert!(truck.parameter(f.path).is_some(), "{}", f.path);
                    assert!(f.value.is_finite() && f.sigma.is_finite(), "{}", f.path);
                }
            }
        }
    }

    /// The catalogue of the truck model counts in figures of the truck file, the replay in its own
    /// terms: the prior spreads of both are the same thing.
    #[test]
    fn prior_spreads_are_those_of_the_truck_models_catalogue() {
        let truck = TruckParameters::load("reference").unwrap();
        let mut compared = 0;
        for h in CATALOGUE {
            for p in h.params() {
                let spec = p.spec();
                let value = if spec.key.ends_with("scale") { 1.0 } else { 0.0 };
                let carry = carry(h.id, spec.key).unwrap();
                for figure in carry.figures(&truck, value, spec.prior) {
                    let own = h.of_truck().unwrap().parameters().find(|p| p.path == figure.path);
                    let Some(own) = own else { continue };
                    // The knee of low-load consumption counts from a load, not from the file.
                    let expected = own.slope(figure.value).abs() * own.prior_sigma;
                    let off = (figure.sigma / expected - 1.0).abs();
                    assert!(off < 0.05, "{}: {} {expected}", figure.path, figure.sigma);
                    compared += 1;
                }
            }
        }
        assert!(compared >= 40, "{compared}");
    }

    #[test]
    fn sizes_become_figures_with_their_deviation_and_bounds() {
        let set = one(cause("rolling_resistance", &[("coefficient_scale", 1.17, 0.02)]));
        let v = &set["resistance.rolling_coeff"];
        assert!((v.value - 1.17 * 0.0062).abs() < 1e-12);
        assert!((v.sigma.unwrap() - 0.02 * 0.0062).abs() < 1e-12);
        assert!(v.bounds.unwrap()[0] < v.value && v.value < v.bounds.unwrap()[1]);
        let set = one(cause("driveline_loss", &[("extra_loss_frac", 0.03, 0.001)]));
        let truck = TruckParameters::load("reference").unwrap();
        let with = truck
            .with_parameter("driveline.loss_scale_coeff", set["driveline.loss_scale_coeff"].value)
            .unwrap();
        let expected = truck.driveline.direct_efficiency_frac() * 0.97;
        assert!((with.driveline.direct_efficiency_frac() - expected).abs() < 1e-12);
        let set = one(cause("shift_duration", &[("extra_time_s", 0.4, 0.02)]));
        assert!((set["shift.duration_scale_coeff"].value - 1.4).abs() < 1e-12);
    }

    #[test]
    fn a_size_beyond_what_the_simulator_takes_is_limited_and_says_so() {
        let set = one(cause("brake_delay", &[("delay_s", 1.4, 0.02)]));
        let v = &set["brake.dead_time_s"];
        assert!(v.value < 0.64 && v.source.contains("limited from 1.65"), "{v:?}");
    }

    #[test]
    fn a_cause_without_a_figure_is_not_lost_silently() {
        let truck = TruckParameters::load("reference").unwrap();
        let found = [
            cause("heat_derate", &[("torque_loss_by_the_moon", 0.1, 0.01)]),
            cause("mass", &[("mass_scale", 0.92, 0.004)]),
        ];
        let e = extend(&truck, "reference", "x", &found, "test");
        assert_eq!(e.not_carried.len(), 1);
        assert_eq!(e.not_carried[0].id, "heat_derate");
        assert!(e.not_carried[0].why.contains("torque_loss_by_the_moon"));
        assert_eq!(e.overlay.unwrap().set.len(), 1);
    }

    /// Both were found and stayed out of the extended truck: its file had no place for them.
    #[test]
    fn a_hot_engine_and_a_retarder_of_descents_have_their_figures() {
        let set = one(cause(
            "heat_derate",
            &[
                ("torque_loss_per_10_k_coolant", 0.08, 0.01),
                ("coolant_start_offset_k", -3.0, 0.5),
                ("derating_lag_s", 25.0, 4.0),
            ],
        ));
        assert!((set["engine.derate_coolant_1_k"].value - 0.008).abs() < 1e-12);
        assert!((set["engine.derate_coolant_k"].value - 368.15).abs() < 1e-9);
        assert!((set["engine.derate_coolant_lag_s"].sigma.unwrap() - 4.0).abs() < 1e-12);
        let downhill = [("torque_downhill_nm", 900.0, 50.0), ("descent_from_frac", 0.012, 0.001)];
        let set = one(cause("hidden_retarder", &downhill));
        assert!((set["driveline.hidden_retarder_downhill_nm"].value - 900.0).abs() < 1e-9);
        assert!((set["driveline.hidden_retarder_from_descent_frac"].value - 0.012).abs() < 1e-12);
    }
}
