//! SUMO as a [`TrafficSource`]: one exchange per step of 0.1 s.
//!
//! Each step sends `[move the ego, move its ghost, move the eye, step]` in one message and gets the
//! vehicles around the eye (a point of interest at the ego's place) in the answer. Between two
//! steps vehicles are carried on with their speed and acceleration. What is sent is in `step`, what
//! comes back in `shown`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Geometry, Neighbour, Scene, Time, TrafficSource};

use super::check::{ImportCheck, check};
use super::codec::Value;
use super::config::SumoConfig;
use super::error::SumoError;
use super::link::Link;
use super::network::{Network, convert};
use super::process::Programs;
use super::session::Answer;
use super::shown::Body;
use crate::TrafficError;
use crate::native::{EgoSpans, LaneMap, lane_map};
use crate::schedule::{IncidentKind, Stage};

/// SUMO's step, ns.
const STEP_NS: i64 = 100_000_000;
/// Restarts before a source gives up.
const MAX_RESTARTS: u32 = 3;

/// SUMO traffic on a road.
#[derive(Debug)]
pub struct SumoTraffic {
    pub(super) config: SumoConfig,
    pub(super) programs: Programs,
    pub(super) network: Network,
    pub(super) import: ImportCheck,
    pub(super) road: Arc<Road>,
    pub(super) map: LaneMap,
    pub(super) geometry: Geometry,
    pub(super) folder: PathBuf,
    pub(super) link: Option<Link>,
    pub(super) ego_inside: bool,
    pub(super) ghost: bool,
    pub(super) spans: EgoSpans,
    pub(super) bodies: Vec<Body>,
    /// Vehicles at the latest step.
    pub(super) at_step: Vec<Neighbour>,
    pub(super) step_time: Option<Time>,
    pub(super) scene: Scene,
    pub(super) restarts: u32,
    /// Closed lanes.
    pub(super) stage: Stage,
    /// Speed limit of the whole road that SUMO was told, m/s.
    pub(super) limit_m_s: f64,
}

impl SumoTraffic {
    /// Brings the road into SUMO: written, converted, every lane checked. Working files
    /// go into `folder`, which exists. SUMO starts with the first scene.
    ///
    /// # Errors
    /// [`TrafficError`] for the configuration, a missing SUMO, and an import that does not fit.
    pub fn new(
        road: Arc<Road>,
        geometry: Geometry,
        config: SumoConfig,
        folder: &Path,
    ) -> Result<Self, TrafficError> {
        config.traffic.validate()?;
        config.traffic.schedule.validate(Some(&road))?;
        config.check_files_and_types()?;
        let programs = Programs::find(config.binary.as_deref())?;
        let closures = config.traffic.schedule.incidents.iter();
        let closures = closures.filter(|i| i.kind == IncidentKind::ClosedLane);
        let cuts_m: Vec<f64> = closures.flat_map(|i| <[f64; 2]>::from(i.stretch_m())).collect();
        let network = convert(&programs, &road, folder, &cuts_m, &config.netconvert_options)?;
        let import = check(&network, &road)?;
        let map = lane_map(&road)?;
        Ok(Self {
            config,
            programs,
            network,
            import,
            road,
            map,
            geometry,
            folder: folder.to_owned(),
            link: None,
            ego_inside: false,
            ghost: false,
            spans: EgoSpans::default(),
            bodies: Vec::new(),
            at_step: Vec::new(),
            step_time: None,
            scene: Scene::default(),
            restarts: 0,
            stage: Stage::default(),
            limit_m_s: f64::INFINITY,
        })
    }

    /// How well SUMO's copy of the road fits.
    #[must_use]
    pub fn import(&self) -> &ImportCheck {
        &self.import
    }

    /// SUMO's copy of the road.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Name and TraCI version of the running SUMO.
    #[must_use]
    pub fn version(&self) -> Option<(&str, i32)> {
        self.link.as_ref().map(|link| (link.name.as_str(), link.api))
    }

    /// The latest scene: where the vehicles were when SUMO was heard of last.
    #[must_use]
    pub fn last_scene(&self) -> &Scene {
        &self.scene
    }

    /// Whether a scene was shown since the start or the last reset.
    #[must_use]
    pub fn has_shown(&self) -> bool {
        self.step_time.is_some()
    }

    /// The programs that are used.
    #[must_use]
    pub fn programs(&self) -> &Programs {
        &self.programs
    }

    /// Process id of the running SUMO.
    #[must_use]
    pub fn pid(&self) -> Option<u32> {
        self.link.as_ref().and_then(Link::pid)
    }

