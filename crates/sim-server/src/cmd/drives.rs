//! `drives from-can LOG`: a log of a truck's bus into measured drives.

use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};
use diagnosis::from_log::{
    Choice, Conversion, Converted, LeftOut, Log, LoggedDrive, OnRoad, Span, Unfilled,
};
use dynamics::{TruckModel, TruckParameters};
use planner::localise::MapProjection;
use road::Road;
use serde::Serialize;

use super::diagnose::folder::{self, Table};
use crate::bus_log;
use crate::cli::{not_negative, positive};
use crate::failure::Failure;
use crate::out_folder::{Out, OutFolder};
use crate::output;
use crate::provenance::Provenance;

/// What is written, beside a table for each drive.
const RESULTS: &[&str] = &["drives.toml", "conversion.json", MAP];
const MAP: &str = "map.csv";
/// Step of the map table, m.
const MAP_STEP_M: f64 = 5.0;
/// A fix farther off the reference line is not on the road, m.
const OFF_ROAD_M: f64 = 30.0;

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
struct Report<'a> {
    #[serde(flatten)]
    provenance: Provenance,
    truck: &'a str,
    map: Option<&'a str>,
    logs: Vec<LogReport>,
}

#[derive(Serialize)]
struct LogReport {
    log: String,
    duration_s: f64,
    messages: u64,
    channels: usize,
    mass_kg: Option<f64>,
    mass_from: &'static str,
    columns: Vec<Choice>,
    missing: Vec<Unfilled>,
    drives: Vec<DriveReport>,
    left_out: Vec<LeftOut>,
}

