//! What is driven: a TOML file with a road, a truck, a start, a stack, traffic and weather.

use std::path::Path;

use planner::decider::DeciderKind;
use serde::{Deserialize, Serialize};
use tractrix_core::words::{deserializer_message, nearest};

use crate::{SimError, TrafficSection};

/// Speed limit of a road under a recording, m/s (120 km/h).
const RECORDED_LIMIT_M_S: f64 = 33.33;

/// Built-in scenarios: name and text.
const BUILTIN: [(&str, &str); 19] = [
    ("highway", include_str!("../scenarios/highway.toml")),
    ("highway-sag", include_str!("../scenarios/highway-sag.toml")),
    ("highway-empty", include_str!("../scenarios/highway-empty.toml")),
    ("test-site", include_str!("../scenarios/test-site.toml")),
    ("flat", include_str!("../scenarios/flat.toml")),
    ("incident", include_str!("../scenarios/incident.toml")),
    ("rush-hour", include_str!("../scenarios/rush-hour.toml")),
    ("dense-12.5", include_str!("../scenarios/dense-12.5.toml")),
    ("dense-15", include_str!("../scenarios/dense-15.toml")),
    ("medium-12.5", include_str!("../scenarios/medium-12.5.toml")),
    ("medium-15", include_str!("../scenarios/medium-15.toml")),
    ("sparse-12.5", include_str!("../scenarios/sparse-12.5.toml")),
    ("sparse-15", include_str!("../scenarios/sparse-15.toml")),
    ("table2-dense-12.5", include_str!("../scenarios/table2-dense-12.5.toml")),
    ("table2-dense-15", include_str!("../scenarios/table2-dense-15.toml")),
    ("table2-medium-12.5", include_str!("../scenarios/table2-medium-12.5.toml")),
    ("table2-medium-15", include_str!("../scenarios/table2-medium-15.toml")),
    ("table2-sparse-12.5", include_str!("../scenarios/table2-sparse-12.5.toml")),
    ("table2-sparse-15", include_str!("../scenarios/table2-sparse-15.toml")),
];

/// A scenario. Unknown keys are refused.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Version of the format; 1.
    pub schema: u32,
    /// Name, used for the output folder.
    pub name: String,
    /// One sentence on what it is for.
    #[serde(default)]
    pub description: String,
    /// Road: `builtin:highway`, `builtin:highway-sag`, `builtin:test-site`, `builtin:flat`,
    /// or a path to `.xodr` or `.csv`.
    pub road: String,
    /// The truck.
    pub truck: TruckSection,
    /// Where and how fast the ego starts.
    #[serde(default)]
    pub ego: EgoStart,
    /// The planning stack.
    #[serde(default)]
    pub stack: planner::StackConfig,
    /// Weights of the learned decider (`stack.decider = "dqn"`): `policy.safetensors`, with its
    /// `policy.json` beside it, or `builtin:table2`, the trained one that the program brings along.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy_file: Option<String>,
    /// The other vehicles.
    #[serde(default)]
    pub traffic: TrafficSection,
    /// Wind, temperature, grip.
    #[serde(default)]
    pub weather: Weather,
    /// Tick and duration.
    #[serde(default)]
    pub run: RunLimits,
}

/// The truck and its load.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruckSection {
    /// Built-in name (`longhaul`, `reference`) or path of a truck file.
    pub file: String,
    /// Payload on the trailer, kg.
    pub payload_kg: f64,
}

/// Where and how fast the ego starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EgoStart {
    /// Station of the reference point, m.
    pub s_m: f64,
    /// Lane track; none = the rightmost driving lane at the start.
    pub lane: Option<u16>,
    /// Speed, m/s.
    pub speed_m_s: f64,
}

impl Default for EgoStart {
    fn default() -> Self {
        Self { s_m: 30.0, lane: None, speed_m_s: 20.0 }
    }
}

