//! `experiment suggest`: which manoeuvres would tell causes apart.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use diagnosis::DriveSet;
use diagnosis::experiment::{Experiment, Known, NOTHING, Pair, Suggestion, suggest};
use dynamics::TruckParameters;
use serde::{Deserialize, Serialize};

use super::diagnose::read;
use crate::failure::Failure;
use crate::out_folder::Out;
use crate::output;
use crate::progress::Stages;
use crate::provenance::Provenance;
use shell::Threads;

/// Manoeuvres that are listed beside the plan.
const LISTED: usize = 5;

/// Planning of measurements.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Says which manoeuvres tell causes apart, from the Fisher information of drives that the
    /// truck model makes. Writes experiment.json.
    Suggest(Args),
}

/// What to plan for.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A truck file, or a built-in name.
    #[arg(long, value_name = "T")]
    truck: String,
    /// Causes to tell apart, by their ids.
    #[arg(long, value_name = "ID,…", value_delimiter = ',', required_unless_present = "diagnosis")]
    causes: Vec<String>,
    /// A diagnosis.json: its causes, what they could be instead, and what its drives did not
    /// excite.
    #[arg(long, value_name = "FILE")]
    diagnosis: Option<PathBuf>,
    /// Drives that were measured already: what they tell counts.
    #[arg(long, value_name = "DIR")]
    drives: Option<PathBuf>,
    /// Drives of the same truck and logger that are in order: noise and tolerances.
    #[arg(long, value_name = "DIR")]
    baseline: Option<PathBuf>,
    /// Seed of the logger's noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    out: Out,
    /// Prints experiment.json on stdout instead of sentences.
    #[arg(long)]
    json: bool,
}

/// `experiment.json`.
#[derive(Debug, Serialize)]
struct ExperimentJson<'a> {
    #[serde(flatten)]
    provenance: Provenance,
    #[serde(flatten)]
    experiment: &'a Experiment,
}

/// What is read of a `diagnosis.json`.
#[derive(Debug, Deserialize)]
struct Diagnosed {
    causes: Vec<Named>,
    not_observable: Vec<Unseen>,
}

#[derive(Debug, Deserialize)]
struct Named {
    id: String,
    confused_with: Vec<Id>,
}

#[derive(Debug, Deserialize)]
struct Id {
    id: String,
}

#[derive(Debug, Deserialize)]
struct Unseen {
    id: String,
    #[serde(default)]
    missing_channels: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> Result<(), Failure> {
    let Command::Suggest(args) = command;
    let out = args.out.folder(&["experiment.json"])?;
    let threads = Threads::available();
    let truck = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let mut causes = args.causes.clone();
    if let Some(file) = &args.diagnosis {
        causes.extend(of_diagnosis(file)?);
    }
    let measured = |at: &Option<PathBuf>, made: &str| -> Result<Option<DriveSet>, Failure> {
        at.as_deref().map(|d| read(d, &truck, &out, made, args.seed)).transpose()
    };
    let drives = measured(&args.drives, "drives")?;
    let baseline = measured(&args.baseline, "baseline")?;
    let stages = Stages::start();
    stages.show("driving the manoeuvres");
    let known = Known { drives: drives.as_ref(), baseline: baseline.as_ref() };
    let found = suggest(&truck, &causes, known, args.seed, &threads).map_err(Failure::input)?;
    stages.finish();
    let provenance = Provenance::of_seed(args.seed);
    let json = serde_json::to_string_pretty(&ExperimentJson { provenance, experiment: &found })
        .map_err(Failure::work)?;
    out.write("experiment.json", &json)?;
    out.keep();
    output::result(&if args.json { json } else { sentences(&found, &out.path()) })
}

/// Causes that a diagnosis leaves open.
fn of_diagnosis(file: &Path) -> Result<Vec<String>, Failure> {
    let text = std::fs::read_to_string(file).map_err(|e| Failure::file(file, e))?;
    let found: Diagnosed = serde_json::from_str(&text).map_err(|e| Failure::file(file, e))?;
    let mut out = Vec::new();
    for cause in found.causes {
        out.push(cause.id);
        out.extend(cause.confused_with.into_iter().map(|c| c.id));
    }
    let not_excited = found.not_observable.into_iter().filter(|n| n.missing_channels.is_empty());
    out.extend(not_excited.map(|n| n.id));
    if out.is_empty() {
        return Err(Failure::file(file, "the diagnosis leaves no cause open"));
    }
    Ok(out)
}

fn sentences(found: &Experiment, out: &Path) -> String {
    let mut text = String::new();
    let open = |pairs: &[Pair]| pairs.iter().filter(|p| p.nats < found.needed_nats).count();
    let _ = writeln!(
        text,
        "{} pairs of {} and {NOTHING}; the drives so far leave {} of them open (below {} nats).",
        found.now.len(),
        found.causes.join(", "),
        open(&found.now),
        found.needed_nats,
    );
    if found.plan.is_empty() && open(&found.now) == 0 {
        let _ = writeln!(text, "Nothing more needs to be driven.");
    }
    let mut before = &found.now;
    let again = |a: &&Suggestion, b: &&Suggestion| a.manoeuvre == b.manoeuvre;
    let steps: Vec<&Suggestion> = found.plan.iter().collect();
    for (i, times) in steps.chunk_by(again).enumerate() {
        let Some(step) = times.last() else { continue };
        let repeat =
            if times.len() > 1 { format!(", {} times", times.len()) } else { String::new() };
        let what = upper(step.what);
        let _ = writeln!(text, "{}. {what} ({:.0} min{repeat})", i + 1, step.duration_min);
        for (now, with) in before.iter().zip(&step.pairs) {
            if now.nats < found.needed_nats && with.nats > now.nats + 0.5 {
                let _ = writeln!(
                    text,
                    "   {} from {}: {:.1} to {:.1} nats",
                    now.a, now.b, now.nats, with.nats
                );
            }
        }
        before = &step.pairs;
    }
    for p in &found.not_separated {
        let _ = writeln!(
            text,
            "No manoeuvre here tells {} from {} ({:.1} nats with all of the plan).",
            p.a, p.b, p.nats
        );
    }
    let alone = |s: &Suggestion| format!("{} ({:.1})", s.manoeuvre, s.gain_nats_per_min);
    let best: Vec<String> = found.manoeuvres.iter().take(LISTED).map(alone).collect();
    let _ = writeln!(text, "Alone, in nats per minute: {}.", best.join(", "));
    let _ = writeln!(text, "{}", out.join("experiment.json").display());
    text
}

/// With a capital.
fn upper(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}
