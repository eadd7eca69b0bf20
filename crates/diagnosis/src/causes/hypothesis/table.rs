//! The table of hypotheses: which parameters, from which starts, with which channels and how small is
//! not worth a word.

use super::Along::{self, Fitted, Made, Open, Wanders, Weather};
use super::{Hypothesis, Start};
use crate::Channel as C;
use crate::causes::param::P;

/// What the force balance needs.
const LONG: &[C] = &[C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac];
const WITH_HEADING: &[C] = &with(C::HeadingRad);
const WITH_COOLANT: &[C] = &with(C::CoolantTempDegc);
const WITH_PRESSURE: &[C] = &with(C::BrakePressureKpa);
const WITH_DEMAND: &[C] = &with(C::XbrDecelMS2);
const WITH_STAGE: &[C] = &with(C::EngineBrakeFrac);
const WITH_PEDAL: &[C] = &with(C::AcceleratorPedalFrac);
/// What the torque's response needs.
const PEDAL: &[C] = &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm];
const STEERING: &[C] = &[C::SteeringWheelRad, C::YawRateRadS];
const METERS: &[C] = &[C::FuelRateGS, C::Co2RateGS];

/// No shape to begin with.
const ONE: &[Start] = &[[0.0; 3]];
/// A side force turns the truck one way or the other by where it acts: between the two lies a share
/// that turns it not at all, which no fit passes.
const EITHER_SIDE: &[Start] = &[[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]];
/// A delay is a dead time, a lag or both.
const LATE_OR_SLOW: &[Start] = &[[0.0, 0.0, 0.0], [0.7, 0.0, 0.0]];
/// Boost is there from one load on, or comes over a quarter of it.
const SUDDEN_OR_SOFT: &[Start] = &[[0.0, 0.0, 0.0], [0.0, 0.25, 0.0]];
/// A meter of a rate may be off by a factor, or more the higher the rate.
const RATES: &[Start] = &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];

/// Mass of a laden train over that of its payload, 1: 40 t of which 25 t are payload.
const TRAIN_OVER_PAYLOAD: f64 = 1.6;
/// How far load that no sheet knows lies from the rest, m. A judgement: plans of load distribution (VDI
/// 2700-4) bound the place of a full load by the axles, of a light one hardly.
const LIES_ELSEWHERE_M: f64 = 1.0;
/// How far its squared distance from the middle differs from the payload's squared radius of gyration, in
/// that: `3 u²` of places `u` anywhere between the ends of a box, -1 to 1, scatters by 4 / sqrt(20).
const LIES_APART_FRAC: f64 = 0.9;

/// The force balance with one more channel.
const fn with(channel: C) -> [C; 5] {
    [C::EngineTorquePercent, C::EngineSpeedRpm, C::Gear, C::GradeFrac, channel]
}

const fn h(
    id: &'static str,
    sizes: &'static [P],
    shapes: &'static [P],
    starts: &'static [Start],
    channels: &'static [C],
    min_size: f64,
    sign: f64,
) -> Hypothesis {
    Hypothesis { id, sizes, shapes, starts, channels, min_size, sign, course: &[], brings: &[] }
}

impl Hypothesis {
    const fn along(self, course: &'static [Along]) -> Self {
        Self { course, ..self }
    }

    const fn bringing(self, brings: &'static [(P, f64)]) -> Self {
        Self { brings, ..self }
    }
}

