//! `truck sheet TRUCK`: what an on-truck program may know of a truck, as a file. `truck new`: a truck
//! file from the answers of a data sheet.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};
use dynamics::data_sheet::{DataSheet, TEMPLATE};
use dynamics::{KnownBy, TruckModel, TruckParameters};

use crate::cli::not_negative;
use crate::failure::Failure;
use crate::output;

/// Truck files.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Writes the sheet of a truck at a load: what `truck-node` plans with.
    Sheet(Args),
    /// Makes a truck file of the answers of a data sheet.
    New(NewArgs),
}

/// Which answers, and where to.
#[derive(Debug, Parser)]
pub(crate) struct NewArgs {
    /// Writes the questions, to fill in: on stdout, or where `--out` says.
    #[arg(long, required_unless_present = "from", conflicts_with = "from")]
    template: bool,
    /// The answers.
    #[arg(long, value_name = "ANSWERS.toml", requires = "out")]
    from: Option<PathBuf>,
    /// The file to write.
    #[arg(long, value_name = "TRUCK.toml")]
    out: Option<PathBuf>,
    /// Replaces a file that is there.
    #[arg(long)]
    overwrite: bool,
}

/// Which truck, and where to.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// A truck file, or a built-in name.
    truck: String,
    /// Payload.
    #[arg(long, value_name = "M", value_parser = not_negative)]
    payload_kg: f64,
    /// The sheet to write.
    #[arg(long, value_name = "SHEET.toml")]
    out: PathBuf,
    /// Replaces a file that is there.
    #[arg(long)]
    overwrite: bool,
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Sheet(args) => sheet(args),
        Command::New(args) => new(args),
    }
}

fn sheet(args: &Args) -> Result<(), Failure> {
    let parameters = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let model = TruckModel::new(parameters, args.payload_kg).map_err(Failure::input)?;
    let limits = model.vehicle_limits().map_err(Failure::input)?;
    let sheet = limits.to_sheet().map_err(Failure::input)?;
    write(&args.out, args.overwrite, &sheet)?;
    output::result(&format!(
        "{}: {} at {:.0} kg",
        args.out.display(),
        args.truck,
        limits.road_load.mass_kg
    ))
}

fn new(args: &NewArgs) -> Result<(), Failure> {
    let (Some(from), Some(out)) = (&args.from, &args.out) else {
        return match &args.out {
            Some(out) => write(out, args.overwrite, TEMPLATE),
            None => output::result(TEMPLATE.trim_end()),
        };
    };
    let answers = std::fs::read_to_string(from).map_err(|e| Failure::file(from, e))?;
    let sheet =
        DataSheet::from_toml_str(&from.display().to_string(), &answers).map_err(Failure::input)?;
    write(out, args.overwrite, &sheet.truck_file().map_err(Failure::input)?)?;
    let truck = sheet.truck().map_err(Failure::input)?;
    let estimates: Vec<&str> = truck
        .provenance
        .iter()
        .filter(|(_, origin)| origin.known_by == KnownBy::Estimate)
        .map(|(path, _)| path.as_str())
        .collect();
    output::result(&format!(
        "{}: {} from {}\n  {} figures are estimates: {}",
        out.display(),
        truck.name,
        from.display(),
        estimates.len(),
        estimates.join(", ")
    ))
}

/// Writes a file; one that is there only if asked for.
fn write(out: &Path, overwrite: bool, text: &str) -> Result<(), Failure> {
    if !overwrite && out.exists() {
        let out = out.display();
        return Err(Failure::Input(format!("--out {out}: the file is there; --overwrite")));
    }
    File::create(out)
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|e| Failure::writing(out, &e))
}
