//! The catalogue of causes as hypotheses: which parameters, from which starts, with which channels
//! and how small is not worth a word.

use crate::Channel as C;
use crate::param::{P, Theta};
use crate::replay::{Group, affects};

/// What kind of model error a cause is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// A figure of an existing effect is wrong.
    Value,
    /// The truck does something that the model does not have.
    MissingPhysics,
    /// An instrument or the map is wrong, not the truck.
    Instrument,
}

/// One hypothesis. Several may share an id: variants of shape.
pub(crate) struct Hypothesis {
    pub(crate) id: &'static str,
    pub(crate) kind: CauseKind,
    /// Sizes, then shapes.
    pub(crate) sizes: &'static [P],
    pub(crate) shapes: &'static [P],
    /// Values of the shape parameters (offsets from nominal) to start from.
    pub(crate) starts: &'static [Start],
    pub(crate) channels: &'static [C],
    /// Smallest size worth a word, in the unit of the first parameter.
    pub(crate) min_size: f64,
    /// Sign that the size must have; 0: either.
    pub(crate) sign: f64,
}

const LONG: &[C] = &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac];
/// Where the fit of the shape parameters begins, in their order.
pub(crate) type Start = [f64; 2];

/// Part of the width between its bounds within which a figure counts as at one.
const BOUND: f64 = 1e-3;

const ONE: &[Start] = &[[0.0; 2]];

#[expect(clippy::too_many_arguments, reason = "a row of the table below")]
const fn h(
    id: &'static str,
    kind: CauseKind,
    sizes: &'static [P],
    shapes: &'static [P],
    starts: &'static [Start],
    channels: &'static [C],
    min_size: f64,
    sign: f64,
) -> Hypothesis {
    Hypothesis { id, kind, sizes, shapes, starts, channels, min_size, sign }
}

use CauseKind::{Instrument as I, MissingPhysics as M, Value as V};

