//! `drives from-can LOG`: a log of a truck's bus into measured drives.

use std::path::PathBuf;

use clap::{Parser, Subcommand};
use diagnosis::from_log::{Assigned, Dbc, Job, LogFile, Map, Project, Report};
use dynamics::TruckParameters;
use planner::localise::MapProjection;
use road::GeoReference;
use serde::Serialize;

use crate::cli::{not_negative, positive};
use crate::failure::Failure;
use crate::out_folder::Out;
use crate::output;
use crate::provenance::Provenance;

/// What is written, beside a table for each drive.
const RESULTS: &[&str] = &["drives.toml", "conversion.json", "map.csv"];

/// Measured drives.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Makes drives of logs of a truck's bus, for `diagnose` and `replay`.
    FromCan(Args),
}

/// Which logs, of which truck.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Logs of candump, in either form, or compressed (`.gz`).
    #[arg(value_name = "LOG", required = true)]
    logs: Vec<PathBuf>,
    /// The truck that was logged: a truck file, or a built-in name.
    #[arg(long)]
    truck: String,
    /// The road that was driven; satellite fixes (VP1) say where on it.
    #[arg(long, value_name = "ROAD")]
    map: Option<String>,
    /// Where on the road the first drive of every log begins: from there the wheels count. For roads
    /// that do not say where on earth they lie.
    #[arg(long, value_name = "M", requires = "map", value_parser = not_negative)]
    start_s_m: Option<f64>,
    /// Mass on the load sheet, one for all logs or one for each; without it what the bus says (CVW).
    #[arg(long, value_name = "M,…", value_delimiter = ',', value_parser = positive)]
    mass_kg: Vec<f64>,
    /// What the truck's maker sends beyond the standard: a DBC.
    #[arg(long, value_name = "FILE")]
    dbc: Option<PathBuf>,
    /// A signal of the DBC for a column; with `-` before it the sign is turned. Signals with a
    /// column's name, or with the number (SPN) of what it holds, are found without.
    #[arg(long, value_name = "COLUMN=[MESSAGE.]SIGNAL", requires = "dbc")]
    signal: Vec<Assigned>,
    /// A standstill of so long ends a drive.
    #[arg(long, value_name = "S", default_value = "120", value_parser = positive)]
    standstill_s: f64,
    /// Shorter drives are left out.
    #[arg(long, value_name = "S", default_value = "60", value_parser = positive)]
    min_drive_s: f64,
    #[command(flatten)]
    out: Out,
}

/// `conversion.json`.
#[derive(Serialize)]
struct Content<'a> {
    #[serde(flatten)]
    provenance: Provenance,
    #[serde(flatten)]
    report: &'a Report,
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> Result<(), Failure> {
    let Command::FromCan(args) = command;
    let truck = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let map = args.map.as_deref().map(|m| Map::load(m, args.start_s_m, &projection));
    let map = map.transpose().map_err(Failure::input)?;
    let dbc = args.dbc.as_deref().map(|file| Dbc::read(file, &args.signal));
    let dbc = dbc.transpose().map_err(Failure::input)?;
    let masses = args.mass_kg.len();
    if masses > 1 && masses != args.logs.len() {
        let logs = args.logs.len();
        return Err(Failure::Input(format!("--mass-kg: {masses} masses for {logs} logs")));
    }
    let out = args.out.folder(RESULTS)?;
    let mass_kg = |k: usize| args.mass_kg.get(k).or(args.mass_kg.first()).copied();
    let numbered = args.logs.iter().enumerate();
    let logs: Vec<LogFile<'_>> =
        numbered.map(|(k, path)| LogFile { path, named: path, mass_kg: mass_kg(k) }).collect();
    let job = Job {
        truck: &truck,
        truck_name: &args.truck,
        logs: &logs,
        map: map.as_ref(),
        dbc: dbc.as_ref(),
        standstill_s: args.standstill_s,
        least_s: args.min_drive_s,
    };
    let made = job.run().map_err(Failure::input)?;
    made.write(&mut |name, text| out.write(name, text))?;
    let content = Content { provenance: Provenance::of_seed(0), report: &made.report };
    out.write("conversion.json", serde_json::to_string_pretty(&content).map_err(Failure::work)?)?;
    let said = made.report.sentences();
    out.keep();
    output::result(&said)
}

/// The projection of a map.
fn projection(reference: &GeoReference) -> Result<Project, String> {
    let projection = MapProjection::new(reference).map_err(|e| e.to_string())?;
    Ok(Box::new(move |latitude_deg, longitude_deg| {
        projection.to_map_m(latitude_deg, longitude_deg)
    }))
}
