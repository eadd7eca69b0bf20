//! What the body of `POST /api/v1/sessions` asks for.

use std::path::Path;

use serde::Deserialize;
use sim::{Overrides, Scenario};
use utoipa::ToSchema;

use super::jobs::among;
use super::openapi::{PaceValue, StateWord};
use crate::session::{Pace, State, Wanted};

/// A session to begin: `scenario` or `toml`, and changes, as those of the command line.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct NewSession {
    /// Name of a built-in scenario.
    #[schema(nullable = false)]
    scenario: Option<String>,
    /// Text of a scenario. It names built-in roads and trucks, or files below `--assets`.
    #[schema(nullable = false)]
    toml: Option<String>,
    /// Seed of everything that is drawn at random; otherwise the scenario's.
    #[schema(minimum = 0, maximum = 18_446_744_073_709_551_615_u64, nullable = false)]
    seed: Option<u64>,
    /// `stopped` (the default), `paused` or `playing`.
    #[schema(value_type = Option<StateWord>, nullable = false)]
    state: Option<String>,
    /// Simulated seconds per second, `realtime` or `max`.
    #[schema(value_type = Option<PaceValue>, nullable = false)]
    pace: Option<serde_json::Value>,
    #[schema(nullable = false)]
    road: Option<String>,
    #[schema(nullable = false)]
    truck: Option<String>,
    /// Payload on the trailer, kg.
    #[schema(nullable = false)]
    payload_kg: Option<f64>,
    /// Simulated time of the run, s.
    #[schema(nullable = false)]
    duration_s: Option<f64>,
    allow_off_road: bool,
    /// `native`, `sumo`, `replay:FILE` or `none`.
    #[schema(nullable = false)]
    traffic: Option<String>,
    /// `pure`, `inter` or `rep`.
    #[schema(nullable = false)]
    mode: Option<String>,
    /// Who decides on lane changes, as `--decider` has it.
    #[schema(nullable = false)]
    decider: Option<String>,
    /// `cruise` or `predictive`.
    #[schema(nullable = false)]
    speed_planner: Option<String>,
    /// How the stack reaches the truck: `direct`, or over a `bus` in memory.
    #[schema(value_type = Option<VehicleWord>, nullable = false)]
    vehicle: Option<String>,
}

/// The ways to a truck that are not outside of the program.
#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[expect(dead_code, reason = "a schema")]
enum VehicleWord {
    Direct,
    Bus,
}

/// Reads the body.
///
/// # Errors
/// Names the key and what it is to be.
pub(super) fn read(body: &[u8]) -> Result<NewSession, String> {
    let wanted: NewSession = serde_json::from_slice(body).map_err(|e| e.to_string())?;
    match (&wanted.scenario, &wanted.toml) {
        (Some(_), Some(_)) => return Err("scenario and toml exclude each other".to_owned()),
        (None, None) => {
            return Err(
                "scenario or toml is missing: the name of a built-in scenario, or the text \
                        of one"
                    .to_owned(),
            );
        }
        _ => {}
    }
    wanted.state()?;
    wanted.pace()?;
    Ok(wanted)
}

impl NewSession {
    fn state(&self) -> Result<State, String> {
        match self.state.as_deref() {
            None | Some("stopped") => Ok(State::Stopped),
            Some("paused") => Ok(State::Paused),
            Some("playing") => Ok(State::Playing),
            Some(other) => Err(format!("state = {other:?}: expected stopped, paused or playing")),
        }
    }

    fn pace(&self) -> Result<Pace, String> {
        let Some(pace) = &self.pace else { return Ok(Pace::REALTIME) };
        Pace::from_json(pace).ok_or_else(|| format!("pace = {pace}: expected {}", Pace::VALUES))
    }

