//! Modular replay: every module of the truck model is driven by *measured* interface signals and
//! compared with its own measured output, so that an error in one module does not travel through
//! the driver or through another module.
//!
//! A residual is measured minus replayed. Rows that a module cannot judge (shifts, standstill,
//! rest) are masked by the measurement alone, never by the parameters.

mod air;
mod brake;
mod co2;
mod engaged;
pub(crate) mod force;
mod grip;
mod inputs;
mod lateral;
pub(crate) mod parts;
pub(crate) mod plant;
mod powertrain;
mod prepared;
mod profiles;
mod retarder;
mod rise;
mod rows;
mod section;
mod sensors;
pub(crate) mod signal;
mod smooth;

pub(crate) use powertrain::{CRUISE_RPM, LOW_LOAD_FRAC};
pub(crate) use prepared::Prepared;
pub(crate) use retarder::{RETARDER_LAG_S, RETARDER_POWER_W};
pub(crate) use smooth::{JUMP_FRAC, by_neighbours};

use crate::Plant;
use crate::causes::param::{P, PARAMS, Theta};

/// A residual channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
pub enum Module {
    /// Force balance over one second, m/s.
    Force,
    /// Engine torque response, percent of the reference torque.
    Torque,
    /// Brake pressure response, kPa.
    Brake,
    /// Duration of shifts, s.
    Shift,
    /// Fuel rate, g/s over its own noise scale.
    Fuel,
    /// Tractor yaw rate, rad/s.
    Yaw,
    /// Trailer yaw rate, rad/s.
    TrailerYaw,
    /// Lateral acceleration, m/s².
    AccelY,
    /// GPS speed against wheel speed, m/s.
    Gps,
    /// GPS altitude against the map, m.
    Altitude,
    /// Heading against the integrated yaw rate, rad.
    Heading,
    /// Longitudinal accelerometer against speed and grade, m/s over one second.
    Imu,
    /// CO2 in the exhaust from the fuel rate, g/s over its own noise scale.
    Co2,
}

/// Number of modules.
pub(crate) const MODULES: usize = 13;

use Module as M;

impl Module {
    /// All modules.
    pub(crate) const ALL: [Self; MODULES] = [
        M::Force,
        M::Torque,
        M::Brake,
        M::Shift,
        M::Fuel,
        M::Yaw,
        M::TrailerYaw,
        M::AccelY,
        M::Gps,
        M::Altitude,
        M::Heading,
        M::Imu,
        M::Co2,
    ];

    /// The measured quantity that the module explains.
    #[must_use]
    pub fn quantity(self) -> &'static str {
        match self {
            M::Force => "speed_m_s",
            M::Torque => "engine_torque_percent",
            M::Brake => "brake_pressure_kpa",
            M::Shift => "shift_in_process",
            M::Fuel => "fuel_rate_g_s",
            M::Yaw => "yaw_rate_rad_s",
            M::TrailerYaw => "trailer_yaw_rate_rad_s",
            M::AccelY => "accel_y_m_s2",
            M::Gps => "gps_speed_m_s",
            M::Altitude => "gps_altitude_m",
            M::Heading => "heading_rad",
            M::Imu => "accel_x_m_s2",
            M::Co2 => "co2_rate_g_s",
        }
    }

    /// Whether the module's model reads a message whose noise is that of its rows: the engine's torque.
    pub(crate) fn reads_noise(self) -> bool {
        self == M::Fuel
    }

    /// Samples between two rows of the module.
    pub(crate) fn row_step(self) -> usize {
        match self {
            M::Force | M::Altitude | M::Heading | M::Imu => 20,
            M::Gps => 10,
            M::Fuel => 4,
            M::Shift => 1,
            M::Co2 => co2::WINDOW,
            _ => 2,
        }
    }
}

/// Modules that are replayed together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum Group {
    Force,
    Torque,
    Brake,
    Shift,
    Fuel,
    Lateral,
    Gps,
    Altitude,
    Heading,
    Imu,
    Co2,
}

pub(crate) const GROUPS: [Group; 11] = [
    Group::Force,
    Group::Torque,
    Group::Brake,
    Group::Shift,
    Group::Fuel,
    Group::Lateral,
    Group::Gps,
    Group::Altitude,
    Group::Heading,
    Group::Imu,
    Group::Co2,
];

impl Group {
    pub(crate) fn modules(self) -> &'static [Module] {
        match self {
            Self::Force => &[M::Force],
            Self::Torque => &[M::Torque],
            Self::Brake => &[M::Brake],
            Self::Shift => &[M::Shift],
            Self::Fuel => &[M::Fuel],
            Self::Lateral => &[M::Yaw, M::TrailerYaw, M::AccelY],
            Self::Gps => &[M::Gps],
            Self::Altitude => &[M::Altitude],
            Self::Heading => &[M::Heading],
            Self::Imu => &[M::Imu],
            Self::Co2 => &[M::Co2],
        }
    }
}

