//! Units of a DBC's signals, as people write them, and the unit of a column.

use crate::Channel;

/// From a unit to the column's: `factor * value + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Conversion {
    factor: f64,
    offset: f64,
    /// To m³/s instead, for a column of fuel that is measured as a volume.
    pub(super) is_volume: bool,
}

/// Most that an engine burns, m³/s: 350 l/h.
const MOST_FUEL_M3_S: f64 = 1e-4;

impl Conversion {
    pub(super) fn of(self, value: f64) -> f64 {
        self.factor * value + self.offset
    }

    /// The same, counted the other way round.
    pub(super) fn reversed(self) -> Self {
        Self { factor: -self.factor, offset: -self.offset, ..self }
    }

    /// What the converted value can be.
    pub(super) fn plausible(self, column: Channel) -> (f64, f64) {
        if self.is_volume { (0.0, MOST_FUEL_M3_S) } else { column.plausible() }
    }
}

/// A unit and what it is of the column's.
type Unit = (&'static str, f64);

const SPEEDS: &[Unit] =
    &[("m/s", 1.0), ("km/h", 1.0 / 3.6), ("kph", 1.0 / 3.6), ("kmh", 1.0 / 3.6), ("mph", 0.447_04)];
const LENGTHS: &[Unit] = &[("m", 1.0), ("km", 1e3), ("ft", 0.3048)];
const DEG: f64 = core::f64::consts::PI / 180.0;
const ANGLES: &[Unit] = &[("rad", 1.0), ("deg", DEG), ("degree", DEG), ("degrees", DEG)];
const RATES: &[Unit] = &[("rad/s", 1.0), ("deg/s", DEG)];
const ACCELERATIONS: &[Unit] = &[("m/s2", 1.0), ("m/ss", 1.0), ("g", 9.806_65)];
const FRACTIONS: &[Unit] = &[("1", 1.0), ("%", 0.01), ("percent", 0.01)];
const PERCENTS: &[Unit] = &[("%", 1.0), ("percent", 1.0)];
const TURNS: &[Unit] = &[
    ("rpm", 1.0),
    ("1/min", 1.0),
    ("r/min", 1.0),
    ("min-1", 1.0),
    ("rad/s", 30.0 / core::f64::consts::PI),
];
const COUNTS: &[Unit] = &[("", 1.0), ("1", 1.0), ("-", 1.0), ("gear", 1.0), ("bit", 1.0)];
/// Of a kPa.
const PRESSURES: &[Unit] =
    &[("kpa", 1.0), ("pa", 1e-3), ("hpa", 0.1), ("mbar", 0.1), ("bar", 100.0), ("psi", 6.894_757)];
const MASS_RATES: &[Unit] = &[("g/s", 1.0), ("kg/h", 1.0 / 3.6), ("mg/s", 1e-3)];
/// Of a m³/s.
const FUEL_VOLUMES: &[Unit] = &[("l/h", 1e-3 / 3600.0), ("ml/s", 1e-6), ("l/s", 1e-3)];

/// The conversion from a unit to a column's.
///
/// # Errors
/// The units that are known, if it is none of them.
pub(super) fn conversion(column: Channel, unit: &str) -> Result<Conversion, String> {
    let said: String = unit.to_lowercase().chars().filter(|c| !c.is_whitespace()).collect();
    let said = said.replace('²', "2").replace('^', "").replace('°', "deg").replace("**", "");
    let scaled = |units: &[Unit], to_column: f64, is_volume: bool| {
        let found = units.iter().find(|(name, _)| *name == said);
        found.map(|(_, f)| Conversion { factor: f * to_column, offset: 0.0, is_volume })
    };
    use Channel as C;
    let (units, to_column) = match column {
        C::CoolantTempDegc | C::AmbientTempDegc => {
            let linear = |factor, offset| Ok(Conversion { factor, offset, is_volume: false });
            return match said.as_str() {
                "degc" | "c" | "celsius" => linear(1.0, 0.0),
                "k" | "degk" | "kelvin" => linear(1.0, -tractrix_core::ZERO_DEGC_K),
                "degf" | "f" => linear(5.0 / 9.0, -160.0 / 9.0),
                _ => Err("degC, K, degF".to_owned()),
            };
        }
        C::FuelRateGS => {
            let found = scaled(MASS_RATES, 1.0, false).or(scaled(FUEL_VOLUMES, 1.0, true));
            return found.ok_or_else(|| names(&[MASS_RATES, FUEL_VOLUMES].concat()));
        }
        C::Co2RateGS => (MASS_RATES, 1.0),
        C::SpeedMS | C::GpsSpeedMS => (SPEEDS, 1.0),
        C::GpsAltitudeM | C::SMapM => (LENGTHS, 1.0),
        C::HeadingRad | C::SteeringWheelRad => (ANGLES, 1.0),
        C::YawRateRadS | C::TrailerYawRateRadS => (RATES, 1.0),
        C::AccelXMS2 | C::AccelYMS2 | C::XbrDecelMS2 => (ACCELERATIONS, 1.0),
        C::AcceleratorPedalFrac | C::EngineBrakeFrac | C::GradeFrac => (FRACTIONS, 1.0),
        C::EngineTorquePercent => (PERCENTS, 1.0),
        C::EngineSpeedRpm => (TURNS, 1.0),
        C::Gear | C::ShiftInProcess => (COUNTS, 1.0),
        C::BrakePressureKpa => (PRESSURES, 1.0),
        C::BaroPressurePa => (PRESSURES, 1e3),
        C::Curvature1M => (&[("1/m", 1.0)][..], 1.0),
    };
    scaled(units, to_column, false).ok_or_else(|| names(units))
}

fn names(units: &[Unit]) -> String {
    let known: Vec<&str> =
        units.iter().map(|u| if u.0.is_empty() { "none" } else { u.0 }).collect();
    known.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_as_people_write_them() {
        let of = |column, unit: &str, value: f64| conversion(column, unit).unwrap().of(value);
        assert!((of(Channel::SpeedMS, "km/h", 90.0) - 25.0).abs() < 1e-12);
        assert!((of(Channel::SteeringWheelRad, "°", 180.0) - core::f64::consts::PI).abs() < 1e-12);
        assert!((of(Channel::AmbientTempDegc, "degF", 212.0) - 100.0).abs() < 1e-9);
        assert!((of(Channel::AccelYMS2, "m/s²", 2.0) - 2.0).abs() < 1e-12);
        assert!((of(Channel::BaroPressurePa, "bar", 1.0) - 1e5).abs() < 1e-6);
        assert!(conversion(Channel::FuelRateGS, "L/h").unwrap().is_volume);
        assert_eq!(conversion(Channel::Gear, "km/h"), Err("none, 1, -, gear, bit".to_owned()));
        let back = conversion(Channel::AmbientTempDegc, "K").unwrap().reversed();
        assert!((back.of(300.0) + 26.85).abs() < 1e-9);
    }
}
