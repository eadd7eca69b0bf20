//! From options to the scenario that is driven.

use std::path::Path;

use planner::DeciderKind;
use planner::decider::MobilConfig;
use serde::Deserialize;
use serde::de::value::{Error as ValueError, StrDeserializer};
use sim::{Scenario, TrafficKind};
use traffic_client::Mode;

use super::Args;
use crate::failure::Failure;

/// The scenario with the command line's changes.
///
/// # Errors
/// [`Failure::Input`] names the file and key, or the option that cannot be used.
pub(super) fn scenario(args: &Args) -> Result<Scenario, Failure> {
    refuse_unsupported(args)?;
    let mut scenario = load(&args.scenario)?;
    if let Some(road) = &args.road {
        scenario.road.clone_from(road);
    }
    if let Some(truck) = &args.truck {
        scenario.truck.file.clone_from(truck);
    }
    if let Some(payload_kg) = args.payload_kg {
        scenario.truck.payload_kg = payload_kg;
    }
    if let Some(duration_s) = args.duration {
        scenario.run.duration_s = duration_s;
    }
    let changes = TrafficChanges {
        source: args.traffic.as_deref(),
        mode: args.mode.as_deref(),
        manifest: args.manifest.as_deref(),
        on_failure: args.on_traffic_failure.as_deref(),
    };
    changes.apply(&mut scenario)?;
    if let Some(planner) = &args.speed_planner {
        scenario.stack.speed_planner = word("--speed-planner", planner, "cruise or predictive")?;
    }
    if let Some(decider) = &args.decider {
        (scenario.stack.decider, scenario.policy_file) = decider_kind(decider)?;
    }
    Ok(scenario)
}

/// The seed of a run: the one given, else the one of the manifest that is repeated, else 1.
///
/// # Errors
/// [`Failure::Input`] for a manifest that cannot be read.
pub(in crate::cmd) fn seed(given: Option<u64>, scenario: &Scenario) -> Result<u64, Failure> {
    match (given, &scenario.traffic.manifest) {
        (Some(seed), _) => Ok(seed),
        (None, Some(file)) => {
            sim::read_manifest(file.as_ref()).map(|m| m.seed).map_err(Failure::input)
        }
        (None, None) => Ok(1),
    }
}

/// What options say about the traffic.
#[derive(Debug, Default)]
pub(in crate::cmd) struct TrafficChanges<'a> {
    pub(in crate::cmd) source: Option<&'a str>,
    pub(in crate::cmd) mode: Option<&'a str>,
    pub(in crate::cmd) manifest: Option<&'a Path>,
    pub(in crate::cmd) on_failure: Option<&'a str>,
}

impl TrafficChanges<'_> {
    /// Puts them into a scenario.
    ///
    /// # Errors
    /// [`Failure::Input`] names the option, or what does not go together.
    pub(in crate::cmd) fn apply(&self, scenario: &mut Scenario) -> Result<(), Failure> {
        let traffic = &mut scenario.traffic;
        match self.source.map(|source| (source, source.split_once(':'))) {
            None => {}
            Some((_, Some(("replay", file)))) if !file.is_empty() => {
                traffic.source = TrafficKind::Replay;
                traffic.replay.file = Some(file.to_owned());
                traffic.mode = None;
            }
            Some((source, _)) => {
                let known = "native, sumo, replay:FILE or none";
                traffic.source = word("--traffic", source, known)?;
                if traffic.source == TrafficKind::Replay && traffic.replay.file.is_none() {
                    return Err(Failure::Input(format!("--traffic {source}: expected {known}")));
                }
            }
        }
        if let Some(mode) = self.mode {
            traffic.mode = Some(word("--mode", mode, "pure, inter, re or rep")?);
        }
        if let Some(manifest) = self.manifest {
            traffic.manifest = Some(manifest.display().to_string());
            traffic.mode.get_or_insert(Mode::Re);
        }
        if let Some(on_failure) = self.on_failure {
            traffic.on_failure = word("--on-traffic-failure", on_failure, "stop or native")?;
        }
        if self.mode == Some("re") && traffic.manifest.is_none() {
            let why =
                "--mode re: needs --manifest FILE, the traffic.manifest.toml of the run to repeat";
            return Err(Failure::Input(why.to_owned()));
        }
        if self.mode == Some("rep") && traffic.source != TrafficKind::Replay {
            return Err(Failure::Input("--mode rep: needs --traffic replay:FILE".to_owned()));
        }
        match scenario.violations() {
            wrong if wrong.is_empty() => Ok(()),
            wrong => Err(Failure::Input(wrong.join("; "))),
        }
    }
}

/// A file if it names one, else a built-in scenario.
pub(in crate::cmd) fn load(name: &str) -> Result<Scenario, Failure> {
    if name.ends_with(".toml") || name.contains(std::path::MAIN_SEPARATOR) {
        Scenario::load(name.as_ref()).map_err(Failure::input)
    } else {
        Scenario::builtin(name).map_err(Failure::input)
    }
}

/// What the contract names and this version does not do.
fn refuse_unsupported(args: &Args) -> Result<(), Failure> {
    match args.vehicle.split_once(':').map_or(&*args.vehicle, |(kind, _)| kind) {
        "direct" => {}
        "bus" | "can" | "socketcand" => {
            return Err(Failure::unsupported(&format!("--vehicle {}", args.vehicle)));
        }
        _ => return Err(Failure::Input(format!("--vehicle {}: expected direct", args.vehicle))),
    }
    for (asked, flag) in [(args.ros2, "--ros2"), (args.foxglove, "--foxglove")] {
        if asked {
            return Err(Failure::unsupported(flag));
        }
    }
    Ok(())
}

/// `keep`, `mobil`, `external`, `rules:` with the paper's distance in metres, or `dqn:` with a file
/// of weights.
fn decider_kind(text: &str) -> Result<(DeciderKind, Option<String>), Failure> {
    let kind = match text.split_once(':') {
        None if text == "keep" => DeciderKind::KeepLane,
        None if text == "mobil" => DeciderKind::Mobil(MobilConfig::default()),
        None if text == "external" => DeciderKind::External,
        Some(("dqn", file)) if !file.is_empty() => {
            return Ok((DeciderKind::Dqn, Some(file.to_owned())));
        }
        Some(("rules", distance)) if distance.parse::<f64>().is_ok() => {
            DeciderKind::Rules { distance_m: distance.parse().unwrap_or(f64::NAN) }
        }
        _ => {
            let known = "keep, rules:50, rules:100, rules:150, mobil, external or dqn:FILE";
            return Err(Failure::Input(format!("--decider {text}: expected {known}")));
        }
    };
    kind.check().map_err(|e| Failure::Input(format!("--decider {text}: {e}")))?;
    Ok((kind, None))
}

/// A field-less value by its word in a scenario file.
fn word<'a, T: Deserialize<'a>>(flag: &str, value: &'a str, known: &str) -> Result<T, Failure> {
    T::deserialize(StrDeserializer::<ValueError>::new(value))
        .map_err(|_| Failure::Input(format!("{flag} {value}: expected {known}")))
}
