//! Truck files: everything that says which truck this is.
//!
//! A truck file is TOML with one block per effect; unknown keys are refused, every numeric key
//! ends in its unit, every block names its source. An overlay names a base and parameters to
//! replace by dotted path, with the uncertainty and origin of each: that is what diagnosis writes.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use tractrix_core::words::{deserializer_message, nearest};

use crate::DynamicsError;
use crate::bounds::Bounds;
use crate::effects::brake::BrakeParameters;
use crate::effects::cooling::CoolingParameters;
use crate::effects::driveline::DrivelineParameters;
use crate::effects::engine::EngineParameters;
use crate::effects::instruments::InstrumentParameters;
use crate::effects::resistance::ResistanceParameters;
use crate::effects::shift::ShiftParameters;
use crate::effects::table::TableEffect;
use crate::lateral::LateralParameters;
use crate::provenance::{self, FigureOrigin, KnownBy, Provenance};

const BUILTIN: [(&str, &str); 5] = [
    ("longhaul", include_str!("../trucks/longhaul.toml")),
    ("sinotruk", include_str!("../trucks/sinotruk.toml")),
    ("reference", include_str!("../trucks/reference.toml")),
    ("vecto-40t", include_str!("../trucks/vecto-40t.toml")),
    ("iits", include_str!("../trucks/iits.toml")),
];

/// A truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruckParameters {
    /// Version of the format; 1.
    pub schema: u32,
    /// Name.
    pub name: String,
    /// Where the masses and lengths come from.
    pub source: String,
    /// Outline of the bodies.
    pub body: BodyParameters,
    /// Engine.
    pub engine: EngineParameters,
    /// Clutch, gearbox, axle, wheels, retarder.
    pub driveline: DrivelineParameters,
    /// Shift schedule and interruption.
    pub shift: ShiftParameters,
    /// Service brakes.
    pub brake: BrakeParameters,
    /// Coolant; without it the retarder never tires.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cooling: Option<CoolingParameters>,
    /// Rolling and air resistance.
    pub resistance: ResistanceParameters,
    /// Masses, lengths, tyres, steering.
    pub lateral: LateralParameters,
    /// Faults of the instruments.
    #[serde(default)]
    pub instruments: InstrumentParameters,
    /// Fitted tables for what no effect explains.
    #[serde(default, rename = "table_effect", skip_serializing_if = "Vec::is_empty")]
    pub table_effects: Vec<TableEffect>,
    /// Where single figures come from.
    #[serde(default, skip_serializing_if = "Provenance::is_empty")]
    pub provenance: Provenance,
}

/// Outline of the bodies, for gaps, lanes and pictures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyParameters {
    /// Front bumper ahead of the steer axle, m.
    pub front_overhang_m: f64,
    /// Tractor frame behind the drive-axle group, m.
    pub tractor_rear_overhang_m: f64,
    /// Trailer front ahead of the hitch, m.
    pub trailer_front_m: f64,
    /// Trailer rear behind the hitch, m.
    pub trailer_rear_m: f64,
    /// Width, m.
    pub width_m: f64,
}

/// An overlay on a truck file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Overlay {
    /// Version of the format; 1.
    pub schema: u32,
    /// Built-in name or path of the truck that this changes.
    pub base: String,
    /// Name of the result.
    pub name: String,
    /// What is replaced, by dotted path, e.g. `resistance.rolling_coeff`.
    pub set: BTreeMap<String, OverlayValue>,
    /// Fitted tables that come on top.
    #[serde(default, rename = "table_effect", skip_serializing_if = "Vec::is_empty")]
    pub table_effects: Vec<TableEffect>,
}

/// One replaced parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OverlayValue {
    /// The new value, in the unit of the path's last key.
    pub value: f64,
    /// Standard deviation of the value, same unit; goes into the truck's `[provenance]`.
    #[serde(default)]
    pub sigma: Option<f64>,
    /// Lowest and highest value considered.
    #[serde(default)]
    pub bounds: Option<[f64; 2]>,
    /// Where the value comes from.
    pub source: String,
}

impl TruckParameters {
    /// Names of the built-in trucks.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// A built-in truck by name, or a truck or overlay file by path.
    ///
    /// # Errors
    /// [`DynamicsError`] names the file, key and value.
    pub fn load(name_or_path: &str) -> Result<Self, DynamicsError> {
        Self::load_nested(name_or_path, 0)
    }