/// All hypotheses.
pub(crate) const CATALOGUE: &[Hypothesis] = &[
    h("rolling_resistance", V, &[P::Rolling], &[], ONE, LONG, 0.06, 0.0),
    h("air_drag", V, &[P::Drag], &[], ONE, LONG, 0.05, 0.0),
    h("headwind", M, &[P::Headwind], &[], ONE, LONG, 0.8, 0.0),
    h(
        "wind",
        M,
        &[P::WindX, P::WindY],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::HeadingRad],
        2.0,
        0.0,
    ),
    h(
        "mass",
        V,
        &[P::Mass],
        &[P::StiffnessFollowsMass],
        &[[0.0, 0.0], [1.0, 0.0]],
        LONG,
        0.02,
        0.0,
    ),
    h("grade_bias", I, &[P::GradeBias], &[], ONE, &[C::GradeFrac, C::GpsAltitudeM], 0.0005, 0.0),
    h("map_shift", I, &[P::MapShift], &[], ONE, &[C::GradeFrac, C::SMapM], 10.0, 0.0),
    h(
        "tyre_warmup",
        M,
        &[P::WarmupAmp],
        &[P::WarmupTau],
        &[[-0.7, 0.0], [0.0, 0.0], [0.7, 0.0]],
        LONG,
        0.1,
        1.0,
    ),
    h("driveline_loss", V, &[P::DrivelineLoss], &[], ONE, LONG, 0.01, 0.0),
    h(
        "fan_load",
        M,
        &[P::FanPower],
        &[P::FanStart, P::FanWidth],
        &[
            [-10.0, 0.0],
            [-5.0, 0.0],
            [-2.0, 0.0],
            [1.0, 0.0],
            [4.0, 0.0],
            [-5.0, 4.0],
            [-2.0, 4.0],
            [1.0, 4.0],
        ],
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::CoolantTempDegc],
        6.0,
        1.0,
    ),
    h("dragging_brake", M, &[P::DragBrake], &[], ONE, LONG, 150.0, 1.0),
    h("engine_friction", V, &[P::Friction], &[], ONE, LONG, 0.1, 0.0),
    h(
        "altitude_derate",
        M,
        &[P::Altitude],
        &[P::AltitudeStart],
        &[[-1200.0, 0.0], [-700.0, 0.0], [-200.0, 0.0], [300.0, 0.0], [700.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::GpsAltitudeM],
        0.015,
        1.0,
    ),
    h(
        "heat_derate",
        M,
        &[P::HeatAir],
        &[P::HeatAirStart],
        &[[-12.0, 0.0], [-6.0, 0.0], [0.0, 0.0], [4.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::AmbientTempDegc],
        0.01,
        1.0,
    ),
    h(
        "heat_derate",
        M,
        &[P::HeatCoolant],
        &[P::HeatCoolantStart],
        &[[-8.0, 0.0], [-4.0, 0.0], [0.0, 0.0], [5.0, 0.0], [9.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::CoolantTempDegc],
        0.01,
        1.0,
    ),
    h(
        "turbo_lag",
        V,
        &[P::TurboLag],
        &[P::TurboStart],
        ONE,
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm],
        0.08,
        0.0,
    ),
    h(
        "pedal_delay",
        V,
        &[P::PedalDelay],
        &[],
        ONE,
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm],
        0.03,
        0.0,
    ),
    h("shift_duration", V, &[P::ShiftTime], &[], ONE, &[C::ShiftInProcess], 0.08, 0.0),
    h(
        "fuel_map_low_load",
        V,
        &[P::FuelLow],
        &[P::FuelLowLoad, P::FuelLowOver],
        &[
            [-0.5, 0.0],
            [0.0, 0.0],
            [0.6, 0.0],
            [-0.5, 1.0],
            [0.0, 1.0],
            [0.6, 1.0],
            [-0.5, 2.0],
            [0.0, 2.0],
            [0.6, 2.0],
        ],
        &[C::FuelRateGS, C::EngineTorquePercent, C::EngineSpeedRpm],
        0.04,
        0.0,
    ),
    h(
        "brake_gain",
        V,
        &[P::BrakeGain],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::BrakePressureKpa],
        0.05,
        0.0,
    ),
    h(
        "brake_fade",
        M,
        &[P::Fade],
        &[P::FadeStart],
        &[[-80.0, 0.0], [-40.0, 0.0], [0.0, 0.0], [60.0, 0.0]],
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::BrakePressureKpa],
        0.05,
        1.0,
    ),
    h(
        "brake_delay",
        V,
        &[P::BrakeDelay],
        &[],
        ONE,
        &[C::XbrDecelMS2, C::BrakePressureKpa],
        0.04,
        0.0,
    ),
    h(
        "hidden_retarder",
        M,
        &[P::RetarderStage],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::EngineBrakeFrac],
        150.0,
        1.0,
    ),
    h(
        "hidden_retarder",
        M,
        &[P::RetarderBrake],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::XbrDecelMS2],
        600.0,
        1.0,
    ),
    h(
        "hidden_retarder",
        M,
        &[P::RetarderCoast],
        &[P::RetarderFrom],
        &[[-4.0, 0.0], [-2.0, 0.0], [0.0, 0.0], [2.0, 0.0]],
        &[
            C::EngineTorquePercent,
            C::EngineSpeedRpm,
            C::Gear,
            C::GradeFrac,
            C::AcceleratorPedalFrac,
        ],
        100.0,
        1.0,
    ),
    h("speed_scale", I, &[P::SpeedScale], &[], ONE, &[C::GpsSpeedMS], 0.004, 0.0),
    h(
        "yaw_rate_bias",
        I,
        &[P::YawBias],
        &[],
        ONE,
        &[C::YawRateRadS, C::SteeringWheelRad],
        0.0008,
        0.0,
    ),
    h(
        "steering_ratio",
        V,
        &[P::SteerRatio],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.02,
        0.0,
    ),
    h(
        "steering_offset",
        I,
        &[P::SteerOffset],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.015,
        0.0,
    ),
    h(
        "steering_free_play",
        M,
        &[P::FreePlay],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.015,
        1.0,
    ),
    h(
        "steering_lag",
        V,
        &[P::SteerLag],
        &[P::SteerDelay],
        &[[0.0, 0.0], [0.7, 0.0]],
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.03,
        0.0,
    ),
    h(
        "cornering_stiffness_front",
        V,
        &[P::CFront],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.05,
        0.0,
    ),
    h(
        "cornering_stiffness_drive",
        V,
        &[P::CDrive],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.05,
        0.0,
    ),
    h(
        "cornering_stiffness_trailer",
        V,
        &[P::CTrailer],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::TrailerYawRateRadS],
        0.05,
        0.0,
    ),
    h(
        "payload_position",
        V,
        &[P::PayloadX],
        &[P::StiffnessFollows],
        &[[0.0, 0.0], [1.0, 0.0]],
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.15,
        0.0,
    ),
    h(
        "road_bank",
        M,
        &[P::Bank],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS, C::AccelYMS2],
        0.003,
        0.0,
    ),
    h(
        "engine_brake_torque",
        V,
        &[P::EngineBrakeScale],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::EngineBrakeFrac],
        0.06,
        0.0,
    ),
    h("crosswind", M, &[P::Crosswind], &[], ONE, &[C::SteeringWheelRad, C::YawRateRadS], 1.0, 0.0),
];

