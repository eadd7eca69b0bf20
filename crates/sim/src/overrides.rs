//! Changes to a scenario in words, as a command line or a notebook gives them.
//!
//! | word | values |
//! |---|---|
//! | `traffic` | `native`, `sumo`, `replay:FILE`, `none` |
//! | `mode` | `pure`, `inter`, `re` (with a manifest), `rep` (recorded traffic) |
//! | `decider` | `keep`, `rules:METRES`, `mobil`, `rollout`, `external`, `dqn:FILE` |
//! | `speed_planner` | `cruise`, `predictive` |
//! | `on_traffic_failure` | `stop`, `native` |

use std::path::Path;

use planner::DeciderKind;
use planner::decider::{MobilConfig, RolloutConfig};
use serde::Deserialize;
use serde::de::value::{Error as ValueError, StrDeserializer};
use traffic_client::Mode;

use crate::{Scenario, SimError, TrafficKind};

/// Changes to a scenario; what is `None` stays as the scenario has it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Overrides<'a> {
    /// Another road, as a scenario names it.
    pub road: Option<&'a str>,
    /// Another truck: a file or a built-in name.
    pub truck: Option<&'a str>,
    /// Another payload on the trailer, kg.
    pub payload_kg: Option<f64>,
    /// Ends the run after this simulated time, s.
    pub duration_s: Option<f64>,
    /// The run goes on when a wheel leaves the road.
    pub allow_off_road: bool,
    /// The other vehicles.
    pub traffic: Option<&'a str>,
    /// How the traffic goes with the ego.
    pub mode: Option<&'a str>,
    /// `traffic.manifest.toml` of the run that mode `re` repeats.
    pub manifest: Option<&'a Path>,
    /// What happens when the traffic source fails.
    pub on_traffic_failure: Option<&'a str>,
    /// Who decides on lane changes.
    pub decider: Option<&'a str>,
    /// Who sets the reference speed.
    pub speed_planner: Option<&'a str>,
}

impl Overrides<'_> {
    /// Puts the changes into a scenario.
    ///
    /// # Errors
    /// [`SimError::Override`] names the word that cannot be used, [`SimError::Scenario`] the keys
    /// that do not go together.
    pub fn apply(&self, scenario: &mut Scenario) -> Result<(), SimError> {
        if let Some(road) = self.road {
            road.clone_into(&mut scenario.road);
        }
        if let Some(truck) = self.truck {
            truck.clone_into(&mut scenario.truck.file);
        }
        if let Some(payload_kg) = self.payload_kg {
            scenario.truck.payload_kg = payload_kg;
        }
        if let Some(duration_s) = self.duration_s {
            scenario.run.duration_s = duration_s;
        }
        scenario.run.allow_off_road |= self.allow_off_road;
        self.change_traffic(scenario)?;
        if let Some(planner) = self.speed_planner {
            let known = "cruise or predictive";
            scenario.stack.speed_planner = word("speed_planner", planner, known)?;
        }
        if let Some(decider) = self.decider {
            (scenario.stack.decider, scenario.policy_file) = decider_kind(decider)?;
        }
        scenario.check()
    }

    fn change_traffic(&self, scenario: &mut Scenario) -> Result<(), SimError> {
        let traffic = &mut scenario.traffic;
        match self.traffic.map(|source| (source, source.split_once(':'))) {
            None => {}
            Some((_, Some(("replay", file)))) if !file.is_empty() => {
                traffic.source = TrafficKind::Replay;
                traffic.replay.file = Some(file.to_owned());
                traffic.mode = None;
            }
            Some((source, _)) => {
                let known = "native, sumo, replay:FILE or none";
                traffic.source = word("traffic", source, known)?;
                if traffic.source == TrafficKind::Replay && traffic.replay.file.is_none() {
                    return Err(refused("traffic", source, &format!("expected {known}")));
                }
            }
        }
        if let Some(mode) = self.mode {
            traffic.mode = Some(word("mode", mode, "pure, inter, re or rep")?);
        }
        if let Some(manifest) = self.manifest {
            traffic.manifest = Some(manifest.display().to_string());
            traffic.mode.get_or_insert(Mode::Re);
        }
        if let Some(on_failure) = self.on_traffic_failure {
            traffic.on_failure = word("on_traffic_failure", on_failure, "stop or native")?;
        }
        if self.mode == Some("re") && traffic.manifest.is_none() {
            let why = "needs a manifest, the traffic.manifest.toml of the run to repeat";
            return Err(refused("mode", "re", why));
        }
        if self.mode == Some("rep") && traffic.source != TrafficKind::Replay {
            return Err(refused("mode", "rep", "needs recorded traffic, replay:FILE"));
        }
        Ok(())
    }
}

/// A decider and its file of weights by their words: `keep`, `mobil`, `rollout`, `external`, `rules:` with the
/// paper's distance in metres, `dqn` for the trained policy of the program, or `dqn:` with a file of
/// weights.
pub(crate) fn decider_kind(text: &str) -> Result<(DeciderKind, Option<String>), SimError> {
    let kind = match text.split_once(':') {
        None if text == "keep" => DeciderKind::KeepLane,
        None if text == "mobil" => DeciderKind::Mobil(MobilConfig::default()),
        None if text == "rollout" => DeciderKind::Rollout(RolloutConfig::default()),
        None if text == "external" => DeciderKind::External,
        None if text == "dqn" => {
            return Ok((DeciderKind::Dqn, Some(crate::world::BUILTIN_POLICY.to_owned())));
        }
        Some(("dqn", file)) if !file.is_empty() => {
            return Ok((DeciderKind::Dqn, Some(file.to_owned())));
        }
        Some(("rules", distance)) if distance.parse::<f64>().is_ok() => {
            DeciderKind::Rules { distance_m: distance.parse().unwrap_or(f64::NAN) }
        }
        _ => {
            let known =
                "keep, rules:50, rules:100, rules:150, mobil, rollout, external, dqn or dqn:FILE";
            return Err(refused("decider", text, &format!("expected {known}")));
        }
    };
    kind.check().map_err(|e| refused("decider", text, &e.to_string()))?;
    Ok((kind, None))
}

/// A decider by its word, as `--decider` has it; a policy is `dqn`, whatever its file.
#[must_use]
pub fn decider_word(kind: &DeciderKind) -> String {
    match kind {
        DeciderKind::KeepLane => "keep".to_owned(),
        DeciderKind::Rules { distance_m } => format!("rules:{distance_m}"),
        DeciderKind::Mobil(_) => "mobil".to_owned(),
        DeciderKind::Rollout(_) => "rollout".to_owned(),
        DeciderKind::Dqn => "dqn".to_owned(),
        DeciderKind::External => "external".to_owned(),
    }
}

/// A field-less value by its word in a scenario file.
fn word<'a, T>(option: &'static str, value: &'a str, known: &str) -> Result<T, SimError>
where
    T: Deserialize<'a>,
{
    T::deserialize(StrDeserializer::<ValueError>::new(value))
        .map_err(|_| refused(option, value, &format!("expected {known}")))
}

pub(crate) fn refused(option: &'static str, value: &str, why: &str) -> SimError {
    SimError::Override { option, value: value.to_owned(), why: why.to_owned() }
}
