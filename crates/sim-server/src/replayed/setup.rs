//! The stack of a recording, built again of what the file says about it.

use std::path::Path;
use std::sync::Arc;

use j1939::truck::DriverSetup;
use planner::{Stack, StackConfig};
use recording::About;
use road::Road;
use sim::Scenario;
use toml::{Table, Value};
use tractrix_core::VehicleLimits;

use crate::failure::Failure;
use crate::output;
use crate::provenance::GIT_REVISION;

/// What the stack is built of, and where it drives.
pub(crate) struct Setup {
    config: StackConfig,
    policy_file: Option<String>,
    road: Arc<Road>,
    /// The road with the limit that holds now beside its own ones, and that limit, m/s.
    limited: Option<(f64, Arc<Road>)>,
}

impl Setup {
    /// From what a recording says, with these changes `KEY=VALUE`, on another road if one is named.
    ///
    /// # Errors
    /// [`Failure::Input`] names what the file lacks, or the key or road that cannot be used.
    pub(crate) fn new(
        file: &Path,
        about: &About,
        changes: &[String],
        other_road: Option<&str>,
    ) -> Result<Self, Failure> {
        let lacks = |what: &str| Failure::file(file, format!("it has no {what}"));
        let attached = about.text("stack.toml").ok_or_else(|| lacks("stack.toml"))?;
        let mut table: Table =
            attached.parse().map_err(|e| Failure::file(file, format!("stack.toml: {e}")))?;
        for change in changes {
            set(&mut table, change)?;
        }
        let config = Value::Table(table).try_into::<StackConfig>();
        let config = config.map_err(|e| match changes.is_empty() {
            true => Failure::file(file, format!("stack.toml: {e}")),
            false => Failure::Input(format!("--set {}: {e}", changes.join(" --set "))),
        })?;
        let scenario = match about.text("scenario.toml") {
            Some(text) => Some(
                Scenario::from_toml_str(&file.display().to_string(), text)
                    .map_err(Failure::input)?,
            ),
            None => None,
        };
        let driven = about.value("run", "road");
        let road = match (other_road, about.text("road.xodr"), &scenario, driven) {
            (Some(name), ..) => Road::load(name),
            (None, Some(text), ..) => Road::from_xodr(driven.unwrap_or("road.xodr"), text),
            (None, None, Some(scenario), _) => Ok(scenario.load_road().map_err(Failure::input)?),
            (None, None, None, Some(name)) => Road::load(name),
            (None, None, None, None) => return Err(lacks("road in its record `run`")),
        };
        let road = road.map_err(Failure::input)?;
        match about.value("run", "road_fingerprint") {
            None if other_road.is_none() && about.text("road.xodr").is_some() => {}
            None => output::note("the recording cannot tell whether the road is still the same"),
            Some(driven) => check_road(&road, driven).map_err(|why| Failure::file(file, why))?,
        }
        let revision = about.value("run", "git_revision").unwrap_or("unknown");
        if revision != GIT_REVISION {
            output::note(&format!("recorded by revision {revision}, this is {GIT_REVISION}"));
        }
        let policy_file = scenario.and_then(|scenario| scenario.policy_file);
        Ok(Self { config, policy_file, road: Arc::new(road), limited: None })
    }

    /// The road that was driven.
    pub(crate) const fn whole_road(&self) -> &Arc<Road> {
        &self.road
    }

    /// The stack for a truck.
    ///
    /// # Errors
    /// [`Failure::Input`] names the key or file that cannot be used.
    pub(crate) fn stack(&self, limits: &VehicleLimits) -> Result<Stack, Failure> {
        let policy = self.policy_file.as_deref().map(Path::new);
        sim::stack_of(self.config.clone(), limits, policy).map_err(Failure::input)
    }

    /// The road with a limit beside its own ones, m/s.
    pub(crate) fn road(&mut self, cap_m_s: Option<f64>) -> Arc<Road> {
        if cap_m_s != self.limited.as_ref().map(|(cap_m_s, _)| *cap_m_s) {
            self.limited = cap_m_s.map(|cap| (cap, Arc::new(self.road.with_limit_cap(cap))));
        }
        Arc::clone(self.limited.as_ref().map_or(&self.road, |(_, road)| road))
    }
}

/// Whether a road is the one that was driven, by its fingerprint; else why not.
///
/// # Errors
/// Says which road it is not, with both fingerprints.
pub(crate) fn check_road(road: &Road, driven: &str) -> Result<(), String> {
    let (name, found) = (road.name(), sim::road_fingerprint(road));
    if found == driven {
        return Ok(());
    }
    Err(format!("road {name} is not the one that was driven ({found}, not {driven})"))
}

/// What the truck's driver on its bus was set up with.
///
/// # Errors
/// [`Failure::Input`] if it was not driven over a bus, or by another version.
pub(crate) fn driver_setup(file: &Path, about: &About) -> Result<DriverSetup, Failure> {
    let Some(json) = about.driver_json() else {
        let why = "it has no frames of a bus (run --vehicle bus); use --from ego";
        return Err(Failure::file(file, why));
    };
    let wrong = |e| Failure::file(file, format!("what drove the truck is not understood: {e}"));
    serde_json::from_str(json).map_err(wrong)
}

/// Puts `KEY=VALUE` into a configuration, where the key is there already.
fn set(table: &mut Table, change: &str) -> Result<(), Failure> {
    let wrong = |why: &str| Failure::Input(format!("--set {change}: {why}"));
    let (key, text) = change.split_once('=').ok_or_else(|| wrong("expected KEY=VALUE"))?;
    let (path, last) = key.rsplit_once('.').unwrap_or(("", key));
    let mut at = table;
    for part in path.split('.').filter(|part| !part.is_empty()) {
        at = at
            .get_mut(part)
            .and_then(Value::as_table_mut)
            .ok_or_else(|| wrong(&format!("there is no table {part}")))?;
    }
    let known = at.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
    let old = at.get_mut(last).ok_or_else(|| wrong(&format!("there are {known}")))?;
    let parsed = format!("value = {text}").parse::<Table>().ok();
    let value = parsed.and_then(|mut t| t.remove("value"));
    *old = value.unwrap_or_else(|| Value::String(text.to_owned()));
    Ok(())
}
