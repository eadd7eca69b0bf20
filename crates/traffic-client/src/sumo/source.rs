//! SUMO as a [`TrafficSource`]: one exchange per step of 0.1 s.
//!
//! Each step sends `[move the ego, move its ghost, move the eye, step]` in one message and gets the
//! vehicles around the eye (a point of interest at the ego's place) in the answer. Between two
//! steps vehicles are carried on with their speed and acceleration. Heights and lane geometry come
//! from our road, never from SUMO.
//!
//! SUMO's drivers do not see an externally moved truck before its centre crosses a lane line. While
//! the ego reaches into a neighbour lane, a *ghost* of its size drives in that lane.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use road::Road;
use tractrix_core::{EgoState, Geometry, Neighbour, Scene, Time, TrafficSource, VehicleClass};

use super::check::{ImportCheck, check};
use super::codec::Value;
use super::demand::{EGO, EGO_ROUTE, GHOST, class_of, is_type, route_file};
use super::error::SumoError;
use super::link::{Link, Timeouts};
use super::network::{Network, convert, file_error};
use super::process::Programs;
use super::session::{Answer, Seen, id, var};
use crate::TrafficError;
use crate::native::{EgoSpans, LaneMap, TrafficConfig, lane_map};

/// SUMO's step, ns.
const STEP_NS: i64 = 100_000_000;
/// Id of the point of interest that the context subscription hangs on.
const EYE: &str = "eye";
/// Restarts before a source gives up.
const MAX_RESTARTS: u32 = 3;

/// What a user sets about SUMO.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SumoConfig {
    /// The traffic; `sees_ego` chooses between the modes `inter` and `pure`.
    pub traffic: TrafficConfig,
    /// The native `sumo`; `None`: looked for, see [`Programs::find`].
    pub binary: Option<PathBuf>,
    /// Waiting times.
    pub timeouts: Timeouts,
    /// Further options for SUMO, as on its command line.
    pub options: Vec<String>,
    /// SUMO's additional files (detectors, signal programs, vehicle types, ...), loaded after ours.
    pub additional_files: Vec<PathBuf>,
    /// Further options for netconvert, such as `--tls.set`, which makes traffic lights.
    pub netconvert_options: Vec<String>,
    /// Attributes of SUMO's vehicle types `car`, `van`, `truck`, in place of ours or beside them:
    /// `carFollowModel`, `laneChangeModel`, `lcAssertive`, ...
    pub type_attributes: TypeAttributes,
}

/// Attributes of vehicle types: type, then attribute and value.
pub type TypeAttributes = BTreeMap<String, BTreeMap<String, String>>;

impl SumoConfig {
    /// SUMO itself says nothing of a missing file before it is gone, so this is said here.
    fn check_files_and_types(&self) -> Result<(), TrafficError> {
        let bad = |why: String| Err(TrafficError::Config { why });
        if let Some(missing) = self.additional_files.iter().find(|file| !file.is_file()) {
            return bad(format!("sumo.additional_files: no file {}", missing.display()));
        }
        for (name, attributes) in &self.type_attributes {
            if !is_type(name) {
                return bad(format!("sumo.type_attributes.{name}: not one of car, van, truck"));
            }
            let plain = |text: &str| !text.contains(['"', '<', '&']);
            if let Some((key, value)) =
                attributes.iter().find(|(key, value)| !plain(key) || !plain(value))
            {
                return bad(format!("sumo.type_attributes.{name}.{key} = {value:?} is not plain"));
            }
        }
        Ok(())
    }
}

/// What does not change about a vehicle.
#[derive(Debug, Clone, Copy, Default)]
struct Body {
    known: bool,
    hidden: bool,
    class: VehicleClass,
    length_m: f64,
    width_m: f64,
    /// Last station, m: where to look next.
    hint_s_m: Option<f64>,
}

/// SUMO traffic on a road.
#[derive(Debug)]
pub struct SumoTraffic {
    config: SumoConfig,
    programs: Programs,
    network: Network,
    import: ImportCheck,
    road: Arc<Road>,
    map: LaneMap,
    geometry: Geometry,
    folder: PathBuf,
    link: Option<Link>,
    ego_inside: bool,
    ghost: bool,
    spans: EgoSpans,
    bodies: Vec<Body>,
    /// Vehicles at the latest step.
    at_step: Vec<Neighbour>,
    step_time: Option<Time>,
    scene: Scene,
    restarts: u32,
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
        config.check_files_and_types()?;
        let programs = Programs::find(config.binary.as_deref())?;
        let network = convert(&programs, &road, folder, &config.netconvert_options)?;
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
             --lanechange.duration 3 --default.speeddev 0.1";
        options.extend(fixed.split_whitespace().map(str::to_owned));
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

    /// Reads any variable: traffic lights ([`id::TRAFFIC_LIGHT`]), vehicle types, routes, ….
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

