//! The catalogue of causes as hypotheses: which parameters, from which starts, with which channels
//! and how small is not worth a word.

use dynamics::catalogue::{Cause, CauseKind};

use crate::Channel as C;
use crate::param::{P, Theta};
use crate::replay::{Group, affects};

/// One hypothesis. Several may share an id: variants of shape.
pub(crate) struct Hypothesis {
    pub(crate) id: &'static str,
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
    /// What its course may differ along from the catalogue's: signals that drive it, but not the law
    /// that tells it from others.
    pub(crate) course: &'static [Along],
}

/// A measured signal along which the course of a cause may differ from the catalogue's.
pub(crate) enum Along {
    /// As widely as its law is open.
    Open(&'static str),
    /// Its form is fitted over it (onset and slope, threshold and hysteresis, knee): with a wide course
    /// beside it the two would be free of each other.
    Fitted(&'static str),
}

use Along::{Fitted, Open};

impl Along {
    /// The column.
    pub(crate) fn signal(&self) -> &'static str {
        match self {
            Open(name) | Fitted(name) => name,
        }
    }
}

const LONG: &[C] = &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac];
/// Where the fit of the shape parameters begins, in their order.
pub(crate) type Start = [f64; 2];

/// Part of the width between its bounds within which a figure counts as at one.
const BOUND: f64 = 1e-3;

const ONE: &[Start] = &[[0.0; 2]];
/// A meter of a rate may be off by a factor, or more the higher the rate.
const RATES: &[Start] = &[[0.0, 0.0], [1.0, 0.0]];
const METERS: &[C] = &[C::FuelRateGS, C::Co2RateGS];

const fn h(
    id: &'static str,
    sizes: &'static [P],
    shapes: &'static [P],
    starts: &'static [Start],
    channels: &'static [C],
    min_size: f64,
    sign: f64,
) -> Hypothesis {
    Hypothesis { id, sizes, shapes, starts, channels, min_size, sign, course: &[] }
}

impl Hypothesis {
    const fn along(self, course: &'static [Along]) -> Self {
        Self { course, ..self }
    }
}

