//! From options to the scenario that is driven.

use planner::DeciderKind;
use planner::decider::MobilConfig;
use serde::Deserialize;
use serde::de::value::{Error as ValueError, StrDeserializer};
use sim::Scenario;

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
    if let Some(traffic) = &args.traffic {
        scenario.traffic.source = word("--traffic", traffic, "native or none")?;
    }
    if let Some(planner) = &args.speed_planner {
        scenario.stack.speed_planner = word("--speed-planner", planner, "cruise or predictive")?;
    }
    if let Some(decider) = &args.decider {
        scenario.stack.decider = decider_kind(decider)?;
    }
    Ok(scenario)
}

/// A file if it names one, else a built-in scenario.
fn load(name: &str) -> Result<Scenario, Failure> {
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
    let asked_for = |option: &Option<String>, flag: &str, kinds: &[&str]| match option {
        Some(value) if kinds.iter().any(|kind| value.split(':').next() == Some(kind)) => {
            Err(Failure::unsupported(&format!("{flag} {value}")))
        }
        _ => Ok(()),
    };
    asked_for(&args.traffic, "--traffic", &["sumo", "replay"])?;
    asked_for(&args.decider, "--decider", &["external", "dqn"])?;
    for (asked, flag) in
        [(args.mode.is_some(), "--mode"), (args.ros2, "--ros2"), (args.foxglove, "--foxglove")]
    {
        if asked {
            return Err(Failure::unsupported(flag));
        }
    }
    Ok(())
}

/// `keep`, `mobil`, or `rules:` with the paper's distance in metres.
fn decider_kind(text: &str) -> Result<DeciderKind, Failure> {
    let kind = match text.split_once(':') {
        None if text == "keep" => DeciderKind::KeepLane,
        None if text == "mobil" => DeciderKind::Mobil(MobilConfig::default()),
        Some(("rules", distance)) if distance.parse::<f64>().is_ok() => {
            DeciderKind::Rules { distance_m: distance.parse().unwrap_or(f64::NAN) }
        }
        _ => {
            let known = "keep, rules:50, rules:100, rules:150 or mobil";
            return Err(Failure::Input(format!("--decider {text}: expected {known}")));
        }
    };
    kind.check().map_err(|e| Failure::Input(format!("--decider {text}: {e}")))?;
    Ok(kind)
}

/// A field-less value by its word in a scenario file.
fn word<'a, T: Deserialize<'a>>(flag: &str, value: &'a str, known: &str) -> Result<T, Failure> {
    T::deserialize(StrDeserializer::<ValueError>::new(value))
        .map_err(|_| Failure::Input(format!("{flag} {value}: expected {known}")))
}
