//! A fitted table: an acceleration that follows one signal and that no physical effect explains.
//!
//! This is what a diagnosis may add where it finds that something is there but not what: it
//! reproduces the drives that it was fitted to and claims no cause. Outside its signal's range the
//! table keeps its end value; at walking pace it fades out, because the fit does not see it there.

use serde::de::IntoDeserializer;
use serde::de::value::StrDeserializer;
use serde::{Deserialize, Serialize};
use tractrix_core::{CoreError, Curve};

use crate::bounds::Bounds;

/// Speed below which a table fades out, m/s: the balance of a diagnosis begins there.
const FADE_M_S: f64 = 3.0;

/// Signals that a table may follow, named like the columns of a measured drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the variant is the signal of the same name, with its unit")]
pub enum TableSignal {
    #[serde(rename = "engine_speed_rpm")]
    EngineSpeedRpm,
    #[serde(rename = "speed_m_s")]
    SpeedMS,
    /// Magnitude.
    #[serde(rename = "curvature_1_m")]
    Curvature1M,
    #[serde(rename = "grade_frac")]
    GradeFrac,
    #[serde(rename = "ambient_temp_degc")]
    AmbientTempDegc,
    #[serde(rename = "coolant_temp_degc")]
    CoolantTempDegc,
    #[serde(rename = "accelerator_pedal_frac")]
    AcceleratorPedalFrac,
    #[serde(rename = "brake_pressure_kpa")]
    BrakePressureKpa,
    #[serde(rename = "gps_altitude_m")]
    GpsAltitudeM,
    #[serde(rename = "gear")]
    Gear,
    #[serde(rename = "engine_torque_percent")]
    EngineTorquePercent,
    #[serde(rename = "engine_brake_frac")]
    EngineBrakeFrac,
    #[serde(rename = "xbr_decel_m_s2")]
    XbrDecelMS2,
    #[serde(rename = "yaw_rate_rad_s")]
    YawRateRadS,
    #[serde(rename = "accel_y_m_s2")]
    AccelYMS2,
    #[serde(rename = "steering_wheel_rad")]
    SteeringWheelRad,
}

impl TableSignal {
    /// The signal of a column name; `None` where the truck has no such state (time, position).
    #[must_use]
    pub fn of(name: &str) -> Option<Self> {
        let name: StrDeserializer<'_, serde::de::value::Error> = name.into_deserializer();
        Self::deserialize(name).ok()
    }
}

/// A table effect of a truck file: `[[table_effect]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableEffect {
    /// Where it comes from.
    pub source: String,
    /// What it follows.
    pub signal: TableSignal,
    /// The signal, in its unit, increasing.
    pub signal_values: Vec<f64>,
    /// Acceleration of the truck on top of the modelled one, m/s², positive forward.
    pub accel_m_s2: Vec<f64>,
}

impl TableEffect {
    pub(crate) fn violations(&self) -> Vec<String> {
        let mut b = Bounds::of("table_effect");
        b.curve("accel_m_s2", &self.signal_values, &self.accel_m_s2);
        for a in &self.accel_m_s2 {
            b.within("accel_m_s2", *a, -2.0, 2.0);
        }
        b.require(
            self.signal_values.len() <= 1000,
            format!("signal_values has {} entries, at most 1000", self.signal_values.len()),
        );
        b.violations
    }

    /// Acceleration over the signal.
    ///
    /// # Errors
    /// [`CoreError::BadTable`] if the values make no table.
    pub fn curve(&self) -> Result<(TableSignal, Curve), CoreError> {
        let curve = Curve::new("accel_m_s2", self.signal_values.clone(), self.accel_m_s2.clone())?;
        Ok((self.signal, curve))
    }
}

/// Sum of tables, m/s², at the signals that `read` gives.
pub fn accel_m_s2(
    tables: &[(TableSignal, Curve)],
    speed_m_s: f64,
    read: impl Fn(TableSignal) -> f64,
) -> f64 {
    let fade = (speed_m_s / FADE_M_S).clamp(0.0, 1.0);
    tables.iter().map(|(signal, curve)| fade * curve.at(read(*signal))).sum()
}
