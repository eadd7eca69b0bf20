//! What a scenario says about the other vehicles: engine, mode, demand, sensors.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use traffic_client::native::{Density, TrafficConfig};
use traffic_client::replay::{Carriageway, ReplayConfig};
use traffic_client::schedule::{DemandStep, EmergencyVehicle, Incident, Schedule, detectors};
use traffic_client::sumo::{SumoConfig, Timeouts, TypeAttributes};
use traffic_client::{Mode, PerceptionConfig, TrafficError};

/// Which traffic, and its figures.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrafficSection {
    /// The source: `native`, `sumo`, `replay` or `none`.
    pub source: TrafficKind,
    /// `pure`, `inter`, `re`, `rep`; none: `rep` for recorded traffic, `inter` for the others.
    pub mode: Option<Mode>,
    /// The manifest of the run that mode `re` repeats.
    pub manifest: Option<String>,
    /// What happens when the source fails in the middle of a run.
    pub on_failure: OnFailure,
    /// One of the paper's scenario families, in place of the demand under `native`.
    pub family: Option<Family>,
    /// Demand and drivers, of the native engine and of SUMO.
    pub native: TrafficConfig,
    /// Demand that changes, in order of its times.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub demand: Vec<DemandStep>,
    /// Demand from detectors: a table of counts (CSV), lane by lane.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detectors: Option<String>,
    /// Vehicles that stop, lanes that are closed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub incident: Vec<Incident>,
    /// Vehicles with right of way.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub emergency_vehicle: Vec<EmergencyVehicle>,
    /// SUMO.
    pub sumo: SumoSection,
    /// The recording.
    pub replay: ReplaySection,
    /// Sensors between the traffic and the stack; off by default.
    pub perception: PerceptionConfig,
}

/// A traffic source by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrafficKind {
    /// The native IDM+MOBIL engine.
    #[default]
    Native,
    /// SUMO, a separate program.
    Sumo,
    /// Recorded trajectories.
    Replay,
    /// An empty road.
    None,
}

/// What happens when a traffic source fails in the middle of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnFailure {
    /// The run ends with the error; its files are whole.
    #[default]
    Stop,
    /// The native engine takes the vehicles over and goes on.
    Native,
}

/// One of the paper's families (Sec. VI-C): density and maximum speed of the traffic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Family {
    /// `dense`, `medium` or `sparse`: spawn probability 0.05, 0.02, 0.005.
    pub density: Density,
    /// Maximum speed of the traffic, m/s; 12.5 or 15 in the paper.
    pub max_speed_m_s: f64,
    /// Interval that the spawn probability refers to, s; none: that of the demand under `native`,
    /// 0.1 s, with which dense traffic is at capacity and no lane change gains anything.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spawn_interval_s: Option<f64>,
}

/// SUMO and how it is started.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SumoSection {
    /// The native `sumo` program; none: looked for.
    pub binary: Option<String>,
    /// Further options of SUMO, as on its command line.
    pub options: Vec<String>,
    /// SUMO's additional files: detectors, signal programs, vehicle types.
    pub additional_files: Vec<String>,
    /// Further options of netconvert, such as `--tls.set` for traffic lights.
    pub netconvert_options: Vec<String>,
    /// Attributes of the vehicle types `car`, `van`, `truck`, such as `lcAssertive`.
    pub type_attributes: TypeAttributes,
    /// Waiting times.
    pub timeouts: SumoTimeouts,
}

/// How long SUMO is waited for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SumoTimeouts {
    /// From its start to the first answer, s.
    pub startup_s: f64,
    /// For one exchange, s.
    pub answer_s: f64,
}

impl Default for SumoTimeouts {
    fn default() -> Self {
        let Timeouts { startup_s, answer_s } = Timeouts::default();
        Self { startup_s, answer_s }
    }
}

/// The recording of a replay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReplaySection {
    /// Trajectories: CSV (own, NGSIM, highD, mapped frames), CommonRoad XML, Parquet, also gzipped.
    pub file: Option<String>,
    /// Time of the recording at which the run starts, s.
    pub start_s: f64,
    /// Start again at the end; vehicles jump there.
    pub repeat: bool,
    /// Shift along the road, m, of recordings in road coordinates.
    pub shift_s_m: f64,
    /// Which carriageway of a recording with two.
    pub carriageway: Carriageway,
    /// Vehicles further away than this along the road are not shown, m.
    pub scene_radius_m: f64,
}

impl Default for ReplaySection {
    fn default() -> Self {
        let ReplayConfig { start_s, repeat, scene_radius_m, shift_s_m } = ReplayConfig::default();
        let (file, carriageway) = (None, Carriageway::Forward);
        Self { file, start_s, repeat, shift_s_m, carriageway, scene_radius_m }
    }
}