    /// The options that SUMO runs with; part of a manifest.
    #[must_use]
    pub fn options(&self) -> Vec<String> {
        let path = |name: &str| self.folder.join(name).display().to_string();
        let mut options = vec!["-n".to_owned(), self.network.file.display().to_string()];
        options.extend(["-r".to_owned(), path("demand.rou.xml")]);
        let mut additional = path("eye.add.xml");
        for file in &self.config.additional_files {
            additional.push(',');
            additional.push_str(&file.display().to_string());
        }
        options.extend(["-a".to_owned(), additional]);
        options.extend(["--seed".to_owned(), (self.config.traffic.seed & 0x7fff_ffff).to_string()]);
        let fixed = "--step-length 0.1 --thread-rngs 64 --no-step-log --duration-log.disable \
             --no-warnings --xml-validation never --time-to-teleport -1 --collision.action none \
             --default.speeddev 0.1";
        options.extend(fixed.split_whitespace().map(str::to_owned));
        // In SUMO's sublane model the lateral speed decides, and both options are refused.
        if !self.config.has_option("--lateral-resolution") {
            options.extend(["--lanechange.duration", "3"].map(str::to_owned));
        }
        options.extend(self.config.options.iter().cloned());
        options
    }

    /// Starts a new episode with this seed: a `load` into the running SUMO, or a new process if
    /// there is none. The next [`TrafficSource::advance`] puts the ego in.
    ///
    /// # Errors
    /// [`SumoError::TooManyRestarts`] after the third restart of a failed SUMO.
    pub fn reset(&mut self, seed: u64) -> Result<(), TrafficError> {
        self.config.traffic.seed = seed;
        if self.link.as_ref().is_some_and(Link::is_poisoned) {
            if self.restarts >= MAX_RESTARTS {
                let (restarts, cause) = (self.restarts, "see the first error".to_owned());
                return Err(SumoError::TooManyRestarts { restarts, cause }.into());
            }
            self.restarts += 1;
            self.link = None;
        }
        self.step_time = None;
        Ok(())
    }

    /// Reads any variable: traffic lights (`id::TRAFFIC_LIGHT`), vehicle types, routes, ….
    ///
    /// # Errors
    /// [`SumoError::Refused`] with SUMO's words; connection errors.
    pub fn get(&mut self, domain: u8, variable: u8, object: &str) -> Result<Value, TrafficError> {
        let link = self.running()?;
        link.session.request().get(domain, variable, object);
        link.command("get", object)?;
        match link.session.answers.pop() {
            Some(Answer::Value(value)) => Ok(value),
            other => Err(SumoError::Protocol(super::codec::ProtocolError {
                what: format!("no value but {other:?}"),
                at: 0,
            })
            .into()),
        }
    }

    /// Sets any variable, as [`SumoTraffic::get`].
    ///
    /// # Errors
    /// As [`SumoTraffic::get`].
    pub fn set(
        &mut self,
        domain: u8,
        variable: u8,
        object: &str,
        value: &Value,
    ) -> Result<(), TrafficError> {
        let link = self.running()?;
        link.session.request().set(domain, variable, object, value);
        Ok(link.command("set", object)?)
    }

    fn running(&mut self) -> Result<&mut Link, SumoError> {
        self.link
            .as_mut()
            .ok_or(SumoError::Poisoned { cause: "SUMO starts with the first scene".to_owned() })
    }
}

impl TrafficSource for SumoTraffic {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        ego.check_finite()?;
        let mut at = match self.step_time {
            Some(at) => at,
            None => {
                self.start(ego)?;
                self.step(ego, now)?;
                self.learn()?;
                self.take_over();
                now
            }
        };
        if now < at {
            let (asked_s, reached_s) = (now.seconds(), at.seconds());
            return Err(TrafficError::TimeBackwards { asked_s, reached_s });
        }
        if now.seconds_since(at) > crate::LONGEST_JUMP_S {
            let (asked_s, reached_s) = (now.seconds(), at.seconds());
            return Err(TrafficError::TimeJump { asked_s, reached_s });
        }
        while now.0 - at.0 >= STEP_NS {
            at = at.plus_nanos(STEP_NS);
            self.step(ego, at)?;
            self.learn()?;
            self.take_over();
        }
        self.step_time = Some(at);
        let tau = now.seconds_since(at);
        self.scene.time = now;
        self.scene.neighbours.clear();
        self.scene.neighbours.extend(self.at_step.iter().map(|n| crate::native::carry_on(n, tau)));
        self.scene
            .neighbours
            .sort_unstable_by(|a, b| a.front_s_m.total_cmp(&b.front_s_m).then(a.id.cmp(&b.id)));
        let traffic = &self.config.traffic;
        let radius_m = traffic.scene_radius_m;
        self.stage.show(&traffic.schedule, &self.road, ego.s_m, radius_m, &mut self.scene);
        Ok(&self.scene)
    }
}
