//! `map check ROAD`: what the importer makes of a map.

mod carriageway;

use std::collections::BTreeMap;

use clap::{Parser, Subcommand};
use road::opendrive::{MapReport, Network, RecordCount};
use road::{Finding, Road, Severity};
use serde::Serialize;

use crate::failure::Failure;
use crate::output;
use crate::provenance::Provenance;

/// Road maps.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Imports a map; reports lanes, length, grade range, jumps and unsupported records.
    Check(Args),
}

/// Which map.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// An .xodr or .csv file, or a built-in road.
    road: String,
    /// Prints one JSON object instead of lines.
    #[arg(long)]
    json: bool,
}

/// A map's report with its provenance.
#[derive(Serialize)]
struct MapJson {
    #[serde(flatten)]
    provenance: Provenance,
    #[serde(flatten)]
    report: MapReport,
}

/// Runs the command.
pub(crate) fn run(command: Command) -> Result<(), Failure> {
    let Command::Check(args) = command;
    let (json, text, refused) = if args.road.to_ascii_lowercase().ends_with(".xodr") {
        let report = Network::load(&args.road).map_err(Failure::input)?.check();
        let text = text(&report);
        let refused = report.findings.iter().find(|f| f.severity == Severity::Refused).cloned();
        let json = MapJson { provenance: Provenance::of_seed(0), report };
        (serde_json::to_string(&json), text, refused)
    } else {
        let road = Road::load(&args.road).map_err(Failure::input)?;
        let report = carriageway::inspect(&args.road, &road);
        (serde_json::to_string(&report), carriageway::text(&report), None)
    };
    output::result(if args.json { json.map_err(Failure::work)? } else { text }.as_str())?;
    match refused {
        Some(finding) => Err(Failure::Input(format!("{}: {finding}", args.road))),
        None => Ok(()),
    }
}

/// Findings as lines: `warned: width_m = ...`.
fn finding_lines(findings: &[Finding]) -> impl Iterator<Item = String> {
    findings.iter().map(|f| {
        let word = match f.severity {
            Severity::Warned => "warned",
            Severity::Refused => "refused",
        };
        format!("{word}: {f}")
    })
}

fn text(r: &MapReport) -> String {
    let range = |[low, high]: [f64; 2], unit: &str| format!("{low:.2} to {high:.2} {unit}");
    let mut lines = vec![
        format!(
            "{}: OpenDRIVE {}, {} roads, {} junctions, {:.1} m of road, {:.1} m of drivable lane",
            r.file, r.revision, r.roads, r.junctions, r.length_m, r.drivable_lane_m
        ),
        match (r.route_length_m, r.route_lanes) {
            (Some(length_m), Some(lanes)) => {
                format!("default route: {length_m:.1} m, {lanes} lane tracks")
            }
            _ => "default route: none, nothing can be driven".to_owned(),
        },
        format!(
            "grade {}, height {}, bank {}",
            range(r.grade_frac.map(|g| 100.0 * g), "%"),
            range(r.elevation_m, "m"),
            range(r.bank_rad, "rad"),
        ),
        format!(
            "tightest radius {}, speed limits {}",
            r.min_radius_m.map_or("none (straight)".to_owned(), |m| format!("{m:.1} m")),
            r.speed_limit_m_s.map_or("none".to_owned(), |limits| range(limits, "m/s")),
        ),
        format!("lanes: {}", counts(&r.lanes)),
        format!("objects and signals: {}", counts(&r.objects)),
        format!("unsupported: {}", records(&r.unsupported)),
        format!("ignored: {}", records(&r.ignored)),
    ];
    lines.extend(finding_lines(&r.findings));
    lines.extend(r.broken_links.iter().map(|link| format!("broken link: {link}")));
    let jumps: usize = r.jump_counts.values().sum();
    lines.push(format!("{jumps} jumps"));
    lines.extend(r.jumps.iter().map(|j| {
        let to = j.to_road.as_ref().map_or(String::new(), |id| format!(" to road {id}"));
        let kind = serde_json::to_string(&j.kind).unwrap_or_default();
        let kind = kind.trim_matches('"');
        format!("  {kind} {:.4} on road {} at {:.2} m{to}", j.size, j.road, j.s_m)
    }));
    lines.join("\n")
}

fn counts(map: &BTreeMap<String, usize>) -> String {
    let items: Vec<String> = map.iter().map(|(name, count)| format!("{count} {name}")).collect();
    if items.is_empty() { "none".to_owned() } else { items.join(", ") }
}

fn records(map: &BTreeMap<String, RecordCount>) -> String {
    let item = |(name, r): (&String, &RecordCount)| {
        format!("{} {name} (first in line {})", r.count, r.first_line)
    };
    let items: Vec<String> = map.iter().map(item).collect();
    if items.is_empty() { "none".to_owned() } else { items.join(", ") }
}