impl Hypothesis {
    /// All parameters, sizes first.
    pub(crate) fn params(&self) -> impl Iterator<Item = P> + '_ {
        self.sizes.iter().chain(self.shapes).copied()
    }

    /// Groups of modules where the cause shows.
    pub(crate) fn groups(&self) -> Vec<Group> {
        let mut out: Vec<Group> = Vec::new();
        for g in self.params().flat_map(affects) {
            if !out.contains(g) {
                out.push(*g);
            }
        }
        out
    }

    /// Size of the cause at `t`: the value, or the length of a vector.
    pub(crate) fn size(&self, t: &Theta, zero: &Theta) -> f64 {
        let values: Vec<f64> =
            self.sizes.iter().map(|p| t[*p as usize] - zero[*p as usize]).collect();
        if values.len() == 1 { values[0] } else { values.iter().map(|v| v * v).sum::<f64>().sqrt() }
    }

    /// One of its sizes has run to a bound: the fit would go on.
    pub(crate) fn is_at_bound(&self, t: &Theta, zero: &Theta) -> bool {
        self.sizes.iter().any(|p| {
            let (s, x) = (p.spec(), t[*p as usize] - zero[*p as usize]);
            let near = BOUND * (s.hi - s.lo);
            x <= s.lo + near && s.lo < 0.0 || x >= s.hi - near
        })
    }

    /// Nonlinear enough that a linear screen may miss it.
    pub(crate) fn nonlinear(&self) -> bool {
        self.sizes.len() > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catalogue_has_every_id_of_the_contract() {
        let ids = "rolling_resistance air_drag headwind wind mass grade_bias map_shift tyre_warmup \
            driveline_loss fan_load dragging_brake engine_friction altitude_derate heat_derate \
            turbo_lag pedal_delay shift_duration fuel_map_low_load brake_gain brake_fade \
            brake_delay hidden_retarder speed_scale yaw_rate_bias steering_ratio steering_offset \
            steering_free_play steering_lag cornering_stiffness_front cornering_stiffness_drive \
            cornering_stiffness_trailer payload_position road_bank crosswind \
            engine_brake_torque";
        for id in ids.split_whitespace() {
            assert!(CATALOGUE.iter().any(|h| h.id == id), "{id}");
        }
    }
}
