//! Diagnoses a folder of drives: `diagnose DRIVES_DIR [BASELINE_DIR]`.
#![expect(clippy::disallowed_macros, reason = "an example prints")]

use std::path::Path;

use diagnosis::{Options, Plant, diagnose, read_drives};
use dynamics::TruckParameters;
use shell::Threads;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let drives = arguments.first().ok_or("usage: diagnose DRIVES_DIR [BASELINE_DIR]")?;
    let plant = Plant::of_truck(&TruckParameters::load("reference")?)?;
    let drives = read_drives(Path::new(drives))?;
    let baseline = arguments.get(1).map(|b| read_drives(Path::new(b))).transpose()?;
    let d = diagnose(
        &plant,
        &drives,
        baseline.as_ref(),
        &Options::default(),
        &Threads::available(),
        &mut |p| eprintln!("{p:?}"),
    )?;
    println!("{}", serde_json::to_string_pretty(&d)?);
    Ok(())
}