/// Weather along the whole road.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Weather {
    /// Wind velocity, map x, m/s (positive blows towards +x).
    pub wind_x_m_s: f64,
    /// Wind velocity, map y, m/s.
    pub wind_y_m_s: f64,
    /// Air temperature at the start of the road, K.
    pub air_temperature_k: f64,
    /// Air pressure at the start of the road, Pa; falls with altitude along it.
    pub air_pressure_pa: f64,
    /// Friction coefficient between tyre and road, dimensionless.
    pub adhesion_coeff: f64,
}

impl Default for Weather {
    fn default() -> Self {
        Self {
            wind_x_m_s: 0.0,
            wind_y_m_s: 0.0,
            air_temperature_k: 288.15,
            air_pressure_pa: 101_325.0,
            adhesion_coeff: 0.8,
        }
    }
}

/// Tick, end and seed of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RunLimits {
    /// Tick, s; the control rate.
    pub tick_s: f64,
    /// The run ends after this time, s, if the road has not ended before.
    pub duration_s: f64,
    /// The run goes on when a wheel leaves the paved lanes; it is counted all the same.
    pub allow_off_road: bool,
    /// A ghost under ordinary cruise control drives along, where the shell shows one
    /// ([`crate::World::attach_ghost`]).
    pub ghost: bool,
    /// Seed of a run that is given none.
    pub seed: u64,
}

impl Default for RunLimits {
    fn default() -> Self {
        Self { tick_s: 0.01, duration_s: 3600.0, allow_off_road: false, ghost: true, seed: 1 }
    }
}

