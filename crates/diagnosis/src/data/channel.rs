//! The columns of a measured drive: name, unit by name, plausible range.

/// A measured channel. The names are those of the drive table; the sign convention is positive
/// left, uphill, forward, counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
#[allow(missing_docs, reason = "the variant is the column of the same name, with its unit")]
pub enum Channel {
    SMapM,
    SpeedMS,
    GpsSpeedMS,
    GpsAltitudeM,
    HeadingRad,
    AccelXMS2,
    AcceleratorPedalFrac,
    EngineTorquePercent,
    EngineSpeedRpm,
    Gear,
    ShiftInProcess,
    EngineBrakeFrac,
    XbrDecelMS2,
    BrakePressureKpa,
    SteeringWheelRad,
    YawRateRadS,
    TrailerYawRateRadS,
    AccelYMS2,
    FuelRateGS,
    CoolantTempDegc,
    AmbientTempDegc,
    BaroPressurePa,
    GradeFrac,
    Curvature1M,
    Co2RateGS,
}

/// Number of channels.
pub(crate) const CHANNELS: usize = 25;

struct Spec(Channel, &'static str, f64, f64);

use Channel as C;

/// Plausible ranges: outside them a value is an instrument's or a unit's error for any highway
/// truck (speed below 45 m/s, grade below 25 %, hand wheel below three turns, ...).
const SPECS: [Spec; CHANNELS] = [
    Spec(C::SMapM, "s_map_m", -1e5, 1e7),
    Spec(C::SpeedMS, "speed_m_s", -1.0, 60.0),
    Spec(C::GpsSpeedMS, "gps_speed_m_s", -1.0, 60.0),
    Spec(C::GpsAltitudeM, "gps_altitude_m", -500.0, 6000.0),
    Spec(C::HeadingRad, "heading_rad", -1e3, 1e3),
    Spec(C::AccelXMS2, "accel_x_m_s2", -20.0, 20.0),
    Spec(C::AcceleratorPedalFrac, "accelerator_pedal_frac", -0.01, 1.01),
    Spec(C::EngineTorquePercent, "engine_torque_percent", -126.0, 130.0),
    Spec(C::EngineSpeedRpm, "engine_speed_rpm", 0.0, 8500.0),
    Spec(C::Gear, "gear", -4.0, 24.0),
    Spec(C::ShiftInProcess, "shift_in_process", 0.0, 1.0),
    Spec(C::EngineBrakeFrac, "engine_brake_frac", -0.01, 1.01),
    Spec(C::XbrDecelMS2, "xbr_decel_m_s2", -16.0, 16.0),
    Spec(C::BrakePressureKpa, "brake_pressure_kpa", -5.0, 1300.0),
    Spec(C::SteeringWheelRad, "steering_wheel_rad", -32.0, 32.0),
    Spec(C::YawRateRadS, "yaw_rate_rad_s", -4.0, 4.0),
    Spec(C::TrailerYawRateRadS, "trailer_yaw_rate_rad_s", -4.0, 4.0),
    Spec(C::AccelYMS2, "accel_y_m_s2", -16.0, 16.0),
    Spec(C::FuelRateGS, "fuel_rate_g_s", -0.1, 80.0),
    Spec(C::CoolantTempDegc, "coolant_temp_degc", -50.0, 160.0),
    Spec(C::AmbientTempDegc, "ambient_temp_degc", -60.0, 60.0),
    Spec(C::BaroPressurePa, "baro_pressure_pa", 40_000.0, 110_000.0),
    Spec(C::GradeFrac, "grade_frac", -0.25, 0.25),
    Spec(C::Curvature1M, "curvature_1_m", -0.5, 0.5),
    Spec(C::Co2RateGS, "co2_rate_g_s", -1.0, 250.0),
];

impl Channel {
    /// All channels in table order.
    pub fn all() -> impl Iterator<Item = Self> {
        SPECS.iter().map(|s| s.0)
    }

    /// Channels that a truck's own logger has: all but those of a laboratory on board.
    pub fn on_board() -> impl Iterator<Item = Self> {
        Self::all().filter(|c| *c != C::Co2RateGS)
    }

    /// Column name, with its unit.
    #[must_use]
    pub fn name(self) -> &'static str {
        SPECS[self as usize].1
    }

    /// The channel of a column name.
    #[must_use]
    pub fn of(name: &str) -> Option<Self> {
        SPECS.iter().find(|s| s.1 == name).map(|s| s.0)
    }

    /// Plausible range in the channel's unit, inclusive.
    #[must_use]
    pub fn plausible(self) -> (f64, f64) {
        let s = &SPECS[self as usize];
        (s.2, s.3)
    }

    /// Channels that hold states rather than continuous quantities: never interpolated.
    #[must_use]
    pub fn is_discrete(self) -> bool {
        matches!(self, C::Gear | C::ShiftInProcess)
    }

    /// Channels that may rest for minutes on a healthy truck (held at zero, or slow).
    pub(crate) fn may_rest(self) -> bool {
        !matches!(
            self,
            C::SpeedMS
                | C::GpsSpeedMS
                | C::AccelXMS2
                | C::AccelYMS2
                | C::YawRateRadS
                | C::TrailerYawRateRadS
                | C::EngineSpeedRpm
                | C::SMapM
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_is_found_by_its_own_name_at_its_own_place() {
        for (i, c) in Channel::all().enumerate() {
            assert_eq!(c as usize, i);
            assert_eq!(Channel::of(c.name()), Some(c));
            assert!(c.plausible().0 < c.plausible().1);
        }
    }
}
