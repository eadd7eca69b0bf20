//! `replay`: measured inputs through the whole truck model, open loop, and how well it fits.

use std::path::PathBuf;

use clap::Parser;
use diagnosis::fidelity::{DriveFidelity, Replayed, SignalFidelity, fidelity};
use diagnosis::{collect, read_traces, whole_run};
use dynamics::TruckParameters;
use serde::Serialize;

use super::diagnose::read;
use crate::failure::Failure;
use crate::out_folder::Out;
use crate::output;
use crate::picture::{Line, Strip, Style, page};
use crate::progress::Stages;
use crate::provenance::Provenance;
use shell::Threads;

/// Drives the truck model with the measured inputs and compares its outputs with the measured
/// ones. Writes fidelity.json and a picture, replay.html.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// A truck file, or a built-in name.
    #[arg(long, value_name = "T")]
    truck: String,
    /// Folder of measured drives, or recordings of this program.
    #[arg(long, value_name = "DIR")]
    drives: PathBuf,
    /// Traces of any length, from standstill if need be, each in one open loop in which the truck
    /// shifts by itself. The folder may be one of CSV files without drives.toml, with the mass in
    /// the file's name (_18t).
    #[arg(long)]
    whole: bool,
    #[command(flatten)]
    out: Out,
    /// Prints fidelity.json on stdout instead of sentences.
    #[arg(long)]
    json: bool,
}

/// `fidelity.json`.
#[derive(Debug, Serialize)]
struct FidelityJson<'a> {
    #[serde(flatten)]
    provenance: Provenance,
    truck: &'a str,
    accuracy_is: &'static str,
    /// Over all drives, weighted by samples.
    overall: Vec<SignalFidelity>,
    drives: &'a [DriveFidelity],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let out = args.out.folder(&["fidelity.json", "replay.html"])?;
    let truck = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let stages = Stages::start();
    let drives = if args.whole {
        let traces = read_traces(&args.drives).map_err(Failure::input)?;
        stages.show("replaying the traces");
        collect(&Threads::available(), traces.len(), |i| whole_run(&truck, &traces[i]))
    } else {
        let set = read(&args.drives, &truck, &out, "drives", 1)?;
        stages.show("replaying the drives");
        collect(&Threads::available(), set.drives.len(), |i| fidelity(&truck, &set.drives[i]))
    };
    stages.finish();
    let drives: Vec<DriveFidelity> =
        drives.into_iter().collect::<Result<_, _>>().map_err(Failure::input)?;
    let overall = overall(&drives);
    let text = if args.whole { by_trace(&drives) } else { sentence(&overall) };
    let json = FidelityJson {
        provenance: Provenance::of_seed(0),
        truck: &truck.name,
        accuracy_is: "1 - mean |simulated - measured| / mean |measured|",
        overall,
        drives: &drives,
    };
    let json = serde_json::to_string_pretty(&json).map_err(Failure::work)?;
    out.write("fidelity.json", &json)?;
    let title = format!("{} in open loop on measured inputs", truck.name);
    let picture = if args.whole {
        let axis = "time, s (traces one after the other)";
        page(&title, &text, axis, &strips(&drives, 1, diagnosis::Drive::STEP_S))
    } else {
        let axis = "time, min (drives one after the other)";
        page(&title, &text, axis, &strips(&drives, THIN, diagnosis::Drive::STEP_S / 60.0))
    };
    out.write("replay.html", picture)?;
    out.keep();
    output::result(if args.json { &json } else { &text })
}

/// The same signal and horizon of all drives together.
fn overall(drives: &[DriveFidelity]) -> Vec<SignalFidelity> {
    let mut out: Vec<SignalFidelity> = Vec::new();
    for s in drives.iter().flat_map(|d| &d.signals) {
        let same = |o: &&mut SignalFidelity| o.quantity == s.quantity && o.horizon_s == s.horizon_s;
        let Some(o) = out.iter_mut().find(same) else {
            out.push(*s);
            continue;
        };
        let (a, b) = (o.samples as f64, s.samples as f64);
        let mean = |x: f64, y: f64| (a * x + b * y) / (a + b);
        o.mean_abs_error = mean(o.mean_abs_error, s.mean_abs_error);
        o.mean_abs = mean(o.mean_abs, s.mean_abs);
        o.rmse = mean(o.rmse * o.rmse, s.rmse * s.rmse).sqrt();
        o.samples += s.samples;
        o.accuracy_frac = (o.mean_abs > 1e-9).then(|| 1.0 - o.mean_abs_error / o.mean_abs);
    }
    out
}