    /// The scenario with its changes.
    ///
    /// # Errors
    /// Names the scenario, key or value that cannot be used.
    pub(super) fn build(&self) -> Result<Wanted, String> {
        let scenario = match (&self.scenario, &self.toml) {
            (Some(name), _) => Scenario::builtin(name),
            (None, text) => Scenario::from_toml_str("toml", text.as_deref().unwrap_or_default()),
        };
        let mut scenario = scenario.map_err(|e| e.to_string())?;
        let changes = Overrides {
            road: self.road.as_deref(),
            truck: self.truck.as_deref(),
            payload_kg: self.payload_kg,
            duration_s: self.duration_s,
            allow_off_road: self.allow_off_road,
            traffic: self.traffic.as_deref(),
            mode: self.mode.as_deref(),
            manifest: None,
            on_traffic_failure: None,
            decider: self.decider.as_deref(),
            speed_planner: self.speed_planner.as_deref(),
        };
        changes.apply(&mut scenario).map_err(|e| e.to_string())?;
        let seed = scenario.seed(self.seed).map_err(|e| e.to_string())?;
        let vehicle = match self.vehicle.as_deref() {
            None | Some("direct") => "direct".to_owned(),
            Some("bus") => "bus".to_owned(),
            Some(other) => return Err(format!("vehicle = {other:?}: expected direct or bus")),
        };
        Ok(Wanted { scenario, seed, state: self.state()?, pace: self.pace()?, vehicle })
    }
}

/// Refuses a scenario that names a file outside `assets`, or a program; the files that it may name
/// are found there.
///
/// # Errors
/// Names the key.
pub(super) fn keep_inside(scenario: &mut Scenario, assets: Option<&Path>) -> Result<(), String> {
    let mut inside = Vec::new();
    for (key, file) in scenario.files_mut() {
        *file = among(assets, key, file)?.display().to_string();
        inside.push(key);
    }
    match scenario.reaches_out().into_iter().find(|key| !inside.contains(key)) {
        Some(key) => Err(format!("{key} names something outside the program")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn highway() -> Scenario {
        Scenario::builtin("highway").unwrap()
    }

    #[test]
    fn a_body_names_one_scenario_and_only_known_keys() {
        for (body, words) in [
            ("{}", "scenario or toml is missing"),
            (r#"{"scenario": "flat", "toml": ""}"#, "exclude each other"),
            (r#"{"scenario": "flat", "sede": 1}"#, "sede"),
            (r#"{"scenario": "flat", "state": "flying"}"#, "stopped, paused or playing"),
            (r#"{"scenario": "flat", "pace": -1}"#, "pace = -1"),
            (r#"{"scenario": "flat", "seed": 18446744073709551616}"#, "invalid type"),
            ("[1]", ""),
        ] {
            let why = read(body.as_bytes()).unwrap_err();
            assert!(why.contains(words), "{body}: {why}");
        }
        let wanted = read(br#"{"scenario": "nothing"}"#).unwrap().build();
        assert!(wanted.err().unwrap().contains("nothing"));
        let wanted = read(br#"{"scenario": "flat", "seed": 7, "decider": "rules:50"}"#).unwrap();
        assert_eq!(wanted.build().unwrap().seed, 7);
    }

    #[test]
    fn only_files_below_the_assets_may_be_named() {
        let there = tempfile::tempdir().unwrap();
        let assets = there.path().join("assets");
        std::fs::create_dir(&assets).unwrap();
        std::fs::write(assets.join("road.csv"), "s_m,z_m").unwrap();
        std::fs::write(there.path().join("secret.csv"), "s_m,z_m").unwrap();
        std::os::unix::fs::symlink("../secret.csv", assets.join("link.csv")).unwrap();
        assert!(keep_inside(&mut highway(), None).is_ok());
        let with_road = |road: &str| Scenario { road: road.to_owned(), ..highway() };
        assert!(keep_inside(&mut with_road("road.csv"), None).is_err());
        let mut scenario = with_road("road.csv");
        keep_inside(&mut scenario, Some(&assets)).unwrap();
        assert!(Path::new(&scenario.road).is_absolute());
        let absolute = assets.join("road.csv").display().to_string();
        for road in ["../secret.csv", "link.csv", "nothing.csv", "/etc/passwd", &absolute] {
            let why = keep_inside(&mut with_road(road), Some(&assets)).unwrap_err();
            assert!(why.contains("road") && why.contains("assets"), "{why}");
        }
        let mut sumo = highway();
        sumo.traffic.sumo.binary = Some("/bin/sh".to_owned());
        let why = keep_inside(&mut sumo, Some(&assets)).unwrap_err();
        assert!(why.contains("traffic.sumo"), "{why}");
    }
}