    /// Writes the demand with a free stretch at the ego, starts or reloads SUMO, caps the speeds.
    fn start(&mut self, ego: &EgoState) -> Result<(), SumoError> {
        let clearance = self.config.traffic.ego_clearance_m + self.geometry.length_m();
        let free = if self.config.traffic.sees_ego {
            ego.s_m - clearance..ego.s_m + clearance
        } else {
            0.0..0.0
        };
        let write = |name: &str, text: &str| {
            let path = self.folder.join(name);
            std::fs::write(&path, text).map_err(|e| file_error(&path, &e))
        };
        let demand = route_file(&self.config, &self.network, &self.geometry, free);
        write("demand.rou.xml", &demand)?;
        write(
            "eye.add.xml",
            &format!(
                "<additional><poi id=\"{EYE}\" x=\"0\" y=\"0\" color=\"0,0,0\"/></additional>\n"
            ),
        )?;
        let options = self.options();
        match &mut self.link {
            Some(link) => link.load(&options)?,
            None => {
                self.link = Some(Link::start(&self.programs, &options, self.config.timeouts)?);
            }
        }
        (self.ego_inside, self.ghost) = (false, false);
        self.bodies.clear();
        let speed_m_s = self.config.traffic.max_speed_m_s;
        let radius_m = self.config.traffic.scene_radius_m;
        let Some(link) = self.link.as_mut() else { return Ok(()) };
        let request = link.session.request();
        for lane in self.network.lanes.iter().filter(|lane| lane.speed_m_s > speed_m_s) {
            request.set(id::LANE, var::MAX_SPEED, &lane.id, &Value::Double(speed_m_s));
        }
        request.move_poi(EYE, ego.x_m, ego.y_m).subscribe_context(id::POI, EYE, radius_m);
        link.command("start", EYE)
    }

    /// One step: the ego as it will be at its end, if it is to be seen.
    fn step(&mut self, ego: &EgoState) -> Result<(), SumoError> {
        let yaw = ego.yaw_rad;
        let (sin, cos) = (libm::sin(yaw), libm::cos(yaw));
        let front = (ego.x_m + self.geometry.front_m * cos, ego.y_m + self.geometry.front_m * sin);
        let sees_ego = self.config.traffic.sees_ego;
        let ghost = if sees_ego { self.ghost_place(ego) } else { None };
        let Some(link) = self.link.as_mut() else { return Ok(()) };
        let request = link.session.request();
        if sees_ego {
            if !self.ego_inside {
                request.set(id::VEHICLE, var::ADD, EGO, &add_ego());
            }
            request.move_to_xy(EGO, front.0, front.1, sumo_angle_deg(yaw));
            if !self.ego_inside {
                for variable in [var::SPEED_MODE, var::LANE_CHANGE_MODE] {
                    request.set(id::VEHICLE, variable, EGO, &Value::Int(0));
                }
            }
            match (ghost, self.ghost) {
                (Some((x, y, heading)), was) => {
                    if !was {
                        request.set(id::VEHICLE, var::ADD, GHOST, &add_ego());
                    }
                    request.move_to_xy(GHOST, x, y, sumo_angle_deg(heading));
                }
                (None, true) => {
                    request.set(id::VEHICLE, var::REMOVE, GHOST, &Value::Byte(3));
                }
                (None, false) => {}
            }
        }
        request.move_poi(EYE, ego.x_m, ego.y_m).step();
        link.exchange("step")?;
        link.time_s += 0.1;
        if let Some(SumoError::Refused { text, .. }) = link.session.refusal(EGO)
            && !self.ego_inside
        {
            return Err(SumoError::EgoNotInserted { why: text });
        }
        (self.ego_inside, self.ghost) = (sees_ego, ghost.is_some());
        Ok(())
    }

    /// Front bumper and heading of the ghost, if the ego reaches into a second lane.
    fn ghost_place(&mut self, ego: &EgoState) -> Option<(f64, f64, f64)> {
        let heading = self.road.at(ego.s_m, ego.d_m).heading_rad;
        self.spans.update(ego, &self.geometry, &self.map, heading, 0.0);
        let front = self.geometry.front_m;
        let d_front = ego.d_m + front * libm::sin(ego.yaw_rad - heading);
        let own = self.road.lane_at(ego.s_m + front, d_front);
        let span = self.spans.spans().iter().find(|span| Some(span.lane) != own)?;
        let d = self.road.lanes().get(usize::from(span.lane))?.center_d_m(span.front_m);
        let at = self.road.at(span.front_m, d);
        Some((at.x_m, at.y_m, at.heading_rad))
    }

