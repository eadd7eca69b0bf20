//! `diagnose`: what the simulation gets wrong on measured drives, why, and the extended truck.

use std::path::{Path, PathBuf};

use clap::Parser;
use diagnosis::report::Report;
use diagnosis::{Diagnosis, DriveSet, Extension, Options, Plant, Verdict};
use dynamics::TruckParameters;
use serde_json::Value;

use crate::failure::Failure;
use crate::output;
use crate::progress::Stages;
use crate::provenance::Provenance;

mod folder;
mod recorded;
mod report;
mod threads;

use threads::Threads;

/// Finds what the simulation gets wrong on measured drives and names the cause. Writes
/// diagnosis.json, report.html and the extended truck file.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The truck file that the simulation uses, or a built-in name.
    #[arg(long, value_name = "T")]
    truck: String,
    /// Folder of measured drives (drives.toml and one table per drive), or recordings of this
    /// program: a run.mcap, its folder, or a folder of such folders.
    #[arg(long, value_name = "DIR")]
    drives: PathBuf,
    /// Drives of the same truck and logger that are in order: noise and tolerances are learned
    /// from them.
    #[arg(long, value_name = "DIR")]
    baseline: Option<PathBuf>,
    /// Drives on which the gain is measured [default: the last quarter, if there are four].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    hold_out: Vec<String>,
    /// Seed of the intervals of the gain.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of the results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Prints diagnosis.json on stdout instead of sentences.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let truck = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let plant = Plant::of_truck(&truck).map_err(Failure::input)?;
    let drives = read(&args.drives, &truck, &args.out.join("drives"))?;
    let made = args.out.join("baseline");
    let baseline = args.baseline.as_deref().map(|b| read(b, &truck, &made)).transpose()?;
    let options = Options { hold_out: args.hold_out.clone(), ..Options::default() };
    let stages = Stages::start();
    let found = diagnosis::diagnose(
        &plant,
        &drives,
        baseline.as_ref(),
        &options,
        &Threads::available(),
        &mut |p| stages.show(&stage(p)),
    );
    let mut found = found.map_err(Failure::input)?;
    stages.show("drawing the report");
    let figures =
        diagnosis::report::report(&plant, &drives, baseline.as_ref(), &options, &found, args.seed)
            .map_err(Failure::work)?;
    stages.finish();

    std::fs::create_dir_all(&args.out).map_err(|e| Failure::file(&args.out, e))?;
    let extension = write_extension(args, &truck, &mut found)?;
    let json = to_json(args, &found, &extension, &figures)?;
    let text = serde_json::to_string_pretty(&json).map_err(Failure::work)?;
    write(&args.out.join("diagnosis.json"), &text)?;
    let overlay = extension.overlay.as_ref().map(toml::to_string).transpose();
    let overlay = overlay.map_err(Failure::work)?;
    let page = report::page(&found, &json, &figures, &named(&args.drives), overlay.as_deref());
    write(&args.out.join("report.html"), &page)?;
    output::result(&if args.json {
        text
    } else {
        sentences(&found, &extension, &figures, &args.out)
    });
    Ok(())
}

/// The last part of a path, for people.
fn named(path: &Path) -> String {
    path.file_name().map_or_else(|| "drives".to_owned(), |n| n.to_string_lossy().into_owned())
}

/// Measured drives: a folder as the contract has it, or recordings of this program, from which
/// such a folder is made at `made`.
fn read(path: &Path, truck: &TruckParameters, made: &Path) -> Result<DriveSet, Failure> {
    let folder = if path.join("drives.toml").is_file() {
        path
    } else {
        let recordings = recorded::recordings(path);
        if recordings.is_empty() && !path.is_dir() {
            return Err(Failure::file(path, "no such folder, and no recording"));
        }
        if recordings.is_empty() {
            return Err(Failure::file(path, "no drives.toml and no run.mcap in it"));
        }
        let tables: Result<Vec<_>, _> =
            recordings.iter().map(|r| recorded::table(r, truck)).collect();
        folder::write(made, &truck.name, &tables?)?;
        made
    };
    diagnosis::read_drives(folder).map_err(Failure::input)
}

pub(crate) fn write(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|e| Failure::file(path, e))
}

fn stage(p: diagnosis::Progress) -> String {
    use diagnosis::Progress as P;
    match p {
        P::Baseline => "learning noise and tolerances".to_owned(),
        P::Search { found: 0 } => "searching for a cause".to_owned(),
        P::Search { found } => format!("searching for a further cause, {found} so far"),
        P::Unknown => "looking outside the catalogue".to_owned(),
        P::Gain => "replaying the drives that were held out".to_owned(),
        _ => "working".to_owned(),
    }
}