/// Groups whose residuals depend on a parameter.
pub(crate) fn affects(p: P) -> &'static [Group] {
    use Group as G;
    match p {
        P::Rolling
        | P::Drag
        | P::Headwind
        | P::WarmupAmp
        | P::WarmupTau
        | P::DrivelineLoss
        | P::MeshLoss
        | P::FanPower
        | P::FanStart
        | P::DragBrake
        | P::Friction
        | P::BrakeGain
        | P::Fade
        | P::FadeStart
        | P::LiningLag
        | P::RetarderBrake
        | P::RetarderCoast
        | P::RetarderFrom
        | P::RetarderSaturation
        | P::RetarderSlope
        | P::RetarderSteep
        | P::TorqueScale
        | P::EngineBrakeScale
        | P::SpeedLag
        | P::PressureLag
        | P::StageLag
        | P::FanBand
        | P::FanWidth => &[G::Force],
        P::WindX | P::WindY | P::Crosswind | P::RetarderStage => &[G::Force, G::Lateral],
        P::Mass => &[G::Force, G::Lateral],
        P::GradeBias | P::MapShift => &[G::Force, G::Altitude, G::Imu],
        P::Altitude
        | P::AltitudeStart
        | P::HeatAir
        | P::HeatAirStart
        | P::HeatCoolant
        | P::HeatCoolantStart
        | P::HeatCoolantLag
        | P::TurboLag
        | P::TurboStart
        | P::TurboWidth
        | P::PedalDelay
        | P::PedalLag
        | P::TorqueReport => &[G::Torque],
        P::ShiftTime => &[G::Shift],
        P::FuelLow | P::FuelLowLoad | P::FuelLowOver | P::FuelScale | P::FuelLag => &[G::Fuel],
        P::FuelFlow | P::FuelFlowPower => &[G::Fuel, G::Co2],
        P::Co2Scale | P::Co2Power => &[G::Co2],
        P::BrakeDelay | P::BrakeLoad => &[G::Brake],
        P::SpeedScale => &[G::Force, G::Lateral, G::Gps, G::Altitude, G::Imu],
        P::YawBias => &[G::Lateral, G::Heading],
        P::SteerRatio
        | P::SteerOffset
        | P::FreePlay
        | P::PlayCentring
        | P::SteerLag
        | P::SteerDelay
        | P::CFront
        | P::CDrive
        | P::CTrailer
        | P::PayloadX
        | P::PayloadSpread
        | P::StiffnessFollows
        | P::StiffnessFollowsMass
        | P::WindShare
        | P::CrosswindShare
        | P::WindBehind
        | P::CrosswindBehind
        | P::SideShare
        | P::SideBehind
        | P::Bank
        | P::CurveBank
        | P::AccelYBias
        | P::AccelYAhead
        | P::TrailerYawBias => &[G::Lateral],
        P::GpsLag => &[G::Gps],
        P::ImuBias => &[G::Imu],
        P::AltitudeOffset => &[G::Altitude],
        P::HeadingOffset => &[G::Heading],
    }
}

/// The module whose output a parameter is simply added to.
pub(crate) fn offset_of(p: P) -> Option<Module> {
    match p {
        P::YawBias => Some(M::Yaw),
        P::TrailerYawBias => Some(M::TrailerYaw),
        P::AccelYBias => Some(M::AccelY),
        P::AltitudeOffset => Some(M::Altitude),
        P::HeadingOffset => Some(M::Heading),
        _ => None,
    }
}

/// Residuals of all modules of one drive; empty where a module is not available.
pub(crate) type Residuals = [Vec<f64>; MODULES];

/// Replays a group with a truck whose parameters are off by `theta` and writes its residuals.
pub(crate) fn replay_group(
    d: &Prepared,
    plant: &Plant,
    t: &Theta,
    group: Group,
    out: &mut Residuals,
) {
    debug_assert_eq!(t.len(), PARAMS);
    let t = &plant.with_instruments(t);
    if !group.modules().iter().any(|m| d.available[*m as usize]) {
        return;
    }
    match group {
        Group::Force => out[M::Force as usize] = force::residual(d, plant, t),
        Group::Torque => out[M::Torque as usize] = powertrain::torque(d, plant, t),
        Group::Brake => out[M::Brake as usize] = brake::residual(d, plant, t),
        Group::Shift => out[M::Shift as usize] = powertrain::shift(d, plant, t),
        Group::Fuel => out[M::Fuel as usize] = powertrain::fuel(d, plant, t),
        Group::Lateral => {
            let r = lateral::residuals(d, plant, t);
            for (m, r) in group.modules().iter().zip(r) {
                if d.available[*m as usize] {
                    out[*m as usize] = r;
                }
            }
        }
        Group::Gps => out[M::Gps as usize] = sensors::gps(d, t),
        Group::Altitude => out[M::Altitude as usize] = sensors::altitude(d, t),
        Group::Heading => out[M::Heading as usize] = sensors::heading(d, t),
        Group::Imu => out[M::Imu as usize] = sensors::imu(d, t),
        Group::Co2 => out[M::Co2 as usize] = co2::residual(d, plant, t),
    }
}

#[cfg(test)]
mod invariance;
#[cfg(test)]
mod relaxation;
#[cfg(test)]
pub(crate) mod tests;