/// All hypotheses.
pub(crate) const CATALOGUE: &[Hypothesis] = &[
    h("rolling_resistance", &[P::Rolling], &[], ONE, LONG, 0.06, 0.0)
        .along(&[Open("speed_m_s"), Open("time_s")]),
    h("air_drag", &[P::Drag], &[], ONE, LONG, 0.05, 0.0).along(&[Open("time_s")]),
    h("headwind", &[P::Headwind], &[], ONE, LONG, 0.8, 0.0).along(&[Open("time_s")]),
    h(
        "wind",
        &[P::WindX, P::WindY],
        &[P::WindShare],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::HeadingRad],
        2.0,
        0.0,
    )
    .along(&[Open("time_s")]),
    h("mass", &[P::Mass], &[P::StiffnessFollowsMass], &[[0.0, 0.0], [1.0, 0.0]], LONG, 0.02, 0.0)
        .along(&[Open("grade_frac"), Open("accel_y_m_s2")]),
    h("grade_bias", &[P::GradeBias], &[], ONE, &[C::GradeFrac, C::GpsAltitudeM], 0.0005, 0.0)
        .along(&[Open("grade_frac")]),
    h("map_shift", &[P::MapShift], &[], ONE, &[C::GradeFrac, C::SMapM], 10.0, 0.0)
        .along(&[Open("time_s")]),
    h(
        "tyre_warmup",
        &[P::WarmupAmp],
        &[P::WarmupTau],
        &[[-0.7, 0.0], [0.0, 0.0], [0.7, 0.0]],
        LONG,
        0.1,
        1.0,
    )
    .along(&[Open("time_s")]),
    h("driveline_loss", &[P::DrivelineLoss], &[], ONE, LONG, 0.01, 0.0)
        .along(&[Open("engine_torque_percent")]),
    h(
        "fan_load",
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
    )
    .along(&[Open("engine_speed_rpm"), Fitted("coolant_temp_degc")]),
    h("dragging_brake", &[P::DragBrake], &[], ONE, LONG, 150.0, 1.0).along(&[Open("time_s")]),
    h("engine_friction", &[P::Friction], &[], ONE, LONG, 0.1, 0.0)
        .along(&[Open("engine_speed_rpm")]),
    h(
        "altitude_derate",
        &[P::Altitude],
        &[P::AltitudeStart],
        &[[-1200.0, 0.0], [-700.0, 0.0], [-200.0, 0.0], [300.0, 0.0], [700.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::GpsAltitudeM],
        0.015,
        1.0,
    )
    .along(&[Fitted("gps_altitude_m"), Open("engine_speed_rpm")]),
    h(
        "heat_derate",
        &[P::HeatAir],
        &[P::HeatAirStart],
        &[[-12.0, 0.0], [-6.0, 0.0], [0.0, 0.0], [4.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::AmbientTempDegc],
        0.01,
        1.0,
    )
    .along(&[Fitted("ambient_temp_degc"), Open("engine_speed_rpm")]),
    h(
        "heat_derate",
        &[P::HeatCoolant],
        &[P::HeatCoolantStart, P::HeatCoolantLag],
        &[[-8.0, 0.0], [-4.0, 0.0], [0.0, 0.0], [5.0, 0.0], [9.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::CoolantTempDegc],
        0.01,
        1.0,
    )
    .along(&[Fitted("coolant_temp_degc"), Open("engine_speed_rpm")]),
    h(
        "turbo_lag",
        &[P::TurboLag],
        &[P::TurboStart],
        ONE,
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm],
        0.08,
        0.0,
    )
    .along(&[Open("engine_speed_rpm")]),
    h(
        "pedal_delay",
        &[P::PedalDelay],
        &[],
        ONE,
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm],
        0.03,
        0.0,
    )
    .along(&[Open("engine_speed_rpm")]),
    h("shift_duration", &[P::ShiftTime], &[], ONE, &[C::ShiftInProcess], 0.08, 0.0)
        .along(&[Open("gear"), Open("engine_speed_rpm")]),
    h(
        "fuel_map_low_load",
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
    )
    .along(&[Open("engine_speed_rpm"), Fitted("engine_torque_percent")]),
    h(
        "brake_gain",
        &[P::BrakeGain],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::BrakePressureKpa],
        0.05,
        0.0,
    )
    .along(&[Open("brake_pressure_kpa")]),
    h(
        "brake_fade",
        &[P::Fade],
        &[P::FadeStart, P::LiningLag],
        &[[-80.0, 0.0], [-40.0, 0.0], [0.0, 0.0], [60.0, 0.0]],
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::BrakePressureKpa],
        0.05,
        1.0,
    )
    .along(&[Open("speed_m_s"), Open("brake_pressure_kpa")]),
    h("brake_delay", &[P::BrakeDelay], &[], ONE, &[C::XbrDecelMS2, C::BrakePressureKpa], 0.04, 0.0)
        .along(&[Open("brake_pressure_kpa")]),
    h(
        "hidden_retarder",
        &[P::RetarderStage],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::EngineBrakeFrac],
        150.0,
        1.0,
    )
    .along(&[Open("speed_m_s"), Open("time_s")]),
    h(
        "hidden_retarder",
        &[P::RetarderBrake],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::XbrDecelMS2],
        600.0,
        1.0,
    )
    .along(&[Open("speed_m_s"), Open("time_s")]),
    h(
        "hidden_retarder",
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
    )
    .along(&[Open("speed_m_s"), Open("time_s")]),
    h("speed_scale", &[P::SpeedScale], &[], ONE, &[C::GpsSpeedMS], 0.004, 0.0)
        .along(&[Open("time_s")]),
    h(
        "yaw_rate_bias",
        &[P::YawBias],
        &[],
        ONE,
        &[C::YawRateRadS, C::SteeringWheelRad],
        0.0008,
        0.0,
    )
    .along(&[Open("time_s")]),
    h(
        "steering_ratio",
        &[P::SteerRatio],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.02,
        0.0,
    )
    .along(&[Open("time_s")]),
    h(
        "steering_offset",
        &[P::SteerOffset],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.015,
        0.0,
    )
    .along(&[Open("time_s")]),
    h(
        "steering_free_play",
        &[P::FreePlay],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.015,
        1.0,
    )
    .along(&[Open("speed_m_s")]),
    h(
        "steering_lag",
        &[P::SteerLag],
        &[P::SteerDelay],
        &[[0.0, 0.0], [0.7, 0.0]],
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.03,
        0.0,
    )
    .along(&[Open("speed_m_s")]),
    h(
        "cornering_stiffness_front",
        &[P::CFront],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.05,
        0.0,
    )
    .along(&[Open("speed_m_s"), Open("accel_y_m_s2")]),
    h(
        "cornering_stiffness_drive",
        &[P::CDrive],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.05,
        0.0,
    )
    .along(&[Open("speed_m_s"), Open("accel_y_m_s2")]),
    h(
        "cornering_stiffness_trailer",
        &[P::CTrailer],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::TrailerYawRateRadS],
        0.05,
        0.0,
    )
    .along(&[Open("speed_m_s"), Open("accel_y_m_s2")]),
    h(
        "payload_position",
        &[P::PayloadX],
        &[P::StiffnessFollows, P::PayloadSpread],
        &[[0.0, 0.0], [1.0, 0.0]],
        &[C::SteeringWheelRad, C::YawRateRadS],
        0.15,
        0.0,
    )
    .along(&[Open("speed_m_s")]),
    h(
        "road_bank",
        &[P::Bank],
        &[],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS, C::AccelYMS2],
        0.003,
        0.0,
    )
    .along(&[Open("curvature_1_m")]),
    h(
        "engine_brake_torque",
        &[P::EngineBrakeScale],
        &[],
        ONE,
        &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, C::EngineBrakeFrac],
        0.06,
        0.0,
    )
    .along(&[Open("engine_speed_rpm")]),
    h(
        "crosswind",
        &[P::Crosswind],
        &[P::CrosswindShare],
        ONE,
        &[C::SteeringWheelRad, C::YawRateRadS],
        1.0,
        0.0,
    )
    .along(&[Open("time_s")]),
    h("fuel_flow_scale", &[P::FuelFlow], &[P::FuelFlowPower], RATES, METERS, 0.02, 0.0)
        .along(&[Open("engine_speed_rpm"), Open("time_s")]),
    h("co2_scale", &[P::Co2Scale], &[P::Co2Power], RATES, METERS, 0.03, 0.0)
        .along(&[Open("time_s")]),
];

impl Hypothesis {
    /// All parameters, sizes first.
    pub(crate) fn params(&self) -> impl Iterator<Item = P> + '_ {
        self.sizes.iter().chain(self.shapes).copied()
    }

    /// The cause in the catalogue of the truck model: its kind, and the figures that carry it.
    pub(crate) fn of_truck(&self) -> Option<&'static Cause> {
        dynamics::catalogue::cause(self.id)
    }

    /// Kind of error.
    pub(crate) fn kind(&self) -> CauseKind {
        self.of_truck().map_or(CauseKind::MissingPhysics, |c| c.kind)
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
    fn the_catalogue_is_that_of_the_truck_model() {
        for h in CATALOGUE {
            assert!(h.of_truck().is_some(), "{}", h.id);
        }
        for c in &dynamics::catalogue::CATALOGUE {
            assert!(CATALOGUE.iter().any(|h| h.id == c.id), "{}", c.id);
        }
    }
}