/// All hypotheses.
pub(crate) const CATALOGUE: &[Hypothesis] = &[
    // How rolling grows with speed is a tyre's own: by none to 0.026 s/m of it (Rakha 2001, radial tyres).
    h("rolling_resistance", &[P::Rolling], &[], ONE, LONG, 0.06, 0.0)
        .along(&[Made("speed_m_s"), Open("time_s")]),
    h("air_drag", &[P::Drag], &[], ONE, LONG, 0.05, 0.0).along(&[Open("time_s")]),
    h("headwind", &[P::Headwind], &[], ONE, LONG, 0.8, 0.0).along(&[Weather("time_s")]),
    h(
        "wind",
        &[P::WindX, P::WindY],
        &[P::WindShare, P::WindBehind],
        EITHER_SIDE,
        WITH_HEADING,
        2.0,
        0.0,
    )
    .along(&[Weather("time_s")]),
    h(
        "mass",
        &[P::Mass],
        &[P::StiffnessFollowsMass],
        &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
        LONG,
        0.02,
        0.0,
    )
    .along(&[Open("grade_frac"), Open("accel_y_m_s2")])
    .bringing(&[
        (P::PayloadX, TRAIN_OVER_PAYLOAD * LIES_ELSEWHERE_M),
        (P::PayloadSpread, TRAIN_OVER_PAYLOAD * LIES_APART_FRAC),
    ]),
    h("grade_bias", &[P::GradeBias], &[], ONE, &[C::GradeFrac, C::GpsAltitudeM], 0.0005, 0.0)
        .along(&[Open("grade_frac")]),
    h("map_shift", &[P::MapShift], &[], ONE, &[C::GradeFrac, C::SMapM], 10.0, 0.0)
        .along(&[Wanders("time_s")]),
    h(
        "tyre_warmup",
        &[P::WarmupAmp],
        &[P::WarmupTau],
        &[[-0.7, 0.0, 0.0], [0.0, 0.0, 0.0], [0.7, 0.0, 0.0]],
        LONG,
        0.1,
        1.0,
    )
    .along(&[Open("time_s")]),
    h("driveline_loss", &[P::DrivelineLoss], &[P::MeshLoss], ONE, LONG, 0.01, 0.0)
        .along(&[Open("engine_torque_percent")]),
    h(
        "fan_load",
        &[P::FanPower],
        &[P::FanStart, P::FanWidth, P::FanBand],
        &[
            [-10.0, 0.0, 0.0],
            [-5.0, 0.0, 0.0],
            [-2.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [-5.0, 4.0, 3.0],
            [-2.0, 4.0, 3.0],
            [1.0, 4.0, 3.0],
        ],
        WITH_COOLANT,
        6.0,
        1.0,
    )
    .along(&[Open("engine_speed_rpm"), Fitted("coolant_temp_degc")]),
    h("dragging_brake", &[P::DragBrake], &[], ONE, LONG, 150.0, 1.0).along(&[Open("time_s")]),
    // Oil that is cold rubs more.
    h("engine_friction", &[P::Friction], &[], ONE, LONG, 0.1, 0.0)
        .along(&[Open("engine_speed_rpm"), Open("time_s")]),
    h(
        "altitude_derate",
        &[P::Altitude],
        &[P::AltitudeStart],
        &[
            [-1200.0, 0.0, 0.0],
            [-700.0, 0.0, 0.0],
            [-200.0, 0.0, 0.0],
            [300.0, 0.0, 0.0],
            [700.0, 0.0, 0.0],
        ],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::GpsAltitudeM],
        0.015,
        1.0,
    )
    .along(&[Fitted("gps_altitude_m"), Open("engine_speed_rpm")]),
    h(
        "heat_derate",
        &[P::HeatAir],
        &[P::HeatAirStart],
        &[[-12.0, 0.0, 0.0], [-6.0, 0.0, 0.0], [0.0, 0.0, 0.0], [4.0, 0.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::AmbientTempDegc],
        0.01,
        1.0,
    )
    .along(&[Fitted("ambient_temp_degc"), Open("engine_speed_rpm")]),
    h(
        "heat_derate",
        &[P::HeatCoolant],
        &[P::HeatCoolantStart, P::HeatCoolantLag],
        &[[-8.0, 0.0, 0.0], [-4.0, 0.0, 0.0], [0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [9.0, 0.0, 0.0]],
        &[C::AcceleratorPedalFrac, C::EngineTorquePercent, C::EngineSpeedRpm, C::CoolantTempDegc],
        0.01,
        1.0,
    )
    .along(&[Fitted("coolant_temp_degc"), Open("engine_speed_rpm")]),
    h(
        "turbo_lag",
        &[P::TurboLag],
        &[P::TurboStart, P::TurboWidth],
        SUDDEN_OR_SOFT,
        PEDAL,
        0.08,
        0.0,
    )
    .along(&[Open("engine_speed_rpm"), Fitted("engine_torque_percent")]),
    h("pedal_delay", &[P::PedalDelay], &[P::PedalLag], ONE, PEDAL, 0.03, 0.0)
        .along(&[Open("engine_speed_rpm")]),
    h("shift_duration", &[P::ShiftTime], &[], ONE, &[C::ShiftInProcess], 0.08, 0.0)
        .along(&[Open("gear"), Open("engine_speed_rpm")]),
    h(
        "fuel_map_low_load",
        &[P::FuelLow],
        &[P::FuelLowLoad, P::FuelLowOver],
        &[
            [-0.5, 0.0, 0.0],
            [0.0, 0.0, 0.0],
            [0.6, 0.0, 0.0],
            [-0.5, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.6, 1.0, 0.0],
            [-0.5, 2.0, 0.0],
            [0.0, 2.0, 0.0],
            [0.6, 2.0, 0.0],
        ],
        &[C::FuelRateGS, C::EngineTorquePercent, C::EngineSpeedRpm],
        0.04,
        0.0,
    )
    .along(&[Open("engine_speed_rpm"), Fitted("engine_torque_percent")]),
    // Axles begin to brake at pressures of their own, and a lining's friction falls with it or rises: no
    // data sheet says how far (a judgement, as of a fade's law).
    h("brake_gain", &[P::BrakeGain], &[], ONE, WITH_PRESSURE, 0.05, 0.0)
        .along(&[Made("brake_pressure_kpa")]),
    h(
        "brake_fade",
        &[P::Fade],
        &[P::FadeStart, P::LiningLag],
        &[[-80.0, 0.0, 0.0], [-40.0, 0.0, 0.0], [0.0, 0.0, 0.0], [60.0, 0.0, 0.0]],
        WITH_PRESSURE,
        0.05,
        1.0,
    )
    .along(&[Open("speed_m_s"), Open("brake_pressure_kpa")]),
    h("brake_delay", &[P::BrakeDelay], &[], ONE, &[C::XbrDecelMS2, C::BrakePressureKpa], 0.04, 0.0)
        .along(&[Open("brake_pressure_kpa")]),
    h("hidden_retarder", &[P::RetarderStage], &[], ONE, WITH_STAGE, 150.0, 1.0)
        .along(&[Open("speed_m_s"), Open("time_s")]),
    h(
        "hidden_retarder",
        &[P::RetarderBrake],
        &[P::RetarderSaturation],
        &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        WITH_DEMAND,
        600.0,
        1.0,
    )
    .along(&[Open("speed_m_s"), Open("time_s")]),
    // What holds the truck while the foot is away need not do so by the same beside an engine brake.
    h(
        "hidden_retarder",
        &[P::RetarderCoast],
        &[P::RetarderFrom],
        &[[-4.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        WITH_PEDAL,
        100.0,
        1.0,
    )
    .along(&[Open("speed_m_s"), Open("engine_brake_frac"), Open("time_s")]),
    h(
        "hidden_retarder",
        &[P::RetarderSlope],
        &[P::RetarderSteep],
        &[[0.004, 0.0, 0.0], [0.01, 0.0, 0.0], [0.018, 0.0, 0.0]],
        WITH_PEDAL,
        100.0,
        1.0,
    )
    .along(&[Open("speed_m_s"), Open("engine_brake_frac"), Open("time_s")]),
    h("speed_scale", &[P::SpeedScale], &[], ONE, &[C::GpsSpeedMS], 0.004, 0.0)
        .along(&[Open("speed_m_s"), Open("time_s")]),
    h(
        "yaw_rate_bias",
        &[P::YawBias],
        &[],
        ONE,
        &[C::YawRateRadS, C::SteeringWheelRad],
        0.0008,
        0.0,
    )
    .along(&[Wanders("time_s")]),
    // Gear and linkage turn the wheels less about the middle than beyond, or more.
    h("steering_ratio", &[P::SteerRatio], &[], ONE, STEERING, 0.02, 0.0)
        .along(&[Open("steering_wheel_rad")]),
    h("steering_offset", &[P::SteerOffset], &[], ONE, STEERING, 0.015, 0.0)
        .along(&[Wanders("time_s")]),
    h(
        "steering_free_play",
        &[P::FreePlay],
        &[P::PlayCentring],
        &[[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]],
        STEERING,
        0.015,
        1.0,
    )
    .along(&[Open("speed_m_s")]),
    h("steering_lag", &[P::SteerLag], &[P::SteerDelay], LATE_OR_SLOW, STEERING, 0.03, 0.0)
        .along(&[Open("speed_m_s")]),
    h("cornering_stiffness_front", &[P::CFront], &[], ONE, STEERING, 0.05, 0.0)
        .along(&[Open("speed_m_s"), Open("accel_y_m_s2")]),
    h("cornering_stiffness_drive", &[P::CDrive], &[], ONE, STEERING, 0.05, 0.0)
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
        &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
        STEERING,
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
    h("engine_brake_torque", &[P::EngineBrakeScale], &[], ONE, WITH_STAGE, 0.06, 0.0)
        .along(&[Open("engine_speed_rpm")]),
    h(
        "crosswind",
        &[P::Crosswind],
        &[P::CrosswindShare, P::CrosswindBehind],
        EITHER_SIDE,
        STEERING,
        1.0,
        0.0,
    )
    .along(&[Weather("time_s")]),
    h("fuel_flow_scale", &[P::FuelFlow], &[P::FuelFlowPower], RATES, METERS, 0.02, 0.0)
        .along(&[Open("engine_speed_rpm"), Open("time_s")]),
    h("co2_scale", &[P::Co2Scale], &[P::Co2Power], RATES, METERS, 0.03, 0.0)
        .along(&[Open("time_s")]),
];