#[derive(Serialize)]
struct DriveReport {
    name: String,
    #[serde(flatten)]
    span: Span,
    distance_m: f64,
    on_map: bool,
    notes: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(command: &Command) -> Result<(), Failure> {
    let Command::FromCan(args) = command;
    let truck = TruckParameters::load(&args.truck).map_err(Failure::input)?;
    let model = TruckModel::new(truck, 0.0).map_err(Failure::input)?;
    let limits = model.vehicle_limits().map_err(Failure::input)?;
    let map = args.map.as_deref().map(|m| Map::load(m, args.start_s_m)).transpose()?;
    let names = drive_names(&args.logs)?;
    let masses = args.mass_kg.len();
    if masses > 1 && masses != args.logs.len() {
        let logs = args.logs.len();
        return Err(Failure::Input(format!("--mass-kg: {masses} masses for {logs} logs")));
    }
    let out = args.out.folder(RESULTS)?;
    let (mut tables, mut logs) = (Vec::new(), Vec::new());
    for (number, (path, name)) in args.logs.iter().zip(names).enumerate() {
        let mass_kg = args.mass_kg.get(number).or(args.mass_kg.first()).copied();
        let (log, channels) = heard(path)?;
        let locate =
            |lat: f64, lon: f64, hint_m: Option<f64>| map.as_ref()?.station_m(lat, lon, hint_m);
        let how = Conversion {
            fuel_density_kg_m3: limits.powertrain.fuel_density_kg_m3,
            standstill_s: args.standstill_s,
            least_s: args.min_drive_s,
            road: map.as_ref().map(|map| match args.start_s_m {
                Some(start_m) => OnRoad::From { start_m, length_m: map.road.length_m() },
                None => OnRoad::Fixes(&locate),
            }),
        };
        let made = log.convert(&how).map_err(|e| Failure::file(path, e))?;
        logs.push(put(path, &name, made, mass_kg, channels, &mut tables));
    }
    if tables.is_empty() {
        let why = logs.iter().flat_map(|l| &l.left_out).map(|l| l.why.as_str());
        let why: Vec<&str> = why.collect();
        return Err(Failure::Input(format!("no drive is long enough: {}", why.join("; "))));
    }
    write(&out, args, &tables, map.as_ref())?;
    let report = Report {
        provenance: Provenance::of_seed(0),
        truck: &args.truck,
        map: args.map.as_deref(),
        logs,
    };
    let text = serde_json::to_string_pretty(&report).map_err(Failure::work)?;
    out.write("conversion.json", text)?;
    let said = sentences(&report);
    out.keep();
    output::result(&said)
}

/// A name for the drives of each log: the log's own, which no two may share.
fn drive_names(logs: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let mut names: Vec<String> = Vec::new();
    for log in logs {
        let file = Path::new(log.file_name().unwrap_or_default());
        let file = if file.extension().is_some_and(|e| e == "gz") {
            file.with_extension("")
        } else {
            file.to_owned()
        };
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
        let name: String = stem.chars().map(plain).collect();
        if names.contains(&name) {
            return Err(Failure::Input(format!("{}: two logs are named {name}", log.display())));
        }
        names.push(name);
    }
    Ok(names)
}

/// The log and how many channels it has.
fn heard(path: &Path) -> Result<(Log, usize), Failure> {
    let mut log = Log::new();
    let told = bus_log::read(path, &mut |heard| {
        log.hear(heard.time, heard.channel_number, heard.id, heard.bytes)
            .map_err(|e| Failure::file(path, e))?;
        Ok(true)
    })?;
    Ok((log, told.channels))
}

/// Takes over what came out of a log.
fn put(
    path: &Path,
    name: &str,
    made: Converted,
    given_kg: Option<f64>,
    channels: usize,
    tables: &mut Vec<Table>,
) -> LogReport {
    let (mass_kg, mass_from) = match (given_kg, made.mass_kg) {
        (Some(kg), _) => (Some(kg), "--mass-kg"),
        (None, Some(kg)) => (Some(kg), "CVW"),
        (None, None) => (None, "nobody: the truck file's"),
    };
    let mut drives = Vec::new();
    for (k, drive) in made.drives.into_iter().enumerate() {
        let LoggedDrive { span, columns, distance_m, notes, on_map } = drive;
        let name = format!("{name}_{}", k + 1);
        drives.push(DriveReport { name: name.clone(), span, distance_m, on_map, notes });
        tables.push(Table {
            name,
            reported_mass_kg: mass_kg,
            tyres_warm_at_start: None,
            map: on_map.then(|| MAP.to_owned()),
            columns,
        });
    }
    LogReport {
        log: path.display().to_string(),
        duration_s: made.duration_s,
        messages: made.messages,
        channels,
        mass_kg,
        mass_from,
        columns: made.choices,
        missing: made.unfilled,
        drives,
        left_out: made.left_out,
    }
}

fn write(out: &OutFolder, args: &Args, tables: &[Table], map: Option<&Map>) -> Result<(), Failure> {
    for table in tables {
        out.write(&format!("{}.csv", table.name), table.csv())?;
    }
    if let Some(map) = map.filter(|_| tables.iter().any(|t| t.map.is_some())) {
        out.write(MAP, map.table())?;
    }
    out.write("drives.toml", folder::index(&args.truck, tables)?)
}

/// What was made, for people.
fn sentences(report: &Report<'_>) -> String {
    let mut lines = Vec::new();
    for log in &report.logs {
        for drive in &log.drives {
            let place = if drive.on_map { ", on the map" } else { "" };
            lines.push(format!(
                "{}: {:.0} s, {:.1} km{place}",
                drive.name,
                drive.span.duration_s(),
                1e-3 * drive.distance_m
            ));
            lines.extend(drive.notes.iter().map(|note| format!("  {note}")));
        }
        for part in &log.left_out {
            lines.push(format!("{} at {:.0} s left out: {}", log.log, part.span.from_s, part.why));
        }
        for c in &log.columns {
            let more = if c.others.is_empty() {
                String::new()
            } else {
                format!("; also {}", c.others.join(", "))
            };
            lines.push(format!(
                "  {} from {} of {:02X} every {:.0} ms, there {:.0} % of the time{more}",
                c.column,
                c.signal,
                c.address,
                1e3 * c.period_s,
                100.0 * c.fresh_frac
            ));
        }
        lines.extend(log.missing.iter().map(|m| format!("  no {}: {}", m.column, m.why)));
        if log.mass_kg.is_none() {
            lines.push("  no mass: neither --mass-kg nor a message (CVW)".to_owned());
        }
    }
    lines.join("\n")
}

/// The road that was driven.
struct Map {
    road: Road,
    projection: Option<MapProjection>,
}

impl Map {
    fn load(name: &str, start_s_m: Option<f64>) -> Result<Self, Failure> {
        let road = Road::load(name).map_err(Failure::input)?;
        if let Some(start_m) = start_s_m {
            if start_m >= road.length_m() {
                let length_m = road.length_m();
                return Err(Failure::Input(format!(
                    "--start-s-m {start_m}: the road ends at {length_m:.0} m"
                )));
            }
            return Ok(Self { road, projection: None });
        }
        let no_place = || {
            Failure::Input(format!(
                "--map {name}: the road does not say where on earth it lies; \
                 --start-s-m says where on it the drive begins"
            ))
        };
        let reference = road.geo_reference().ok_or_else(no_place)?;
        let projection = MapProjection::new(reference)
            .map_err(|e| Failure::Input(format!("--map {name}: {e}")))?;
        Ok(Self { road, projection: Some(projection) })
    }

    fn station_m(&self, latitude_deg: f64, longitude_deg: f64, hint_m: Option<f64>) -> Option<f64> {
        let [x_m, y_m] = self.projection.as_ref()?.to_map_m(latitude_deg, longitude_deg);
        let at = self.road.project(x_m, y_m, hint_m)?;
        (at.d_m.abs() <= OFF_ROAD_M).then_some(at.s_m)
    }

    fn table(&self) -> String {
        let mut table = Table::new(String::new(), &["s_m", "grade_frac", "curvature_1_m"]);
        let steps = (self.road.length_m() / MAP_STEP_M) as usize;
        for k in 0..=steps {
            let at = self.road.at(MAP_STEP_M * k as f64, 0.0);
            table.push(&[MAP_STEP_M * k as f64, at.grade_rad.tan(), at.curvature_1_m]);
        }
        table.csv()
    }
}
