//! The catalogue of causes: what can be wrong with a truck model, by name, and which figures of
//! the truck file carry it.
//!
//! A cause has sizes and shapes. All sizes zero is the truck file as it is; a shape (a threshold, a
//! time constant) matters only while a size is not zero. [`Cause::overlay`] writes a cause of
//! given sizes as an overlay, so that the same simulator runs the extended truck.
//!
//! Prior spreads and bounds are engineering ranges for highway trucks (weather wind 4 m/s, load
//! sheets 8 %, tyres and linings 20 %); they are the spread of the cause where it is present, not
//! the tolerance of a truck in order. Left out: delays above [`crate::MAX_DELAY_S`].

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{DynamicsError, Overlay, OverlayValue, TruckParameters};

/// What kind of model error a cause is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// A figure of an existing effect is wrong.
    Value,
    /// The truck does something that the model does not have.
    MissingPhysics,
    /// An instrument, the map or the mounting is wrong, not the truck.
    Instrument,
}

/// Who gives the law by which a cause follows signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// Physics: a mass, a grade, a drag, the linearity of an instrument.
    Physics,
    /// A maker chose it, or a component happens to follow it: the catalogue's is one of many, and a
    /// quarter more or less somewhere is still that cause.
    Chosen,
}

/// How the size of a parameter changes the truck file's figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Acts {
    /// `figure * (1 + size)`; the size has no unit.
    Scale,
    /// `figure + size`, in the figure's unit.
    Add,
}

/// One figure of the truck file that carries a cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CauseParameter {
    /// Dotted path, see [`TruckParameters::with_parameter`].
    pub path: &'static str,
    /// Unit of the size.
    pub unit: &'static str,
    /// How the size acts.
    pub acts: Acts,
    /// Standard deviation of the size where the cause is present.
    pub prior_sigma: f64,
    /// Smallest and largest size considered.
    pub bounds: [f64; 2],
}

impl CauseParameter {
    /// The figure of the truck file that `nominal` becomes with a size.
    #[must_use]
    pub fn value(&self, nominal: f64, size: f64) -> f64 {
        match self.acts {
            Acts::Scale => nominal * (1.0 + size),
            Acts::Add => nominal + size,
        }
    }

    /// How much the figure changes per size.
    #[must_use]
    pub fn slope(&self, nominal: f64) -> f64 {
        match self.acts {
            Acts::Scale => nominal,
            Acts::Add => 1.0,
        }
    }
}

/// A named cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cause {
    /// Fixed word.
    pub id: &'static str,
    /// Kind.
    pub kind: CauseKind,
    /// Who gives its law.
    pub law: Law,
    /// What it means when the first size is positive.
    pub higher: &'static str,
    /// What it means when the first size is negative; the same where it only comes with one sign.
    pub lower: &'static str,
    /// Parameters that are zero without the cause.
    pub sizes: &'static [CauseParameter],
    /// Parameters that say how it looks.
    pub shapes: &'static [CauseParameter],
}

/// An estimate of one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Size, in the parameter's unit.
    pub size: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

impl Cause {
    /// Sizes, then shapes.
    pub fn parameters(&self) -> impl Iterator<Item = &'static CauseParameter> + use<> {
        self.sizes.iter().chain(self.shapes)
    }

    /// This cause on a truck, as an overlay: one estimate per parameter (sizes, then shapes);
    /// parameters without one stay as they are.
    ///
    /// # Errors
    /// [`DynamicsError::UnknownParameter`] if the truck lacks a figure.
    pub fn overlay(
        &self,
        truck: &TruckParameters,
        name: &str,
        estimates: &[Estimate],
        source: &str,
    ) -> Result<Overlay, DynamicsError> {
        let mut set = BTreeMap::new();
        for (p, e) in self.parameters().zip(estimates) {
            let nominal =
                truck.parameter(p.path).ok_or_else(|| truck.unknown_parameter(name, p.path))?;
            let value = OverlayValue {
                value: p.value(nominal, e.size),
                sigma: Some(p.slope(nominal).abs() * e.sigma),
                bounds: Some(p.bounds.map(|b| p.value(nominal, b))),
                source: source.into(),
            };
            set.insert(p.path.to_owned(), value);
        }
        Ok(Overlay {
            schema: 1,
            base: truck.name.clone(),
            name: name.into(),
            set,
            table_effects: Vec::new(),
        })
    }
}

