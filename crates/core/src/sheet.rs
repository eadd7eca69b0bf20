//! A truck's limits as a file: what an on-truck program plans with, without the plant's model.
//!
//! TOML with one table a group of [`VehicleLimits`]; keys carry their units, and a map is a table of
//! its axes and values. A sheet says everything: no key may miss but the two maps that a truck can
//! be without.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use toml::{Table, Value};

use crate::words::{deserializer_message, nearest};
use crate::{
    BrakeLimits, CoreError, Curve, FuelModel, Geometry, Grid, LateralLimits, LowLoadFuel,
    PowertrainLimits, RoadLoad, VehicleLimits,
};

/// Keys that a sheet may leave out.
const OPTIONAL: [&str; 2] = ["powertrain.retarder_force_n", "powertrain.pedal_map_nm"];
/// The key that makes a file a truck file.
const TRUCK_FILE: &str = "schema";

const HEADER: &str = "\
# What may be known of a truck by those who plan for it. Units are in the keys.
# Maps over engine speed: x in rad/s. retarder_force_n: x is road speed, m/s.
# pedal_map_nm: x is the pedal, 0 to 1, y the engine speed, rad/s; z row by row.
# fuel.Map.flow_g_s: x is engine speed, rad/s, y brake torque, Nm; z row by row.

";

impl VehicleLimits {
    /// The sheet of these limits.
    ///
    /// # Errors
    /// [`CoreError::Sheet`] if they cannot be planned with.
    pub fn to_sheet(&self) -> Result<String, CoreError> {
        let refuse = |wrong: Vec<String>| CoreError::Sheet { file: "sheet".into(), wrong };
        let wrong: Vec<String> = self.violations().iter().map(ToString::to_string).collect();
        if !wrong.is_empty() {
            return Err(refuse(wrong));
        }
        let body = toml::to_string(self).map_err(|e| refuse(alloc::vec![e.to_string()]))?;
        Ok(format!("{HEADER}{body}"))
    }

    /// Limits from the text of a sheet.
    ///
    /// # Errors
    /// [`CoreError::Sheet`] names the file and, at once, every key that is unknown, missing or of
    /// another kind and every map that is none; in a sheet without those, every value outside its
    /// range ([`Self::check`]).
    pub fn from_sheet(file: &str, text: &str) -> Result<Self, CoreError> {
        let refuse = |wrong: Vec<String>| CoreError::Sheet { file: file.into(), wrong };
        let message = |e: toml::de::Error| alloc::vec![deserializer_message(&e.to_string())];
        let sheet: Table = text.parse().map_err(|e| refuse(message(e)))?;
        if sheet.contains_key(TRUCK_FILE) {
            let make = "it is a truck file; make a sheet of it with `sim-server truck sheet \
                        TRUCK.toml --payload-kg M --out SHEET.toml`";
            return Err(refuse(alloc::vec![make.to_string()]));
        }
        let mut wrong = Vec::new();
        let with_map = matches!(sheet.get("powertrain").and_then(|p| p.get("fuel")),
            Some(Value::Table(fuel)) if fuel.contains_key("Map"));
        let shape =
            Table::try_from(shape(with_map)).map_err(|e| refuse(alloc::vec![e.to_string()]))?;
        compare("", &shape, &sheet, &mut wrong);
        if !wrong.is_empty() {
            return Err(refuse(wrong));
        }
        let limits: Self = Value::Table(sheet).try_into().map_err(|e| refuse(message(e)))?;
        let wrong: Vec<String> = limits.violations().iter().map(ToString::to_string).collect();
        if wrong.is_empty() { Ok(limits) } else { Err(refuse(wrong)) }
    }
}

/// Limits with every key that a sheet can have; the values mean nothing.
fn shape(with_map: bool) -> VehicleLimits {
    let curve = || Curve::constant(0.0);
    let grid = || Grid::constant(0.0);
    let low_load = LowLoadFuel::default();
    let fuel = if with_map {
        FuelModel::Map { flow_g_s: grid(), friction_nm: curve(), low_load }
    } else {
        FuelModel::Willans { constant_g_s: 0.0, per_rpm_g_s: 0.0, per_kw_g_s: 0.0, low_load }
    };
    VehicleLimits {
        geometry: Geometry::default(),
        powertrain: PowertrainLimits {
            gear_ratios: Vec::new(),
            gear_efficiency_frac: Vec::new(),
            rotating_mass_kg: Vec::new(),
            rotating_mass_neutral_kg: 0.0,
            final_drive_ratio: 0.0,
            wheel_radius_m: 0.0,
            full_load_nm: curve(),
            friction_nm: curve(),
            engine_brake_nm: curve(),
            retarder_force_n: Some(curve()),
            auxiliary_power_w: 0.0,
            idle_speed_rad_s: 0.0,
            max_speed_rad_s: 0.0,
            lugging_speed_rad_s: 0.0,
            fuel,
            idle_fuel_g_s: 0.0,
            shift_duration_s: 0.0,
            pedal_map_nm: Some(grid()),
            fuel_density_kg_m3: 0.0,
        },
        road_load: RoadLoad::default(),
        brakes: BrakeLimits::default(),
        lateral: LateralLimits::default(),
    }
}

/// Notes what a table of a sheet has too much, lacks or has of another kind.
fn compare(path: &str, shape: &Table, sheet: &Table, wrong: &mut Vec<String>) {
    let before = wrong.len();
    let inside = |key: &str| if path.is_empty() { key.into() } else { format!("{path}.{key}") };
    for key in sheet.keys().filter(|key| !shape.contains_key(*key)) {
        let near = nearest(key, shape.keys().map(String::as_str)).join(", ");
        wrong.push(format!("unknown key {:?}; the nearest are {near}", inside(key)));
    }
    for (key, kind) in shape {
        let name: String = inside(key);
        match (kind, sheet.get(key)) {
            (Value::Table(kind), Some(Value::Table(table))) => compare(&name, kind, table, wrong),
            (Value::Array(_), Some(Value::Array(items))) => {
                if let Some(odd) = items.iter().find(|item| number(item).is_none()) {
                    wrong.push(format!("{name} holds a {}, not numbers alone", odd.type_str()));
                }
            }
            (Value::Float(_), Some(value)) if number(value).is_some() => {}
            (_, None) if OPTIONAL.contains(&name.as_str()) => {}
            (_, None) => wrong.push(format!("{name} is missing")),
            (kind, Some(other)) => {
                let (is, wants) = (other.type_str(), kind.type_str());
                wrong.push(format!("{name} is of kind {is}, not {wants}"));
            }
        }
    }
    if wrong.len() == before {
        let axis = |key| numbers(sheet.get(key)?);
        let table = match (axis("x"), axis("y"), axis("z")) {
            (Some(x), Some(y), Some(z)) => Grid::new(path, x, y, z).err(),
            (Some(x), Some(y), None) => Curve::new(path, x, y).err(),
            _ => None,
        };
        wrong.extend(table.map(|e| e.to_string()));
    }
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(number).collect()
}
