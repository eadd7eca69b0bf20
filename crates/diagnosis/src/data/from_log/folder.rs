//! Logs, a truck and a map into a folder of drives: one conversion for every shell.

use std::io::BufRead;
use std::path::Path;

use dynamics::{TruckModel, TruckParameters};
use j1939::bus::BusError;
use j1939::bus::candump::messages;

use super::map::{Map, Place};
use super::observable::Causes;
use super::report::{DriveReport, LogReport, Report};
use super::{Conversion, Converted, Dbc, Log, LoggedDrive, OnRoad};
use crate::data::plausible::MIN_DURATION_S;
use crate::{DiagnosisError, Table, drives_index};

/// The map table.
const MAP: &str = "map.csv";
/// Logs in containers of other tools, by the end of their name.
const CONTAINERS: [&str; 5] = ["asc", "blf", "trc", "mf4", "mdf"];

/// A log of candump, in either form, or compressed (`.gz`).
#[derive(Debug, Clone, Copy)]
pub struct LogFile<'a> {
    /// The file.
    pub path: &'a Path,
    /// The log as the user knows it: the drives have its name.
    pub named: &'a Path,
    /// Mass on the load sheet, kg; none: what the bus says (CVW).
    pub mass_kg: Option<f64>,
}

/// What is converted, and how.
pub struct Job<'a> {
    /// The truck file.
    pub truck: &'a TruckParameters,
    /// Its built-in name or path, as the user gave it.
    pub truck_name: &'a str,
    /// The logs.
    pub logs: &'a [LogFile<'a>],
    /// The road that was driven.
    pub map: Option<&'a Map>,
    /// Signals of the truck's maker.
    pub dbc: Option<&'a Dbc>,
    /// A standstill of so long ends a drive, s.
    pub standstill_s: f64,
    /// Shorter drives are left out, s.
    pub least_s: f64,
}

/// A folder of drives, not yet written.
#[derive(Debug)]
pub struct DriveFolder {
    tables: Vec<Table>,
    map: Option<Table>,
    truck: String,
    /// What was chosen, what is missing and why.
    pub report: Report,
}

/// What goes wrong while a log is heard.
enum Heard {
    Bus(BusError),
    Log(DiagnosisError),
}

impl From<BusError> for Heard {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

/// Opens a log for reading, compressed (`.gz`) or not.
///
/// # Errors
/// What the operating system says.
pub fn open(log: &Path) -> std::io::Result<Box<dyn BufRead>> {
    let file = std::fs::File::open(log)?;
    if log.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
        return Ok(Box::new(std::io::BufReader::new(flate2::read::MultiGzDecoder::new(file))));
    }
    Ok(Box::new(std::io::BufReader::new(file)))
}

