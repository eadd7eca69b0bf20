//! `diagnose`: what the simulation gets wrong on measured drives, why, and the extended truck.

use std::path::{Path, PathBuf};

use clap::Parser;
use diagnosis::{DriveSet, Options, Request};
use dynamics::TruckParameters;

use crate::failure::Failure;
use crate::out_folder::{Out, OutFolder};
use crate::output;
use crate::progress::Stages;
use shell::Threads;

mod example;
pub(crate) mod folder;
mod logger;
mod recorded;
mod report;
mod results;

pub(super) use results::defects;

use results::Results;

/// Finds what the simulation gets wrong on measured drives and names the cause. Writes
/// diagnosis.json, report.html and the extended truck file.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The truck file that the simulation uses, or a built-in name [default with --example:
    /// reference].
    #[arg(long, value_name = "T", required_unless_present = "example")]
    truck: Option<String>,
    /// Folder of measured drives (drives.toml and one table per drive), or recordings of this
    /// program: a run.mcap, its folder, or a folder of such folders.
    #[arg(long, value_name = "DIR", required_unless_present = "example")]
    drives: Option<PathBuf>,
    /// Drives of the same truck and logger that are in order: noise and tolerances are learned
    /// from them.
    #[arg(long, value_name = "DIR")]
    baseline: Option<PathBuf>,
    /// Drives on which the gain is measured [default: the last quarter, if there are four].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    hold_out: Vec<String>,
    /// The whole loop on a built-in example: measures a simulated truck with a hidden effect that
    /// the seed draws, diagnoses it, and runs the simulator with the extended truck.
    #[arg(long, conflicts_with_all = ["drives", "baseline"])]
    example: bool,
    /// Adds what is left without a name to the extended truck, as a table over the signal that it
    /// follows, if that helps on every drive held out.
    #[arg(long)]
    table_effect: bool,
    /// Seed of the example, and of the intervals of the gain.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    out: Out,
    /// Prints diagnosis.json on stdout instead of sentences.
    #[arg(long)]
    json: bool,
}

/// What is written, beside drives that are made.
const RESULTS: &[&str] =
    &["diagnosis.json", "report.html", "hidden.json", "*.extended.toml", "*.base.toml"];

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let out = args.out.folder(RESULTS)?;
    let at = out.path();
    let threads = Threads::available();
    let stages = Stages::start();
    let folder = |given: &Option<PathBuf>, made: &str| {
        if args.example { Some(at.join(made)) } else { given.clone() }
    };
    let missing = |what: &str| Failure::Input(format!("{what} is missing"));
    let truck_name = args.truck.as_deref().or(args.example.then_some(example::TRUCK));
    let truck_name = truck_name.ok_or_else(|| missing("--truck"))?;
    let drives_at = folder(&args.drives, "drives").ok_or_else(|| missing("--drives"))?;
    let baseline_at = folder(&args.baseline, "baseline");

    let truck = TruckParameters::load(truck_name).map_err(Failure::input)?;
    let hidden = if args.example {
        stages.show("measuring a simulated truck with a hidden effect");
        Some(example::measure(&out, &truck, args.seed, &threads)?)
    } else {
        None
    };
    let drives = read(&drives_at, &truck, &out, "drives", args.seed)?;
    let baseline = baseline_at.as_deref();
    let baseline = baseline.map(|b| read(b, &truck, &out, "baseline", args.seed)).transpose()?;
    let options = Options { hold_out: args.hold_out.clone(), ..Options::default() };
    let request = Request {
        truck: &truck,
        truck_name,
        drives: &drives,
        drives_at: &drives_at,
        baseline: baseline.as_ref(),
        options: &options,
        table_effect: args.table_effect,
        seed: args.seed,
    };
    let outcome = request.run(&threads, &mut |p| stages.show(&stage(p))).map_err(Failure::input)?;
    for (name, text) in &outcome.truck_files {
        out.write(name, text)?;
    }
    outcome.check_truck(&at).map_err(Failure::input)?;
    let mut results = Results { outcome, example: None, seed: args.seed };
    if let Some(hidden) = hidden {
        stages.show("running the simulator with the extended truck");
        let overlay = results.outcome.extension.overlay.as_ref();
        let closed_loop = example::close_the_loop(&truck, &hidden, overlay)?;
        results.example = Some((hidden, closed_loop));
    }
    stages.finish();
    let text = results.write(&out)?;
    out.keep();
    output::result(&if args.json { text } else { results.sentences(&at) })
}

/// Measured drives: a folder as the contract has it, or recordings of this program, from which
/// such a folder is made, `made` among the results.
pub(crate) fn read(
    path: &Path,
    truck: &TruckParameters,
    out: &OutFolder,
    made: &str,
    seed: u64,
) -> Result<DriveSet, Failure> {
    let folder = if path.join("drives.toml").is_file() {
        path.to_owned()
    } else {
        let recordings = recorded::recordings(path);
        if recordings.is_empty() && !path.is_dir() {
            return Err(Failure::file(path, "no such folder, and no recording"));
        }
        if recordings.is_empty() {
            return Err(Failure::file(path, "no drives.toml and no run.mcap in it"));
        }
        let tables: Result<Vec<_>, _> =
            recordings.iter().map(|r| recorded::table(r, truck, seed)).collect();
        let made = out.begin(made)?;
        folder::write(&made, &truck.name, &tables?)?;
        made
    };
    diagnosis::read_drives_with(&folder, &Threads::available()).map_err(Failure::input)
}

fn stage(p: diagnosis::Progress) -> String {
    use diagnosis::Progress as P;
    match p {
        P::Baseline => "learning noise and tolerances".to_owned(),
        P::Search { found: 0 } => "searching for a cause".to_owned(),
        P::Search { found } => format!("searching for a further cause, {found} so far"),
        P::Unknown => "looking outside the catalogue".to_owned(),
        P::Report => "drawing the report".to_owned(),
        P::Gain => "replaying the drives that were held out".to_owned(),
        _ => "working".to_owned(),
    }
}
