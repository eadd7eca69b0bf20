//! The traffic of a world: an engine, its fingerprints, the sensors before it.
//!
//! | layer | what it does |
//! |---|---|
//! | [`Engine`] | moves the vehicles; on failure of SUMO the native engine can go on |
//! | `Hashed` | fingerprints every scene, compares with a manifest in mode `re` |
//! | `Perceived` | what the truck's sensors make of it; off by default |

use std::path::{Path, PathBuf};
use std::sync::Arc;

use road::Road;
use serde::Serialize;
use tempfile::TempDir;
use tractrix_core::{EgoState, Geometry, Neighbour, Scene, Time, TrafficSource};
use traffic_client::native::{NativeTraffic, TrafficConfig};
use traffic_client::replay::{Recording, ReplayTraffic, load};
use traffic_client::schedule::Schedule;
use traffic_client::sumo::{Programs, SumoTraffic};
use traffic_client::{Hashed, Manifest, Mode, Perceived, TrafficError};

use crate::traffic_section::{OnFailure, TrafficKind};
use crate::{Scenario, SimError};

/// Recordings are resampled to this, s.
const REPLAY_STEP_S: f64 = 0.1;
/// Spacing at which a road is fingerprinted, m.
const ROAD_SAMPLE_M: f64 = 50.0;

/// The traffic of a world. A clone goes on bit for bit like its original, except in SUMO traffic,
/// where there is one SUMO: the clone's next scene is an error that says so.
#[derive(Debug, Clone)]
pub struct Traffic {
    inner: Perceived<Hashed<Engine>>,
    mode: Mode,
    schedule: Schedule,
}

/// Vehicles at the entries of the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Arrivals {
    /// Those that came since the warm-up began.
    pub came: u64,
    /// Those that wait before the road now.
    pub waiting: u64,
}

/// Where the vehicles come from.
#[derive(Debug)]
enum Engine {
    /// An empty road, or one whose vehicles somebody else moves.
    None(Scene),
    /// The native engine.
    Native(Box<NativeTraffic>, Option<String>),
    /// A recording.
    Replay(Box<ReplayTraffic>),
    /// SUMO.
    Sumo(Box<Sumo>),
    /// The clone of one with SUMO.
    Detached,
}

/// SUMO, its folder, and what goes on when it fails.
#[derive(Debug)]
struct Sumo {
    traffic: SumoTraffic,
    _folder: Option<TempDir>,
    road: Arc<Road>,
    geometry: Geometry,
    fallback: Option<TrafficConfig>,
}

impl Clone for Engine {
    fn clone(&self) -> Self {
        match self {
            Self::None(scene) => Self::None(scene.clone()),
            Self::Native(native, why) => Self::Native(native.clone(), why.clone()),
            Self::Replay(replay) => Self::Replay(replay.clone()),
            Self::Sumo(_) | Self::Detached => Self::Detached,
        }
    }
}

