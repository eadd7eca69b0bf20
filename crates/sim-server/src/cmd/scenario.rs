//! `scenario list`, `scenario show NAME`: the built-in scenarios.

use clap::Subcommand;
use sim::Scenario;

use crate::failure::Failure;
use crate::output;
use crate::provenance::SCHEMA;

/// The built-in scenarios.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Names and what they are for.
    List {
        /// Prints one JSON object instead of a table.
        #[arg(long)]
        json: bool,
    },
    /// The text of one, as a start for an own file.
    Show {
        /// Name of the scenario.
        name: String,
    },
}

pub(crate) fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Show { name } => {
            output::result(Scenario::builtin_text(name).map_err(Failure::input)?)
        }
        Command::List { json } => {
            let all: Vec<Scenario> = Scenario::names()
                .map(Scenario::builtin)
                .collect::<Result<_, _>>()
                .map_err(Failure::work)?;
            if *json {
                let list: Vec<_> = all
                    .iter()
                    .map(|s| serde_json::json!({ "name": s.name, "description": s.description }))
                    .collect();
                let object = serde_json::json!({ "schema": SCHEMA, "scenarios": list });
                output::result(&object.to_string())
            } else {
                let lines: Vec<String> =
                    all.iter().map(|s| format!("{:16} {}", s.name, s.description)).collect();
                output::result(&lines.join("\n"))
            }
        }
    }
}
