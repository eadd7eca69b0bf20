//! From the answers of a data sheet to a truck file.
//!
//! What the sheet says is taken; what it leaves out is what such trucks usually have, scaled to what
//! is known, and stated as an estimate in the file's `[provenance]`. Spreads of estimates are those
//! of the catalogue of causes where it has the figure.
//!
//! | file | what |
//! |---|---|
//! | `template.toml` | the questions |
//! | `engine` | full load, friction, fuel, engine brake |
//! | `build` | the rest, and the origin of every figure |
//!
//! Left out: trucks without a semitrailer, liftable axles, electric drives.

mod build;
mod engine;
mod figures;

use crate::DynamicsError;
use crate::bounds::Bounds;
use crate::parameters::parse;
use serde::Deserialize;

/// The questions, with the answers of an example, as a file to fill in.
pub const TEMPLATE: &str = include_str!("template.toml");

/// Answers of a data sheet.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataSheet {
    schema: u32,
    name: String,
    source: String,
    masses: Masses,
    axles: Axles,
    tyres: Tyres,
    driveline: Driveline,
    engine: Engine,
    #[serde(default)]
    air: Air,
    #[serde(default)]
    steering: Steering,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Masses {
    tractor_kg: f64,
    trailer_kg: f64,
    payload_kg: Option<f64>,
    steer_axle_load_kg: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Axles {
    drive_axles: u32,
    wheelbase_m: f64,
    drive_axle_distance_m: Option<f64>,
    fifth_wheel_ahead_m: Option<f64>,
    kingpin_to_trailer_axles_m: Option<f64>,
    trailer_axle_distance_m: Option<f64>,
    width_m: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tyres {
    drive_size: Option<String>,
    rolling_radius_m: Option<f64>,
    rolling_coeff: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Driveline {
    gear_ratios: Vec<f64>,
    final_drive_ratio: f64,
    retarder_torque_nm: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Engine {
    rated_power_kw: Option<f64>,
    rated_speed_rpm: Option<f64>,
    max_torque_nm: Option<f64>,
    max_torque_from_rpm: Option<f64>,
    max_torque_to_rpm: Option<f64>,
    full_load_speed_rpm: Option<Vec<f64>>,
    full_load_torque_nm: Option<Vec<f64>>,
    displacement_l: Option<f64>,
    idle_speed_rpm: Option<f64>,
    max_speed_rpm: Option<f64>,
    reference_torque_nm: Option<f64>,
    engine_brake_power_kw: Option<f64>,
    engine_brake_speed_rpm: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Air {
    drag_area_m2: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Steering {
    ratio: Option<f64>,
}

impl DataSheet {
    /// Parses and checks answers. `name` appears in messages.
    ///
    /// # Errors
    /// [`DynamicsError::Parse`] with line and key, or [`DynamicsError::OutOfBounds`] with everything
    /// that is missing or out of bounds.
    pub fn from_toml_str(name: &str, text: &str) -> Result<Self, DynamicsError> {
        let sheet: Self = toml::from_str(text).map_err(|e| parse(name, text, &e))?;
        let violations = sheet.violations();
        if violations.is_empty() {
            Ok(sheet)
        } else {
            Err(DynamicsError::OutOfBounds { name: name.into(), violations })
        }
    }

    /// What the truck file does not check itself: what is derived here.
    fn violations(&self) -> Vec<String> {
        let mut out = Vec::new();
        let mut b = Bounds::of("masses");
        b.within("tractor_kg", self.masses.tractor_kg, 3_000.0, 20_000.0);
        b.within("trailer_kg", self.masses.trailer_kg, 1_000.0, 40_000.0);
        b.within("payload_kg", self.masses.payload_kg.unwrap_or(0.0), 0.0, 150_000.0);
        if let Some(kg) = self.masses.steer_axle_load_kg {
            let (low, high) = (0.3 * self.masses.tractor_kg, 0.9 * self.masses.tractor_kg);
            b.within("steer_axle_load_kg", kg, low, high);
        }
        out.append(&mut b.violations);
        let mut b = Bounds::of("axles");
        b.require((1..=2).contains(&self.axles.drive_axles), {
            format!("drive_axles = {}, 1 or 2 are possible", self.axles.drive_axles)
        });
        b.within("wheelbase_m", self.axles.wheelbase_m, 2.5, 7.0);
        for (key, value, low, high) in [
            ("drive_axle_distance_m", self.axles.drive_axle_distance_m, 0.8, 2.5),
            ("fifth_wheel_ahead_m", self.axles.fifth_wheel_ahead_m, -1.0, 2.0),
            ("kingpin_to_trailer_axles_m", self.axles.kingpin_to_trailer_axles_m, 3.0, 14.0),
            ("trailer_axle_distance_m", self.axles.trailer_axle_distance_m, 0.8, 2.5),
        ] {
            if let Some(value) = value {
                b.within(key, value, low, high);
            }
        }
        out.append(&mut b.violations);
        let mut b = Bounds::of("tyres");
        match (&self.tyres.drive_size, self.tyres.rolling_radius_m) {
            (None, None) => b.require(false, "drive_size or rolling_radius_m is missing".into()),
            (Some(size), None) if figures::tyre_diameter_m(size).is_none() => {
                b.require(false, format!("drive_size = {size:?} is not of the form 315/70 R22.5"));
            }
            _ => {}
        }
        out.append(&mut b.violations);
        let gears = self.driveline.gear_ratios.len();
        if gears < 2 {
            out.push(format!("driveline.gear_ratios has {gears} gears, at least 2 are needed"));
        }
        self.engine.violations(&mut out);
        out
    }
}