impl Traffic {
    /// The traffic that a scenario asks for, on its road, around a truck of this geometry. `folder`
    /// takes SUMO's working files; none: a temporary one.
    ///
    /// # Errors
    /// [`SimError`] names the key, file or program that cannot be used, and in mode `re` what
    /// differs from the manifest.
    pub fn new(
        scenario: &Scenario,
        seed: u64,
        road: &Arc<Road>,
        geometry: Geometry,
        folder: Option<&Path>,
    ) -> Result<Self, SimError> {
        let section = &scenario.traffic;
        let expected = match (section.mode(), &section.manifest) {
            (Mode::Re, Some(file)) => Some(read_manifest(file.as_ref())?),
            _ => None,
        };
        let mode = match &expected {
            Some(manifest) => manifest.inputs.get("mode").map_or(Ok(Mode::Inter), |m| m.parse())?,
            None => section.mode(),
        };
        let mut inputs = Manifest { seed, ..Manifest::default() };
        let mut input = |name: &str, value: String| inputs.inputs.insert(name.to_owned(), value);
        input("mode", word(mode));
        input("road", road_fingerprint(road));
        input("scenario", scenario_text(scenario)?);
        if let Some(file) = &section.detectors {
            input("detectors", file_fingerprint(file.as_ref())?);
        }
        let demand = TrafficConfig {
            sees_ego: mode == Mode::Inter,
            schedule: section.schedule()?,
            ..section.demand(seed)
        };
        let schedule = demand.schedule.clone();
        let engine = match section.source {
            TrafficKind::None => Engine::None(Scene::default()),
            TrafficKind::Native => {
                let native = NativeTraffic::new(Arc::clone(road), geometry, demand)?;
                Engine::Native(Box::new(native), None)
            }
            TrafficKind::Replay => {
                let file = Path::new(section.replay.file.as_deref().unwrap_or_default());
                input("recording", file_fingerprint(file)?);
                let recording = recording_of(scenario)?;
                let config = section.replay_config();
                let replay = ReplayTraffic::new(Arc::clone(road), &recording, config)?;
                Engine::Replay(Box::new(replay))
            }
            TrafficKind::Sumo => {
                for file in &section.sumo.additional_files {
                    input(&format!("file {}", base_name(file)), file_fingerprint(file.as_ref())?);
                }
                match Engine::sumo(scenario, demand.clone(), road, geometry, folder) {
                    Err(SimError::Traffic(TrafficError::Sumo(why)))
                        if section.on_failure == OnFailure::Native =>
                    {
                        let native = NativeTraffic::new(Arc::clone(road), geometry, demand)?;
                        Engine::Native(Box::new(native), Some(why.to_string()))
                    }
                    engine => engine?,
                }
            }
        };
        inputs.engine = engine.name();
        let hashed = match expected {
            Some(expected) => Hashed::verify(engine, inputs, expected)?,
            None => Hashed::record(engine, inputs),
        };
        let perception = traffic_client::PerceptionConfig {
            seed: seed ^ section.perception.seed,
            ..section.perception.clone()
        };
        Ok(Self { inner: Perceived::new(hashed, perception)?, mode, schedule })
    }

    /// The mode that is driven; of a repeated run, the mode of the first.
    #[must_use]
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// Takes no more fingerprints unless they are compared with a manifest's, and gives vehicles of
    /// native traffic a map pose only within this distance, m.
    pub(crate) fn only_near(&mut self, distance_m: f64) {
        self.inner.inner_mut().stop();
        if let Engine::Native(native, _) = self.inner.inner_mut().inner_mut() {
            native.set_map_poses_within_m(distance_m);
        }
    }

    /// The speed limit of the whole road at a time (s), m/s, where one holds beside the road's own.
    #[must_use]
    pub fn limit_m_s(&self, time_s: f64) -> Option<f64> {
        self.schedule.limit_m_s(time_s)
    }

    /// What is needed to repeat the run, and its fingerprints so far.
    #[must_use]
    pub fn manifest(&self) -> Manifest {
        let mut manifest = self.inner.inner().manifest().clone();
        if let Some(why) = self.failure() {
            manifest.inputs.insert("failure".to_owned(), why.to_owned());
        }
        manifest
    }