    fn load_nested(name_or_path: &str, depth: u32) -> Result<Self, DynamicsError> {
        if let Some((name, text)) = BUILTIN.iter().find(|(n, _)| *n == name_or_path) {
            return Self::from_toml_str(name, text);
        }
        let path = Path::new(name_or_path);
        if !name_or_path.ends_with(".toml") {
            return Err(DynamicsError::UnknownTruck {
                name: name_or_path.into(),
                known: Self::names().collect::<Vec<_>>().join(", "),
            });
        }
        let text = std::fs::read_to_string(path)
            .map_err(|e| DynamicsError::Io { path: name_or_path.into(), why: e.to_string() })?;
        let table: toml::Table =
            toml::from_str(&text).map_err(|e| parse(name_or_path, &text, &e))?;
        if !table.contains_key("base") {
            return Self::from_toml_str(name_or_path, &text);
        }
        let overlay: Overlay = toml::from_str(&text).map_err(|e| parse(name_or_path, &text, &e))?;
        if depth > 8 {
            return Err(DynamicsError::Parse {
                name: name_or_path.into(),
                why: "overlays nest more than 8 deep".into(),
            });
        }
        let beside = path.parent().map(|p| p.join(&overlay.base));
        let base = match beside {
            Some(file) if file.is_file() => file.display().to_string(),
            _ => overlay.base.clone(),
        };
        Self::load_nested(&base, depth + 1)?.with_overlay(&overlay)
    }

    /// Parses and checks a truck file. `name` appears in messages.
    ///
    /// # Errors
    /// [`DynamicsError::Parse`] with line and key, or [`DynamicsError::OutOfBounds`] with every
    /// violated bound.
    pub fn from_toml_str(name: &str, text: &str) -> Result<Self, DynamicsError> {
        let truck: Self = toml::from_str(text).map_err(|e| parse(name, text, &e))?;
        truck.checked(name)
    }

    /// This truck with an overlay's values.
    ///
    /// # Errors
    /// [`DynamicsError::UnknownParameter`] or [`DynamicsError::OutOfBounds`].
    pub fn with_overlay(&self, overlay: &Overlay) -> Result<Self, DynamicsError> {
        let mut truck = self.clone();
        for (path, new) in &overlay.set {
            truck.provenance.remove(path);
            if new.sigma.is_some() {
                let origin = FigureOrigin {
                    known_by: KnownBy::Estimate,
                    sigma: new.sigma,
                    interval_90: None,
                    source: new.source.clone(),
                };
                truck.provenance.insert(path.clone(), origin);
            }
            truck = truck.with_parameter(path, new.value).map_err(|e| match e {
                DynamicsError::UnknownParameter { path, nearest, .. } => {
                    DynamicsError::UnknownParameter { name: overlay.name.clone(), path, nearest }
                }
                other => other,
            })?;
        }
        truck.table_effects.extend(overlay.table_effects.iter().cloned());
        truck.name.clone_from(&overlay.name);
        truck.checked(&overlay.name)
    }

    /// This truck with one number replaced, by dotted path; `[i]` picks from a list.
    ///
    /// # Errors
    /// [`DynamicsError::UnknownParameter`] if the path names no number.
    pub fn with_parameter(&self, path: &str, value: f64) -> Result<Self, DynamicsError> {
        let unknown = || self.unknown_parameter(&self.name, path);
        let mut root = toml::Value::try_from(self).map_err(|_| unknown())?;
        *number_at(&mut root, path).ok_or_else(unknown)? = toml::Value::Float(value);
        // Through text, which has every bit: to read values too, all parameters would be compiled for
        // a second deserialiser.
        let text = toml::to_string(&root).map_err(|_| unknown())?;
        toml::from_str(&text).map_err(|_| unknown())
    }

    /// The error of a path that names no number, with the nearest that do.
    pub(crate) fn unknown_parameter(&self, name: &str, path: &str) -> DynamicsError {
        let mut paths = Vec::new();
        if let Ok(root) = toml::Value::try_from(self) {
            number_paths(&root, String::new(), &mut paths);
        }
        let nearest = nearest(path, paths.iter().map(String::as_str)).join(", ");
        DynamicsError::UnknownParameter { name: name.into(), path: path.into(), nearest }
    }