impl Scenario {
    /// Names of the built-in scenarios.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILTIN.iter().map(|(name, _)| *name)
    }

    /// The text of a built-in scenario.
    ///
    /// # Errors
    /// [`SimError::UnknownScenario`] with the nearest names.
    pub fn builtin_text(name: &str) -> Result<&'static str, SimError> {
        BUILTIN.iter().find(|(n, _)| *n == name).map(|(_, text)| *text).ok_or_else(|| {
            SimError::UnknownScenario {
                name: name.to_owned(),
                nearest: nearest(name, Self::names()).join(", "),
            }
        })
    }

    /// A built-in scenario.
    ///
    /// # Errors
    /// As [`Self::builtin_text`].
    pub fn builtin(name: &str) -> Result<Self, SimError> {
        Self::from_toml_str(name, Self::builtin_text(name)?)
    }

    /// A scenario file if the name ends in `.toml` or has a folder, else a built-in scenario.
    ///
    /// # Errors
    /// As [`Self::load`] or [`Self::builtin`].
    pub fn named(name: &str) -> Result<Self, SimError> {
        if name.ends_with(".toml") || name.contains(std::path::MAIN_SEPARATOR) {
            Self::load(name.as_ref())
        } else {
            Self::builtin(name)
        }
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// [`SimError::Io`] or, as [`Self::from_toml_str`], [`SimError::Scenario`].
    pub fn load(path: &Path) -> Result<Self, SimError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| SimError::Io { path: path.to_owned(), source })?;
        let mut scenario = Self::from_toml_str(&path.display().to_string(), &text)?;
        if let Some(folder) = path.parent() {
            scenario.resolve_paths(folder);
        }
        Ok(scenario)
    }

    /// Parses and checks a scenario. `name` appears in messages.
    ///
    /// # Errors
    /// [`SimError::Scenario`] names the key, and all values out of range at once.
    pub fn from_toml_str(name: &str, text: &str) -> Result<Self, SimError> {
        let bad = |why: String| SimError::Scenario { name: name.to_owned(), why };
        let scenario: Self = toml::from_str(text).map_err(|e| {
            let place = e.span().map_or(String::new(), |span| {
                let end = text.len().min(span.start);
                format!("line {}: ", text[..end].matches('\n').count() + 1)
            });
            bad(format!("{place}{}", deserializer_message(e.message())))
        })?;
        scenario.checked().map_err(bad)?;
        Ok(scenario)
    }

    /// Checks a scenario that was changed or made in memory.
    ///
    /// # Errors
    /// [`SimError::Scenario`] names all values out of range at once.
    pub fn check(&self) -> Result<(), SimError> {
        self.checked().map_err(|why| SimError::Scenario { name: self.name.clone(), why })
    }

    fn checked(&self) -> Result<(), String> {
        let wrong = self.violations();
        if wrong.is_empty() { Ok(()) } else { Err(wrong.join("; ")) }
    }

    /// The seed of a run: the one given, else the one of the manifest that is repeated, else the
    /// scenario's own.
    ///
    /// # Errors
    /// As [`crate::read_manifest`].
    pub fn seed(&self, given: Option<u64>) -> Result<u64, SimError> {
        match (given, &self.traffic.manifest) {
            (Some(seed), _) => Ok(seed),
            (None, Some(file)) => crate::read_manifest(file.as_ref()).map(|m| m.seed),
            (None, None) => Ok(self.run.seed),
        }
    }

    /// The road that the scenario names; `recording:LANES` lays one with that many lanes under the
    /// scenario's recording.
    ///
    /// # Errors
    /// [`SimError`] names the road or recording that cannot be used.
    pub fn load_road(&self) -> Result<road::Road, SimError> {
        let Some(lanes) = self.road.strip_prefix("recording:") else {
            return Ok(road::Road::load(&self.road)?);
        };
        let lanes = lanes.parse().map_err(|_| SimError::Scenario {
            name: self.name.clone(),
            why: format!("road = {:?}: the number of lanes is missing", self.road),
        })?;
        if self.traffic.replay.file.is_none() {
            let why = format!("road = {:?} needs a recording: traffic.replay.file", self.road);
            return Err(SimError::Scenario { name: self.name.clone(), why });
        }
        let recording = crate::traffic::recording_of(self)?;
        traffic_client::replay::road_of(&recording, lanes, RECORDED_LIMIT_M_S)
            .map_err(|e| traffic_client::TrafficError::from(e).into())
    }

    /// Files named by a scenario lie beside it unless their path is absolute.
    fn resolve_paths(&mut self, folder: &Path) {
        for file in [&mut self.road, &mut self.truck.file] {
            if file.ends_with(".xodr") || file.ends_with(".csv") || file.ends_with(".toml") {
                *file = folder.join(&*file).display().to_string();
            }
        }
        if let Some(file) = &mut self.policy_file
            && file != crate::world::BUILTIN_POLICY
        {
            *file = folder.join(&*file).display().to_string();
        }
        self.traffic.resolve_paths(folder);
    }

    /// Everything that cannot be, each with its key; empty for a sound scenario. Whoever changes a
    /// scenario after reading it asks again.
    #[must_use]
    pub fn violations(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        if self.schema != 1 {
            wrong.push(format!("schema = {}, this program reads 1", self.schema));
        }
        for (key, value, low, high) in [
            ("truck.payload_kg", self.truck.payload_kg, 0.0, 100_000.0),
            ("ego.s_m", self.ego.s_m, 0.0, 1e7),
            ("ego.speed_m_s", self.ego.speed_m_s, 0.0, 40.0),
            ("weather.wind_x_m_s", self.weather.wind_x_m_s, -60.0, 60.0),
            ("weather.wind_y_m_s", self.weather.wind_y_m_s, -60.0, 60.0),
            ("weather.air_temperature_k", self.weather.air_temperature_k, 200.0, 340.0),
            ("weather.air_pressure_pa", self.weather.air_pressure_pa, 40_000.0, 110_000.0),
            ("weather.adhesion_coeff", self.weather.adhesion_coeff, 0.05, 1.5),
            ("run.tick_s", self.run.tick_s, 0.001, 0.1),
            ("run.duration_s", self.run.duration_s, 0.0, 1e6),
        ] {
            if !(value >= low && value <= high) {
                wrong.push(format!("{key} = {value} is outside {low} to {high}"));
            }
        }
        if (self.stack.decider == DeciderKind::Dqn) != self.policy_file.is_some() {
            wrong.push("policy_file and stack.decider = \"dqn\" need each other".to_owned());
        }
        wrong.extend(self.traffic.violations());
        wrong
    }
}