    /// Why the native engine had to go on in place of another one, if it had to.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        match self.inner.inner().inner() {
            Engine::Native(_, why) => why.as_deref(),
            _ => None,
        }
    }

    /// Vehicles that came to the road so far and those of them that wait before it for room: of
    /// native traffic, where nobody who waits is lost.
    #[must_use]
    pub fn arrivals(&self) -> Option<Arrivals> {
        match self.inner.inner().inner() {
            Engine::Native(native, _) => {
                let counts = native.counts();
                Some(Arrivals { came: counts.arrived, waiting: counts.waiting })
            }
            _ => None,
        }
    }

    /// The latest scene as it is, when sensors change what is seen.
    #[must_use]
    pub fn truth(&self) -> Option<&Scene> {
        self.inner.truth()
    }

    /// Puts vehicles that somebody else moves on a road without traffic of its own (`source =
    /// "none"`), in place of those that were shown before; they stay where they are until the next
    /// are shown. Lane and place on the map are those of `road` at their stations; who is on no lane
    /// of it is left out.
    ///
    /// # Errors
    /// [`TrafficError::Config`] in other traffic, and for a number that is not finite or a vehicle
    /// without length and width; nothing is changed then.
    pub fn show(&mut self, others: &[Neighbour], road: &Road) -> Result<(), TrafficError> {
        let Engine::None(scene) = self.inner.inner_mut().inner_mut() else {
            let why = "vehicles are shown on a road without traffic, source = \"none\"";
            return Err(TrafficError::Config { why: why.to_owned() });
        };
        for other in others {
            let speeds = [other.speed_m_s, other.lateral_speed_m_s, other.accel_m_s2];
            let place = [other.front_s_m, other.rear_s_m, other.d_m, other.width_m];
            let has_body = other.front_s_m > other.rear_s_m && other.width_m > 0.0;
            if !has_body || place.iter().chain(&speeds).any(|x| !x.is_finite()) {
                let why = format!(
                    "vehicle {}: finite numbers, front_s_m beyond rear_s_m, width_m above 0",
                    other.id
                );
                return Err(TrafficError::Config { why });
            }
        }
        scene.neighbours.clear();
        scene.neighbours.extend(others.iter().filter_map(|other| {
            let s_m = 0.5 * (other.front_s_m + other.rear_s_m);
            let lane = road.lane_at(s_m, other.d_m)?;
            let at = road.at(s_m, other.d_m);
            let drift_rad = libm::atan2(other.lateral_speed_m_s, other.speed_m_s.max(1.0));
            let (x_m, y_m, yaw_rad) = (at.x_m, at.y_m, at.heading_rad + drift_rad);
            Some(Neighbour { lane, target_lane: None, x_m, y_m, yaw_rad, ..*other })
        }));
        scene
            .neighbours
            .sort_unstable_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m).then(a.id.cmp(&b.id)));
        Ok(())
    }

    /// SUMO, to read and set its variables (traffic lights, vehicle types, routes, ...).
    pub fn sumo_mut(&mut self) -> Option<&mut SumoTraffic> {
        match self.inner.inner_mut().inner_mut() {
            Engine::Sumo(sumo) => Some(&mut sumo.traffic),
            _ => None,
        }
    }
}

impl TrafficSource for Traffic {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        self.inner.advance(now, ego)
    }
}

impl Engine {
    fn sumo(
        scenario: &Scenario,
        demand: TrafficConfig,
        road: &Arc<Road>,
        geometry: Geometry,
        folder: Option<&Path>,
    ) -> Result<Self, SimError> {
        let section = &scenario.traffic;
        let fallback = (section.on_failure == OnFailure::Native).then(|| demand.clone());
        let config = section.sumo_config(demand);
        // Nothing is written where there is no SUMO.
        Programs::find(config.binary.as_deref()).map_err(TrafficError::from)?;
        let io = |path: &Path| {
            let path = path.to_owned();
            |source| SimError::Io { path, source }
        };
        let (temporary, folder) = match folder {
            Some(folder) => {
                std::fs::create_dir_all(folder).map_err(io(folder))?;
                (None, folder.to_owned())
            }
            None => {
                let temporary = tempfile::tempdir().map_err(io(Path::new("temporary folder")))?;
                let path = temporary.path().to_owned();
                (Some(temporary), path)
            }
        };
        let road = Arc::clone(road);
        let traffic = SumoTraffic::new(Arc::clone(&road), geometry, config, &folder)?;
        let sumo = Sumo { traffic, _folder: temporary, road, geometry, fallback };
        Ok(Self::Sumo(Box::new(sumo)))
    }

    /// Name and version.
    fn name(&self) -> String {
        match self {
            Self::None(_) => "none".to_owned(),
            Self::Native(..) => format!("native {}", env!("CARGO_PKG_VERSION")),
            Self::Replay(_) => format!("replay {}", env!("CARGO_PKG_VERSION")),
            Self::Sumo(sumo) => sumo.traffic.programs().version.clone(),
            Self::Detached => "SUMO".to_owned(),
        }
    }
}