    /// One number by dotted path.
    #[must_use]
    pub fn parameter(&self, path: &str) -> Option<f64> {
        let mut root = toml::Value::try_from(self).ok()?;
        match number_at(&mut root, path)? {
            toml::Value::Float(v) => Some(*v),
            toml::Value::Integer(v) => Some(*v as f64),
            _ => None,
        }
    }

    fn checked(self, name: &str) -> Result<Self, DynamicsError> {
        let mut violations = Vec::new();
        if self.schema != 1 {
            violations.push(format!("schema = {}, this program reads 1", self.schema));
        }
        let mut b = Bounds::of("body");
        b.within("front_overhang_m", self.body.front_overhang_m, 0.0, 5.0);
        b.within("tractor_rear_overhang_m", self.body.tractor_rear_overhang_m, 0.0, 5.0);
        b.within("trailer_front_m", self.body.trailer_front_m, 0.0, 5.0);
        b.within("trailer_rear_m", self.body.trailer_rear_m, 1.0, 25.0);
        b.within("width_m", self.body.width_m, 1.5, 4.0);
        violations.extend(b.violations);
        violations.extend(self.instruments.violations());
        violations.extend(self.engine.violations());
        violations.extend(self.driveline.violations());
        violations.extend(self.shift.violations(self.driveline.gear_ratios.len()));
        violations.extend(self.brake.violations());
        violations.extend(self.cooling.iter().flat_map(CoolingParameters::violations));
        violations.extend(self.resistance.violations());
        violations.extend(self.table_effects.iter().flat_map(TableEffect::violations));
        if !self.provenance.is_empty() {
            let root = toml::Value::try_from(&self).ok();
            let names = |path: &str| root.as_ref().is_some_and(|r| is_figure(r, path));
            violations.extend(provenance::violations(&self.provenance, names));
        }
        violations.extend(self.lateral.violations().into_iter().map(|v| format!("lateral.{v}")));
        if violations.is_empty() {
            Ok(self)
        } else {
            Err(DynamicsError::OutOfBounds { name: name.into(), violations })
        }
    }
}

/// The number at a dotted path of a TOML value.
fn number_at<'a>(root: &'a mut toml::Value, path: &str) -> Option<&'a mut toml::Value> {
    let mut at = root;
    for key in path.split('.') {
        let (name, index) = match key.split_once('[') {
            Some((name, rest)) => (name, Some(rest.strip_suffix(']')?.parse::<usize>().ok()?)),
            None => (key, None),
        };
        at = at.as_table_mut()?.get_mut(name)?;
        if let Some(i) = index {
            at = at.as_array_mut()?.get_mut(i)?;
        }
    }
    (at.is_float() || at.is_integer()).then_some(at)
}

/// Whether a dotted path of a TOML value names a number or a list.
fn is_figure(root: &toml::Value, path: &str) -> bool {
    let (list, index) = match path.strip_suffix(']').and_then(|p| p.split_once('[')) {
        Some((list, index)) => (list, index.parse::<usize>().ok()),
        None => (path, None),
    };
    let at = list.split('.').try_fold(root, |at, key| at.as_table()?.get(key));
    match (at, list == path, index) {
        (Some(at), true, _) => at.is_float() || at.is_integer() || at.is_array(),
        (Some(at), false, Some(i)) => at.as_array().is_some_and(|a| i < a.len()),
        _ => false,
    }
}

/// The dotted paths of all numbers of a TOML value.
fn number_paths(at: &toml::Value, path: String, out: &mut Vec<String>) {
    match at {
        toml::Value::Float(_) | toml::Value::Integer(_) => out.push(path),
        toml::Value::Table(table) => {
            let dot = if path.is_empty() { "" } else { "." };
            for (key, value) in table.iter().filter(|(key, _)| *key != "provenance") {
                number_paths(value, format!("{path}{dot}{key}"), out);
            }
        }
        toml::Value::Array(list) => {
            for (i, value) in list.iter().enumerate() {
                number_paths(value, format!("{path}[{i}]"), out);
            }
        }
        _ => {}
    }
}

/// What a TOML reader says, with the line.
pub(crate) fn parse(name: &str, text: &str, e: &toml::de::Error) -> DynamicsError {
    let place = e.span().map_or(String::new(), |span| {
        let end = span.start.min(text.len());
        format!("line {}: ", text[..end].matches('\n').count() + 1)
    });
    DynamicsError::Parse {
        name: name.into(),
        why: format!("{place}{}", deserializer_message(e.message())),
    }
}