impl Job<'_> {
    /// Converts the logs, one after the other.
    ///
    /// # Errors
    /// A log that cannot be read, with the line; two of one name; a truck that cannot be used; no
    /// drive that is long enough.
    pub fn run(&self) -> Result<DriveFolder, DiagnosisError> {
        let truck = |e: dynamics::DynamicsError| DiagnosisError::Truck(e.to_string());
        let model = TruckModel::new(self.truck.clone(), 0.0).map_err(truck)?;
        let limits = model.vehicle_limits().map_err(truck)?;
        let names = self.names()?;
        let (mut tables, mut logs) = (Vec::new(), Vec::new());
        for (file, name) in self.logs.iter().zip(names) {
            let of_log = |why: String| DiagnosisError::Log { path: file.named.to_owned(), why };
            let (log, channels) = self.heard(file).map_err(|e| match e {
                Heard::Bus(e) => of_log(e.to_string()),
                Heard::Log(e) => of_log(e.to_string()),
            })?;
            let locate = |lat: f64, lon: f64, hint_m: Option<f64>| {
                self.map.and_then(|map| map.station_m(lat, lon, hint_m))
            };
            let how = Conversion {
                fuel_density_kg_m3: limits.powertrain.fuel_density_kg_m3,
                standstill_s: self.standstill_s,
                least_s: self.least_s,
                road: self.map.map(|map| match map.place {
                    Place::From(start_m) => OnRoad::From { start_m, length_m: map.road.length_m() },
                    Place::Fixes(_) => OnRoad::Fixes(&locate),
                }),
            };
            let made = log.convert(&how).map_err(|e| of_log(e.to_string()))?;
            logs.push(take(file, &name, made, channels, &mut tables));
        }
        if tables.is_empty() {
            let why = logs.iter().flat_map(|l| &l.left_out).map(|l| l.why.as_str());
            let why: Vec<&str> = why.collect();
            let what = format!(
                "no drive is long enough: {}; diagnose and identify need {MIN_DURATION_S} s",
                why.join("; ")
            );
            return Err(DiagnosisError::NoDrives { what });
        }
        let causes = Causes::of(&tables);
        let map = self.map.filter(|_| tables.iter().any(|t| t.map.is_some()));
        Ok(DriveFolder {
            tables,
            map: map.map(Map::table),
            truck: self.truck_name.to_owned(),
            report: Report {
                truck: self.truck_name.to_owned(),
                map: self.map.map(|m| m.name.clone()),
                logs,
                causes,
            },
        })
    }

    /// A name for the drives of each log: the log's own, which no two may share.
    fn names(&self) -> Result<Vec<String>, DiagnosisError> {
        let mut names: Vec<String> = Vec::new();
        for log in self.logs {
            let file = Path::new(log.named.file_name().unwrap_or_default());
            let is_packed = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
            let file = if is_packed { file.with_extension("") } else { file.to_owned() };
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
            let name: String = stem.chars().map(plain).collect();
            if names.contains(&name) {
                let why = format!("two logs are named {name}");
                return Err(DiagnosisError::Log { path: log.named.to_owned(), why });
            }
            names.push(name);
        }
        Ok(names)
    }

    /// A log and how many channels it has.
    fn heard(&self, file: &LogFile<'_>) -> Result<(Log, usize), Heard> {
        let io = |why: String| Heard::Bus(BusError::Io { what: "the log".to_owned(), why });
        let end = file.path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if CONTAINERS.contains(&end.as_str()) {
            return Err(io(format!(
                "{} is no log of candump; Python reads it: tractrix.drives.from_log",
                end.to_uppercase()
            )));
        }
        let mut log = Log::new(self.dbc);
        let input = open(file.path).map_err(|e| io(e.to_string()))?;
        let told = messages(input, &mut |heard| {
            log.hear(heard.time, heard.channel_number, heard.id, heard.bytes)
                .map_err(Heard::Log)?;
            Ok::<bool, Heard>(true)
        })?;
        Ok((log, told.channels))
    }
}

/// Takes over what came out of a log.
fn take(
    file: &LogFile<'_>,
    name: &str,
    made: Converted,
    channels: usize,
    tables: &mut Vec<Table>,
) -> LogReport {
    let (mass_kg, mass_from) = match (file.mass_kg, made.mass_kg) {
        (Some(kg), _) => (Some(kg), "the load sheet"),
        (None, Some(kg)) => (Some(kg), "CVW"),
        (None, None) => (None, "nobody: the truck file's"),
    };
    let mut drives = Vec::new();
    for (k, drive) in made.drives.into_iter().enumerate() {
        let LoggedDrive { span, columns, distance_m, mut notes, on_map } = drive;
        if span.duration_s() < MIN_DURATION_S {
            notes.push(format!("too short for diagnose and identify ({MIN_DURATION_S} s)"));
        }
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
        log: file.named.display().to_string(),
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

impl DriveFolder {
    /// Hands over every file of the folder, name and text, `drives.toml` last.
    ///
    /// # Errors
    /// What `write` fails with.
    pub fn write<E: From<DiagnosisError>>(
        &self,
        write: &mut dyn FnMut(&str, String) -> Result<(), E>,
    ) -> Result<(), E> {
        for table in &self.tables {
            write(&format!("{}.csv", table.name), table.csv())?;
        }
        if let Some(map) = &self.map {
            write(MAP, map.csv())?;
        }
        write("drives.toml", drives_index(&self.truck, &self.tables)?)
    }
}