    /// Learns the bodies of vehicles that were not seen before.
    fn learn(&mut self) -> Result<(), SumoError> {
        let Some(link) = self.link.as_mut() else { return Ok(()) };
        let mut new = Vec::new();
        for seen in &link.session.seen {
            let k = seen.handle as usize;
            if self.bodies.len() <= k {
                self.bodies.resize(k + 1, Body::default());
            }
            if self.bodies.get(k).is_some_and(|body| !body.known) {
                new.push(seen.handle);
            }
        }
        if new.is_empty() {
            return Ok(());
        }
        let names: Vec<String> = new.iter().map(|&h| link.session.name(h).to_owned()).collect();
        let kept = std::mem::take(&mut link.session.seen);
        let request = link.session.request();
        for name in &names {
            for variable in [var::LENGTH, var::WIDTH, var::TYPE] {
                request.get(id::VEHICLE, variable, name);
            }
        }
        let result = link.exchange("bodies");
        link.session.seen = kept;
        result?;
        for (k, (&handle, name)) in new.iter().zip(&names).enumerate() {
            let answers = link.session.answers.get(3 * k..3 * k + 3).unwrap_or_default();
            let [
                Answer::Value(Value::Double(length_m)),
                Answer::Value(Value::Double(width_m)),
                Answer::Value(Value::Text(type_id)),
            ] = answers
            else {
                continue;
            };
            if let Some(body) = self.bodies.get_mut(handle as usize) {
                *body = Body {
                    known: true,
                    hidden: name == EGO || name == GHOST,
                    class: class_of(type_id, *length_m),
                    length_m: *length_m,
                    width_m: *width_m,
                    hint_s_m: None,
                };
            }
        }
        Ok(())
    }

    /// Brings what SUMO shows onto our road.
    fn take_over(&mut self) {
        self.at_step.clear();
        let Some(link) = &self.link else { return };
        for seen in &link.session.seen {
            let Some(body) = self.bodies.get_mut(seen.handle as usize) else { continue };
            if body.known
                && !body.hidden
                && let Some(neighbour) = neighbour(seen, body, &self.road)
            {
                self.at_step.push(neighbour);
            }
        }
    }
}

/// A vehicle as SUMO shows it, on our road; `None` if it is on another one.
fn neighbour(seen: &Seen, body: &mut Body, road: &Road) -> Option<Neighbour> {
    let yaw_rad = core::f64::consts::FRAC_PI_2 - seen.angle_deg.to_radians();
    let (sin, cos) = (libm::sin(yaw_rad), libm::cos(yaw_rad));
    let half = 0.5 * body.length_m;
    let (x_m, y_m) = (seen.x_m - half * cos, seen.y_m - half * sin);
    let at = road.project(x_m, y_m, body.hint_s_m)?;
    let heading = road.at(at.s_m, at.d_m).heading_rad;
    let lane = road.lane_at(at.s_m, at.d_m);
    if libm::cos(yaw_rad - heading) < 0.5 {
        body.hint_s_m = None;
        return None;
    }
    let Some(lane) = lane else {
        body.hint_s_m = None;
        return None;
    };
    body.hint_s_m = Some(at.s_m);
    let centre = road.lanes().get(usize::from(lane))?.center_d_m(at.s_m);
    let lateral = seen.lateral_speed_m_s;
    let target_lane = match (lateral, at.d_m - centre) {
        (v, off) if v > 0.05 && off > 0.0 => road.left_of(lane, at.s_m),
        (v, off) if v < -0.05 && off < 0.0 => road.right_of(lane, at.s_m),
        _ => None,
    };
    Some(Neighbour {
        id: u64::from(seen.handle),
        class: body.class,
        front_s_m: at.s_m + half,
        rear_s_m: at.s_m - half,
        d_m: at.d_m,
        width_m: body.width_m,
        speed_m_s: seen.speed_m_s,
        lateral_speed_m_s: lateral,
        accel_m_s2: seen.accel_m_s2,
        lane,
        target_lane,
        x_m,
        y_m,
        yaw_rad,
    })
}

/// Yaw (rad, counter-clockwise from x) as SUMO's angle (degrees, clockwise from north).
fn sumo_angle_deg(yaw_rad: f64) -> f64 {
    let turn = 90.0 - yaw_rad.to_degrees();
    turn - 360.0 * libm::floor(turn / 360.0)
}

/// The value of an `add` for the ego and its ghost: they are moved in the same message.
fn add_ego() -> Value {
    let texts =
        [EGO_ROUTE, EGO, "now", "first", "base", "0", "current", "max", "current", "", "", ""];
    let mut list: Vec<Value> = texts.iter().map(|t| Value::Text((*t).to_owned())).collect();
    list.extend([Value::Int(0), Value::Int(0)]);
    Value::Compound(list)
}

impl TrafficSource for SumoTraffic {
    type Error = TrafficError;

    fn advance(&mut self, now: Time, ego: &EgoState) -> Result<&Scene, TrafficError> {
        ego.check_finite()?;
        let mut at = match self.step_time {
            Some(at) => at,
            None => {
                self.start(ego)?;
                self.step(ego)?;
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
            self.step(ego)?;
            at = at.plus_nanos(STEP_NS);
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
        Ok(&self.scene)
    }
}