/// Writes the extended truck (and the truck file that it builds on, if it is not built in), and
/// sets its name in the diagnosis.
fn write_extension(
    args: &Args,
    truck: &TruckParameters,
    found: &mut Diagnosis,
) -> Result<Extension, Failure> {
    let name = file_name(&truck.name);
    let built_in = TruckParameters::names().any(|n| n == args.truck);
    let base = if built_in { args.truck.clone() } else { format!("{name}.base.toml") };
    let origin = format!("diagnosis of {} on {}", found.truck, named(&args.drives));
    let extension =
        diagnosis::extend(truck, &base, &format!("{name}.extended"), &found.causes, &origin);
    found.extended_truck = extension.overlay.as_ref().map(|_| format!("{name}.extended.toml"));
    if let (Some(overlay), Some(file)) = (&extension.overlay, &found.extended_truck) {
        if !built_in {
            let text = toml::to_string(truck).map_err(Failure::work)?;
            write(&args.out.join(&base), &text)?;
        }
        let text = toml::to_string(overlay).map_err(Failure::work)?;
        let path = args.out.join(file);
        write(&path, &text)?;
        TruckParameters::load(&path.display().to_string()).map_err(Failure::work)?;
    }
    Ok(extension)
}

/// A truck's name as a file name.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

/// `diagnosis.json`: the diagnosis with its provenance in front.
fn to_json(
    args: &Args,
    found: &Diagnosis,
    extension: &Extension,
    figures: &Report,
) -> Result<Value, Failure> {
    let mut json = serde_json::to_value(Provenance::of_seed(args.seed)).map_err(Failure::work)?;
    let rest = serde_json::to_value(found).map_err(Failure::work)?;
    if let (Some(all), Value::Object(rest)) = (json.as_object_mut(), rest) {
        all.extend(rest);
        let lost: Vec<Value> = extension
            .not_carried
            .iter()
            .map(|n| serde_json::json!({ "id": n.id, "why": n.why }))
            .collect();
        all.insert("not_carried".to_owned(), lost.into());
        if let Some(Value::Object(gain)) = all.get_mut("gain") {
            let errors = serde_json::to_value(&figures.gains).map_err(Failure::work)?;
            gain.insert("errors".to_owned(), errors);
        }
    }
    Ok(json)
}

/// The diagnosis for a terminal.
fn sentences(found: &Diagnosis, extension: &Extension, figures: &Report, out: &Path) -> String {
    let mut lines = vec![verdict(found)];
    for cause in &found.causes {
        lines.push(format!("  {} (evidence {:.0} nats)", cause.sentence, cause.evidence));
        lines.push(format!("    {}", diagnosis::report::advice(cause.id)));
        for other in &cause.confused_with {
            lines.push(format!("    could be {}: {}", other.id, other.why));
        }
    }
    if let Some(u) = &found.unknown {
        let signals = u.signals.join(", ");
        lines.push(format!("  outside the catalogue: {}; it follows {signals}", u.shape));
    }
    if let Some(g) = &found.gain {
        let held_out = g.held_out.join(", ");
        let mut claimed = figures.gains.iter().filter(|g| g.claimed).peekable();
        if claimed.peek().is_none() {
            lines.push(format!("No error falls significantly on {held_out}: no gain is claimed."));
        }
        for e in claimed {
            lines.push(format!(
                "  {} on {held_out}: error {:.3} to {:.3} ({}), {:.0} % less ({:.0} to {:.0} %)",
                e.title,
                e.before,
                e.after,
                e.quantity,
                100.0 * e.fall_frac,
                100.0 * e.fall_frac_interval[0],
                100.0 * e.fall_frac_interval[1],
            ));
        }
    }
    for n in &extension.not_carried {
        lines.push(format!("Not in the extended truck: {} ({})", n.id, n.why));
    }
    if !found.tolerances_from_baseline {
        lines.push("Without a baseline the tolerances are defaults.".to_owned());
    }
    lines.push(format!("Report: {}", out.join("report.html").display()));
    lines.join("\n")
}

/// The verdict as a sentence.
fn verdict(found: &Diagnosis) -> String {
    match found.verdict {
        Verdict::Explained => "The simulation is wrong, and this is why:",
        Verdict::NothingToExplain => "The drives fit the truck file; there is nothing to explain.",
        Verdict::Unknown => "The simulation is wrong, and no cause of the catalogue explains it.",
        Verdict::Ambiguous => "The simulation is wrong; these drives leave more than one cause:",
    }
    .to_owned()
}