fn percent(s: &SignalFidelity) -> String {
    s.accuracy_frac.map_or_else(|| "–".to_owned(), |a| format!("{:.1} %", 100.0 * a))
}

/// Every trace alone: a mean would hide the one that is missed.
fn by_trace(drives: &[DriveFidelity]) -> String {
    let mut lines =
        vec!["Accuracy (1 - mean |error| / mean |measured|) of whole traces:".to_owned()];
    for d in drives {
        let cells: Vec<String> =
            d.signals.iter().map(|s| format!("{} {}", s.quantity, percent(s))).collect();
        lines.push(format!("  {}: {}", d.drive, cells.join(", ")));
    }
    lines.join("\n")
}

fn sentence(overall: &[SignalFidelity]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for s in overall {
        if !names.contains(&s.quantity) {
            names.push(s.quantity);
        }
    }
    let mut lines = vec!["Accuracy (1 - mean |error| / mean |measured|) of free runs:".to_owned()];
    for name in names {
        let of = overall.iter().filter(|s| s.quantity == name);
        let cells: Vec<String> = of
            .map(|s| match s.horizon_s {
                Some(h) => format!("{h} s {}", percent(s)),
                None => format!("whole drive {}", percent(s)),
            })
            .collect();
        lines.push(format!("  {name}: {}", cells.join(", ")));
    }
    lines.join("\n")
}

/// Samples per point of the picture: one a second.
const THIN: usize = 20;

/// A strip of the picture: title, quantity, factor.
const STRIPS: [(&str, &str, f64); 9] = [
    ("speed, km/h", "speed_m_s", 3.6),
    ("engine speed, rpm", "engine_speed_rpm", 1.0),
    ("engine torque, %", "engine_torque_percent", 1.0),
    ("gear", "gear", 1.0),
    ("brake pressure, kPa", "brake_pressure_kpa", 1.0),
    ("steer axle pressure, kPa", "brake_pressure_steer_kpa", 1.0),
    ("drive axle pressure, kPa", "brake_pressure_drive_kpa", 1.0),
    ("trailer pressure, kPa", "brake_pressure_trailer_kpa", 1.0),
    ("yaw rate, rad/s", "yaw_rate_rad_s", 1.0),
];
/// A way to see a signal: name, color, values.
type View = (&'static str, &'static str, fn(&Replayed) -> &[f64]);
const VIEWS: [View; 3] = [
    ("measured", "#17202a", |r| &r.measured),
    ("free runs of 60 s", "#0a7cc4", |r| &r.free_runs),
    ("whole drive in open loop", "#d1495b", |r| &r.open_loop),
];

/// Every `thin`th sample, `per_sample` of the axis' unit apart before that.
fn strips(drives: &[DriveFidelity], thin: usize, per_sample: f64) -> Vec<Strip> {
    let per_point = thin as f64 * per_sample;
    let strip = |(title, quantity, factor): &(&'static str, &str, f64)| {
        let lines = VIEWS.iter().map(|(name, color, values)| {
            let mut y = Vec::new();
            for drive in drives {
                if let Some(r) = drive.replayed.iter().find(|r| r.quantity == *quantity) {
                    y.extend(values(r).iter().step_by(thin).map(|v| factor * v));
                }
                y.push(f64::NAN);
            }
            let x = (0..y.len()).map(|i| i as f64 * per_point).collect();
            Line { name: (*name).to_owned(), x, y, color, style: Style::Solid }
        });
        let lines: Vec<Line> = lines.filter(|l| l.y.iter().any(|v| v.is_finite())).collect();
        (!lines.is_empty()).then_some(Strip { title, lines })
    };
    STRIPS.iter().filter_map(strip).collect()
}
