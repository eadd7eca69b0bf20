//! `truck sheet TRUCK`: what an on-truck program may know of a truck, as a file.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

use clap::{Parser, Subcommand};
use dynamics::{TruckModel, TruckParameters};

use crate::cli::not_negative;
use crate::failure::Failure;
use crate::output;

/// Truck files.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Writes the sheet of a truck at a load: what `truck-node` plans with.
    Sheet(Args),
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
    let Command::Sheet(args) = command;
    let parameters = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let model = TruckModel::new(parameters, args.payload_kg).map_err(Failure::input)?;
    let limits = model.vehicle_limits().map_err(Failure::input)?;
    let sheet = limits.to_sheet().map_err(Failure::input)?;
    if !args.overwrite && args.out.exists() {
        let out = args.out.display();
        return Err(Failure::Input(format!("--out {out}: the file is there; --overwrite")));
    }
    File::create(&args.out)
        .and_then(|mut file| file.write_all(sheet.as_bytes()))
        .map_err(|e| Failure::writing(&args.out, &e))?;
    output::result(&format!(
        "{}: {} at {:.0} kg",
        args.out.display(),
        args.truck,
        limits.road_load.mass_kg
    ))
}