const fn scale(path: &'static str, sigma: f64, low: f64, high: f64) -> CauseParameter {
    CauseParameter { path, unit: "1", acts: Acts::Scale, prior_sigma: sigma, bounds: [low, high] }
}

const fn add(
    path: &'static str,
    unit: &'static str,
    sigma: f64,
    low: f64,
    high: f64,
) -> CauseParameter {
    CauseParameter { path, unit, acts: Acts::Add, prior_sigma: sigma, bounds: [low, high] }
}

macro_rules! cause {
    ($id:literal, $kind:ident, $law:ident, $higher:literal / $lower:literal, [$($size:expr),+], [$($shape:expr),*]) => {
        Cause {
            id: $id,
            kind: CauseKind::$kind,
            law: Law::$law,
            higher: $higher,
            lower: $lower,
            sizes: &[$($size),+],
            shapes: &[$($shape),*],
        }
    };
}

/// Every cause that the truck model can carry.
#[rustfmt::skip]
pub static CATALOGUE: [Cause; 37] = [
    cause!("rolling_resistance", Value, Physics,
        "rolling resistance higher than modelled" / "rolling resistance lower than modelled",
        [scale("resistance.rolling_coeff", 0.2, -0.6, 1.5)], []),
    cause!("air_drag", Value, Physics,
        "drag area larger than modelled" / "drag area smaller than modelled",
        [scale("resistance.drag_area_m2", 0.15, -0.6, 1.0)], []),
    cause!("headwind", MissingPhysics, Physics,
        "a headwind goes with the truck" / "a tailwind goes with the truck",
        [add("resistance.headwind_m_s", "m/s", 3.0, -15.0, 15.0)], []),
    cause!("wind", MissingPhysics, Physics,
        "an earth-fixed wind blows" / "an earth-fixed wind blows",
        [add("resistance.wind_to_x_m_s", "m/s", 4.0, -20.0, 20.0),
         add("resistance.wind_to_y_m_s", "m/s", 4.0, -20.0, 20.0)],
        [add("resistance.side_force_tractor_frac", "1", 0.12, -0.25, 0.5),
         add("resistance.side_force_trailer_behind_cg_m", "m", 1.0, -4.0, 4.0)]),
    cause!("mass", Value, Physics,
        "the truck is heavier than its load sheet" / "the truck is lighter than its load sheet",
        [scale("instruments.mass_scale_coeff", 0.08, -0.4, 0.6)], []),
    cause!("grade_bias", Instrument, Physics,
        "the road is steeper than its map" / "the road is less steep than its map",
        [add("instruments.grade_bias_frac", "1", 0.002, -0.02, 0.02)], []),
    cause!("map_shift", Instrument, Physics,
        "the map lies ahead of the road" / "the map lies behind the road",
        [add("instruments.map_shift_m", "m", 40.0, -300.0, 300.0)], []),
    cause!("tyre_warmup", MissingPhysics, Physics,
        "cold tyres roll harder and warm up" / "cold tyres roll harder and warm up",
        [add("resistance.cold_tyre_extra_frac", "1", 0.3, 0.0, 1.5)],
        [scale("resistance.tyre_warmup_s", 0.5, -0.7, 2.3)]),
    cause!("driveline_loss", Value, Physics,
        "the driveline loses more than modelled" / "the driveline loses less than modelled",
        [scale("driveline.loss_scale_coeff", 0.6, -1.0, 4.0)],
        [add("driveline.mesh_loss_frac", "1", 0.015, -0.05, 0.2)]),
    cause!("fan_load", MissingPhysics, Chosen,
        "the fan takes more power than modelled" / "the fan takes less power than modelled",
        [add("engine.fan_power_w", "W", 20_000.0, 0.0, 60_000.0)],
        [add("engine.fan_on_k", "K", 5.0, -14.0, 14.0),
         add("engine.fan_hysteresis_k", "K", 3.0, 0.0, 12.0),
         add("engine.fan_band_k", "K", 3.0, 0.0, 12.0)]),
    cause!("dragging_brake", MissingPhysics, Physics,
        "a constant force holds the truck back: a dragging brake"
        / "a constant force holds the truck back: a dragging brake",
        [add("resistance.parasitic_force_n", "N", 600.0, 0.0, 6_000.0)], []),
    cause!("engine_friction", Value, Chosen,
        "engine friction higher than modelled" / "engine friction lower than modelled",
        [scale("engine.friction_scale_coeff", 0.25, -0.7, 1.5)], []),
    cause!("altitude_derate", MissingPhysics, Chosen,
        "full load falls with altitude" / "full load falls with altitude",
        [add("engine.derate_altitude_1_m", "1/m", 8e-5, 0.0, 5e-4)],
        [add("engine.derate_altitude_m", "m", 600.0, -1_500.0, 1_500.0)]),
    cause!("heat_derate", MissingPhysics, Chosen,
        "full load falls in the heat" / "full load falls in the heat",
        [add("engine.derate_air_1_k", "1/K", 0.006, 0.0, 0.05),
         add("engine.derate_coolant_1_k", "1/K", 0.01, 0.0, 0.06)],
        [add("engine.derate_air_k", "K", 6.0, -20.0, 12.0),
         add("engine.derate_coolant_k", "K", 5.0, -14.0, 14.0),
         add("engine.derate_coolant_lag_s", "s", 20.0, 0.0, 120.0)]),
    cause!("turbo_lag", Value, Chosen,
        "torque builds up slower than modelled" / "torque builds up faster than modelled",
        [scale("engine.slow_lag_s", 0.9, -0.9, 8.0)],
        [add("engine.lag_threshold_frac", "1", 0.1, -0.3, 0.4),
         add("engine.lag_width_frac", "1", 0.15, 0.0, 0.6)]),
    cause!("pedal_delay", Value, Chosen,
        "the pedal acts later than modelled" / "the pedal acts sooner than modelled",
        [add("engine.pedal_delay_s", "s", 0.2, -0.05, 0.55)], []),
    cause!("shift_duration", Value, Chosen,
        "shifts last longer than modelled" / "shifts are shorter than modelled",
        [scale("shift.duration_scale_coeff", 0.4, -0.8, 3.0)], []),
    cause!("fuel_map_low_load", Value, Chosen,
        "the engine burns more at low load than modelled"
        / "the engine burns less at low load than modelled",
        [add("engine.fuel.low_load_extra_frac", "1", 0.2, -0.5, 2.0)],
        [scale("engine.fuel.low_load_kw", 0.35, -0.7, 1.7)]),
    cause!("brake_gain", Value, Physics,
        "brake force per pressure higher than modelled"
        / "brake force per pressure lower than modelled",
        [scale("brake.gain_scale_coeff", 0.2, -0.8, 1.5)], []),
    cause!("brake_fade", MissingPhysics, Chosen,
        "hot brakes lose force" / "hot brakes lose less force than modelled",
        [add("brake.fade_1_k", "1/K", 0.003, 0.0, 0.015)],
        [add("brake.fade_from_k", "K", 50.0, -100.0, 200.0),
         add("brake.lining_lag_s", "s", 20.0, 0.0, 120.0)]),
    cause!("brake_delay", Value, Chosen,
        "the brakes answer later than modelled" / "the brakes answer sooner than modelled",
        [add("brake.dead_time_s", "s", 0.2, -0.25, 0.38)], []),
    cause!("hidden_retarder", MissingPhysics, Chosen,
        "a retarder acts that the model does not have"
        / "a retarder acts that the model does not have",
        [add("driveline.hidden_retarder_torque_nm", "Nm", 800.0, 0.0, 5_000.0),
         add("driveline.hidden_retarder_downhill_nm", "Nm", 800.0, 0.0, 5_000.0)],
        [add("driveline.hidden_retarder_from_m_s", "m/s", 3.0, -7.0, 7.0),
         add("driveline.hidden_retarder_from_descent_frac", "1", 0.01, 0.0, 0.03)]),
    // Tyres grow with speed and slip with pull: no factor is the same everywhere.
    cause!("speed_scale", Instrument, Chosen,
        "the wheel speed reads too high" / "the wheel speed reads too low",
        [scale("instruments.speed_scale_coeff", 0.02, -0.2, 0.2)], []),
    cause!("yaw_rate_bias", Instrument, Physics,
        "the yaw rate reads too far left" / "the yaw rate reads too far right",
        [add("instruments.yaw_rate_bias_rad_s", "rad/s", 0.004, -0.05, 0.05)], []),
    cause!("steering_ratio", Value, Chosen,
        "steering less direct than modelled" / "steering more direct than modelled",
        [scale("lateral.steering.ratio", 0.08, -0.4, 0.6)], []),
    cause!("steering_offset", Instrument, Physics,
        "the steering wheel stands left on a straight road"
        / "the steering wheel stands right on a straight road",
        [add("lateral.steering.offset_rad", "rad", 0.05, -0.6, 0.6)], []),
    cause!("steering_free_play", MissingPhysics, Chosen,
        "the steering has free play" / "the steering has less free play than modelled",
        [add("lateral.steering.free_play_rad", "rad", 0.06, 0.0, 0.6)],
        [add("lateral.steering.free_play_centring_1_s", "1/s", 0.3, 0.0, 3.0)]),
    cause!("steering_lag", Value, Chosen,
        "steering acts later than modelled" / "steering acts sooner than modelled",
        [add("lateral.steering.lag_s", "s", 0.12, -0.08, 1.0)], []),
    cause!("cornering_stiffness_front", Value, Physics,
        "steer-axle tyres stiffer than modelled" / "steer-axle tyres softer than modelled",
        [scale("lateral.tyres.stiffness_scale[0]", 0.2, -0.7, 1.0)], []),
    cause!("cornering_stiffness_drive", Value, Physics,
        "drive-axle tyres stiffer than modelled" / "drive-axle tyres softer than modelled",
        [scale("lateral.tyres.stiffness_scale[1]", 0.2, -0.6, 1.0)], []),
    cause!("cornering_stiffness_trailer", Value, Physics,
        "trailer tyres stiffer than modelled" / "trailer tyres softer than modelled",
        [scale("lateral.tyres.stiffness_scale[2]", 0.2, -0.8, 1.5)], []),
    cause!("payload_position", Value, Physics,
        "the payload lies further back than modelled"
        / "the payload lies further forward than modelled",
        [add("lateral.payload.cg_behind_hitch_m", "m", 0.6, -3.0, 1.5)],
        [scale("lateral.payload.yaw_gyration_squared_m2", 0.25, -0.6, 0.8)]),
    cause!("road_bank", MissingPhysics, Physics,
        "the road is banked, left side up" / "the road is banked, right side up",
        [add("instruments.bank_offset_rad", "rad", 0.015, -0.12, 0.12)], []),
    cause!("crosswind", MissingPhysics, Physics,
        "a crosswind blows to the left" / "a crosswind blows to the right",
        [add("resistance.crosswind_to_left_m_s", "m/s", 4.0, -20.0, 20.0)],
        [add("resistance.side_force_tractor_frac", "1", 0.12, -0.25, 0.5),
         add("resistance.side_force_trailer_behind_cg_m", "m", 1.0, -4.0, 4.0)]),
    cause!("engine_brake_torque", Value, Chosen,
        "the engine brake holds more than modelled" / "the engine brake holds less than modelled",
        [scale("engine.engine_brake_scale_coeff", 0.2, -0.9, 1.0)], []),
    cause!("fuel_flow_scale", Instrument, Physics,
        "the fuel meter reads too high" / "the fuel meter reads too low",
        [scale("instruments.fuel_flow_scale_coeff", 0.1, -0.5, 1.0)],
        [add("instruments.fuel_flow_exponent_coeff", "1", 0.7, -1.0, 3.0)]),
    cause!("co2_scale", Instrument, Physics,
        "the CO2 meter reads too high" / "the CO2 meter reads too low",
        [scale("instruments.co2_scale_coeff", 0.1, -0.5, 1.0)],
        [add("instruments.co2_exponent_coeff", "1", 0.7, -1.0, 3.0)]),
];

/// A cause by its id.
#[must_use]
pub fn cause(id: &str) -> Option<&'static Cause> {
    CATALOGUE.iter().find(|c| c.id == id)
}
