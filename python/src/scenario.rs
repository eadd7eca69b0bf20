//! Scenarios in and out of Python as JSON text; the keys are those of the TOML files.

use pyo3::pyfunction;
use sim::{Overrides, Scenario};

use crate::fault::Fault;

/// Name and description of the built-in scenarios.
#[pyfunction]
pub(crate) fn scenario_list() -> Result<Vec<(String, String)>, Fault> {
    Scenario::names()
        .map(|name| {
            let scenario = Scenario::builtin(name).map_err(|e| Fault::of_input(&e))?;
            Ok((name.to_owned(), scenario.description))
        })
        .collect()
}

/// A scenario file or built-in scenario.
#[pyfunction]
pub(crate) fn scenario_json(name: &str) -> Result<String, Fault> {
    let scenario = Scenario::named(name).map_err(|e| Fault::of_input(&e))?;
    serde_json::to_string(&scenario).map_err(|e| Fault::Work(e.to_string()))
}

/// The scenario of a world: a name or file, or JSON text, with the changes.
pub(crate) fn changed(
    name: &str,
    json: Option<&str>,
    changes: &Overrides<'_>,
) -> Result<Scenario, Fault> {
    let mut scenario = match json {
        None => Scenario::named(name).map_err(|e| Fault::of_input(&e))?,
        Some(text) => serde_json::from_str(text)
            .map_err(|e| Fault::Value(format!("scenario: {}", without_place(&e))))?,
    };
    changes.apply(&mut scenario).map_err(|e| Fault::of_input(&e))?;
    Ok(scenario)
}

/// What is wrong; the place in a text that the user has not written says nothing.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.rsplit_once(" at line ").map_or_else(|| text.clone(), |(what, _)| what.to_owned())
}
