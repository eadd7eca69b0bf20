//! `identify`: measured drives of a truck that is in order into a truck file, figure by figure.

use std::path::PathBuf;

use clap::Parser;
use diagnosis::Finding;
use diagnosis::identify::{Correlated, Identification, Identified, NotTold, identify};
use dynamics::TruckParameters;
use serde::Serialize;

use super::{diagnose, rounded};
use crate::failure::Failure;
use crate::out_folder::Out;
use crate::output;
use crate::progress::Stages;
use crate::provenance::{GIT_REVISION, Provenance, VERSION};
use shell::Threads;

/// Significant digits of a printed figure.
const DIGITS: usize = 5;
/// What is written, beside drives that are made.
const RESULTS: &[&str] = &["identify.json", "*.identified.toml"];

/// Finds the figures of a truck in measured drives: gear ratios, wheel radius, resistance, engine,
/// brakes, steering, tyres. Writes the truck file and identify.json.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The truck file to start from (`truck new` makes one of a data sheet), or a built-in name.
    #[arg(long, value_name = "T")]
    truck: String,
    /// Folder of measured drives of the truck in order, or recordings of this program.
    #[arg(long, value_name = "DIR")]
    drives: PathBuf,
    /// Seed of the logger's noise where the drives are recordings of this program.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    out: Out,
    /// Prints identify.json on stdout instead of sentences.
    #[arg(long)]
    json: bool,
}

/// `identify.json`.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    provenance: Provenance,
    truck: &'a str,
    drives: &'a [String],
    truck_file: &'a str,
    figures: &'a [Identified],
    not_told: &'a [NotTold],
    correlated: &'a [Correlated],
    findings: &'a [Finding],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let out = args.out.folder(RESULTS)?;
    let truck = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let drives = diagnose::read(&args.drives, &truck, &out, "drives", args.seed)?;
    let stages = Stages::start();
    stages.show("identifying the truck");
    let found = identify(&truck, &drives, &Threads::available()).map_err(Failure::input)?;
    stages.finish();
    let name = format!("{}.identified", diagnosis::file_name(&truck.name));
    let file = format!("{name}.toml");
    let source = format!(
        "identified from {} ({}), tractrix {VERSION} {GIT_REVISION}",
        args.drives.display(),
        found.drives.join(", ")
    );
    out.write(&file, found.truck_file(&name, &source).map_err(Failure::input)?)?;
    let report = Report {
        provenance: Provenance::of_seed(args.seed),
        truck: &args.truck,
        drives: &found.drives,
        truck_file: &file,
        figures: &found.figures,
        not_told: &found.not_told,
        correlated: &found.correlated,
        findings: &found.findings,
    };
    let text = serde_json::to_string_pretty(&report).map_err(Failure::work)?;
    out.write("identify.json", &text)?;
    let said = sentences(&found, &out.path().join(&file).display().to_string());
    out.keep();
    output::result(&if args.json { text } else { said })
}

/// What was found, for people.
fn sentences(found: &Identification, file: &str) -> String {
    let mut lines = vec![format!(
        "{} figures from {} drives: was, is, 90 % interval",
        found.figures.len(),
        found.drives.len()
    )];
    for f in &found.figures {
        let [low, high] = f.interval_90;
        let factor = if f.is_factor { " (factor)" } else { "" };
        let path = format!("{}{factor}", f.path);
        lines.push(format!(
            "  {path:<44} {:>10} {:>10} {:>10} to {}",
            rounded(f.nominal, DIGITS),
            rounded(f.value, DIGITS),
            rounded(low, DIGITS),
            rounded(high, DIGITS)
        ));
    }
    if !found.not_told.is_empty() {
        lines.push("What could not be told keeps its figure:".to_owned());
        lines.extend(found.not_told.iter().map(|n| format!("  {}: {}", n.path, n.why)));
    }
    for pair in &found.correlated {
        let [a, b] = &pair.figures;
        lines.push(format!("  {a} and {b} move together ({:+.2})", pair.correlation));
    }
    lines.extend(super::diagnose::defects(&found.findings));
    lines.push(format!("Truck file: {file}"));
    lines.join("\n")
}