impl TrafficSource for Engine {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        if let Self::Sumo(sumo) = self
            && let Err(error) = sumo.traffic.advance(now, ego)
        {
            let (Some(config), TrafficError::Sumo(_)) = (sumo.fallback.clone(), &error) else {
                return Err(error);
            };
            let (road, geometry) = (Arc::clone(&sumo.road), sumo.geometry);
            let native = if sumo.traffic.has_shown() {
                let scene = sumo.traffic.last_scene();
                NativeTraffic::take_over(road, geometry, config, scene, ego, now)?
            } else {
                NativeTraffic::new(road, geometry, config)?
            };
            *self = Self::Native(Box::new(native), Some(error.to_string()));
        }
        match self {
            Self::None(scene) => {
                scene.time = now;
                Ok(scene)
            }
            Self::Native(native, _) => native.advance(now, ego),
            Self::Replay(replay) => replay.advance(now, ego),
            Self::Sumo(sumo) => Ok(sumo.traffic.last_scene()),
            Self::Detached => {
                let why = "a copy of a run in SUMO traffic cannot go on: there is one SUMO";
                Err(TrafficError::Config { why: why.to_owned() })
            }
        }
    }
}

/// The recording that a scenario names.
///
/// # Errors
/// [`SimError::Traffic`] names the file and what is wrong in it.
pub fn recording_of(scenario: &Scenario) -> Result<Recording, SimError> {
    let replay = &scenario.traffic.replay;
    let file = PathBuf::from(replay.file.as_deref().unwrap_or_default());
    load(&file, replay.carriageway, REPLAY_STEP_S).map_err(|e| TrafficError::from(e).into())
}

/// Reads a manifest.
///
/// # Errors
/// [`SimError::Io`], or [`SimError::Scenario`] with the file and what is wrong in it.
pub fn read_manifest(file: &Path) -> Result<Manifest, SimError> {
    let text = std::fs::read_to_string(file)
        .map_err(|source| SimError::Io { path: file.to_owned(), source })?;
    Manifest::from_toml(&text).map_err(|e| SimError::Scenario {
        name: file.display().to_string(),
        why: e.to_string().replace('\n', " "),
    })
}

/// A scenario without what does not change its traffic: what two runs must have in common.
fn scenario_text(scenario: &Scenario) -> Result<String, SimError> {
    let mut same = scenario.clone();
    same.description.clear();
    same.run.duration_s = crate::RunLimits::default().duration_s;
    (same.traffic.mode, same.traffic.manifest) = (None, None);
    same.traffic.on_failure = OnFailure::default();
    same.traffic.sumo.binary = None;
    let files = same.traffic.replay.file.iter_mut().chain(&mut same.traffic.sumo.additional_files);
    let files = files.chain(&mut same.traffic.detectors);
    for file in files.chain([&mut same.road, &mut same.truck.file]) {
        *file = base_name(file);
    }
    toml::to_string(&same)
        .map_err(|e| SimError::Scenario { name: scenario.name.clone(), why: e.to_string() })
}

/// The last part of a path.
fn base_name(file: &str) -> String {
    Path::new(file).file_name().map_or_else(|| file.to_owned(), |n| n.to_string_lossy().into())
}

fn file_fingerprint(file: &Path) -> Result<String, SimError> {
    let bytes =
        std::fs::read(file).map_err(|source| SimError::Io { path: file.to_owned(), source })?;
    Ok(Manifest::fingerprint(&bytes))
}

/// A fingerprint of where a road lies and what lanes it has.
#[must_use]
pub fn road_fingerprint(road: &Road) -> String {
    let samples = (road.length_m() / ROAD_SAMPLE_M) as usize;
    let mut bytes = Vec::with_capacity(64 * samples);
    let mut add = |x: f64| bytes.extend_from_slice(&x.to_bits().to_le_bytes());
    for k in 0..=samples {
        let s_m = k as f64 * ROAD_SAMPLE_M;
        let at = road.at(s_m, 0.0);
        for x in [at.x_m, at.y_m, at.z_m, at.heading_rad, at.grade_rad] {
            add(x);
        }
        for lane in road.lanes_at(s_m) {
            for x in
                [lane.center_d_m(s_m), lane.width_m(s_m), road.lane_speed_limit_m_s(lane.id, s_m)]
            {
                add(x);
            }
        }
    }
    Manifest::fingerprint(&bytes)
}

/// A mode as scenario files have it.
fn word(mode: Mode) -> String {
    format!("{mode:?}").to_lowercase()
}