impl TrafficSection {
    /// The mode that is driven: the one asked for, else the usual one of the source.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode.unwrap_or(match self.source {
            TrafficKind::Replay => Mode::Rep,
            _ => Mode::Inter,
        })
    }

    /// Demand and drivers, the family and the seed put in.
    #[must_use]
    pub fn demand(&self, seed: u64) -> TrafficConfig {
        let mut demand = TrafficConfig { seed, ..self.native.clone() };
        if let Some(family) = self.family {
            demand.spawn_probability = family.density.spawn_probability();
            demand.max_speed_m_s = family.max_speed_m_s;
            demand.spawn_interval_s = family.spawn_interval_s.unwrap_or(demand.spawn_interval_s);
            demand.initial_density_1_km = None;
        }
        demand
    }

    /// What changes while the traffic runs, the detectors' counts read.
    ///
    /// # Errors
    /// [`TrafficError::Config`] names the table, its line and what is wrong there.
    pub fn schedule(&self) -> Result<Schedule, TrafficError> {
        let mut demand = self.demand.clone();
        if let Some(file) = &self.detectors {
            demand.extend(detectors::load(Path::new(file))?);
            demand.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        }
        let mut emergency_vehicles = self.emergency_vehicle.clone();
        emergency_vehicles.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        Ok(Schedule { demand, incidents: self.incident.clone(), emergency_vehicles })
    }

    /// SUMO's configuration with this demand.
    pub(crate) fn sumo_config(&self, traffic: TrafficConfig) -> SumoConfig {
        let SumoTimeouts { startup_s, answer_s } = self.sumo.timeouts;
        SumoConfig {
            traffic,
            binary: self.sumo.binary.as_ref().map(PathBuf::from),
            timeouts: Timeouts { startup_s, answer_s },
            options: self.sumo.options.clone(),
            additional_files: self.sumo.additional_files.iter().map(PathBuf::from).collect(),
            netconvert_options: self.sumo.netconvert_options.clone(),
            type_attributes: self.sumo.type_attributes.clone(),
        }
    }

    /// The replay's configuration.
    pub(crate) fn replay_config(&self) -> ReplayConfig {
        let ReplaySection { start_s, repeat, shift_s_m, scene_radius_m, .. } = self.replay;
        ReplayConfig { start_s, repeat, scene_radius_m, shift_s_m }
    }

    /// Files that are named relative to the scenario lie beside it.
    pub(crate) fn resolve_paths(&mut self, folder: &Path) {
        let files =
            self.manifest.iter_mut().chain(&mut self.replay.file).chain(&mut self.detectors);
        for file in files.chain(&mut self.sumo.binary).chain(&mut self.sumo.additional_files) {
            *file = folder.join(&*file).display().to_string();
        }
    }

    /// What cannot be, with the key.
    pub(crate) fn violations(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        let (mode, source) = (self.mode(), self.source);
        if source == TrafficKind::Replay && self.replay.file.is_none() {
            wrong.push("traffic.source = replay needs traffic.replay.file".to_owned());
        }
        if (mode == Mode::Rep) != (source == TrafficKind::Replay) && mode != Mode::Re {
            let has =
                "rep goes with recorded traffic (source = replay), pure and inter with an engine";
            wrong.push(format!("traffic.mode = {mode:?}: {has}").to_lowercase());
        }
        if mode == Mode::Re && self.manifest.is_none() {
            wrong.push("traffic.mode = re needs traffic.manifest, the run to repeat".to_owned());
        }
        if mode != Mode::Re && self.manifest.is_some() {
            wrong.push("traffic.manifest is for traffic.mode = re".to_owned());
        }
        let changes = [
            ("demand", !self.demand.is_empty()),
            ("detectors", self.detectors.is_some()),
            ("incident", !self.incident.is_empty()),
            ("emergency_vehicle", !self.emergency_vehicle.is_empty()),
        ];
        if matches!(source, TrafficKind::Replay | TrafficKind::None) {
            for (key, _) in changes.iter().filter(|(_, is_set)| *is_set) {
                let source = format!("{source:?}").to_lowercase();
                wrong.push(format!(
                    "traffic.{key} is for an engine (native, sumo); traffic.source = {source} \
                     cannot change what drives"
                ));
            }
        }
        for (key, value, low, high) in [
            ("traffic.sumo.timeouts.startup_s", self.sumo.timeouts.startup_s, 0.1, 600.0),
            ("traffic.sumo.timeouts.answer_s", self.sumo.timeouts.answer_s, 0.01, 600.0),
            ("traffic.replay.start_s", self.replay.start_s, 0.0, 1e6),
            ("traffic.replay.shift_s_m", self.replay.shift_s_m, -1e6, 1e6),
            ("traffic.replay.scene_radius_m", self.replay.scene_radius_m, 1.0, 1e5),
        ] {
            if !(value >= low && value <= high) {
                wrong.push(format!("{key} = {value} is outside {low} to {high}"));
            }
        }
        wrong.extend(self.perception.validate().err().map(|e| e.to_string()));
        wrong
    }
}
