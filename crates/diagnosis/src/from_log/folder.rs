//! Logs, a truck and a map into a folder of drives: one conversion for every shell.

use std::io::BufRead;
use std::path::Path;

use dynamics::{TruckModel, TruckParameters};
use j1939::bus::BusError;
use j1939::bus::candump::messages;
use road::{GeoReference, Road};
use serde::Serialize;

use super::observable::Causes;
use super::{
    Choice, Conversion, Converted, Dbc, LeftOut, Log, LoggedDrive, OnRoad, Span, Unfilled,
};
use crate::plausible::MIN_DURATION_S;
use crate::{DiagnosisError, Table, drives_index};

/// Step of the map table, m.
const MAP_STEP_M: f64 = 5.0;
/// A fix farther off the reference line is not on the road, m.
const OFF_ROAD_M: f64 = 30.0;
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

/// From latitude and longitude, deg, to a map, m.
pub type Project = Box<dyn Fn(f64, f64) -> [f64; 2]>;

/// The road that was driven.
pub struct Map {
    name: String,
    road: Road,
    place: Place,
}

/// How the place on the road is found.
enum Place {
    /// By satellite fixes.
    Fixes(Project),
    /// By the wheels, from this station, m.
    From(f64),
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

/// What `conversion.json` holds.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The truck, as the user gave it.
    truck: String,
    /// The road, as the user gave it.
    map: Option<String>,
    logs: Vec<LogReport>,
    #[serde(flatten)]
    causes: Causes,
}

#[derive(Debug, Serialize)]
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

#[derive(Debug, Serialize)]
struct DriveReport {
    name: String,
    #[serde(flatten)]
    span: Span,
    distance_m: f64,
    on_map: bool,
    notes: Vec<String>,
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

impl Map {
    /// A road; the wheels count from `start_s_m`, else satellite fixes say where on it a drive is.
    ///
    /// # Errors
    /// [`DiagnosisError::Map`]: no road, a start behind its end, or fixes on a road that does not
    /// say where on earth it lies.
    pub fn load(
        name: &str,
        start_s_m: Option<f64>,
        project: &dyn Fn(&GeoReference) -> Result<Project, String>,
    ) -> Result<Self, DiagnosisError> {
        let bad = |why: String| DiagnosisError::Map { map: name.to_owned(), why };
        let road = Road::load(name).map_err(|e| DiagnosisError::Road(e.to_string()))?;
        let place = match (start_s_m, road.geo_reference()) {
            (Some(start_m), _) if !(0.0..road.length_m()).contains(&start_m) => {
                let length_m = road.length_m();
                return Err(bad(format!(
                    "the drive begins at {start_m} m, the road ends at {length_m:.0} m"
                )));
            }
            (Some(start_m), _) => Place::From(start_m),
            (None, Some(reference)) => Place::Fixes(project(reference).map_err(bad)?),
            (None, None) => {
                return Err(bad("the road does not say where on earth it lies; say where on it \
                                the drive begins (start-s-m)"
                    .to_owned()));
            }
        };
        Ok(Self { name: name.to_owned(), road, place })
    }

    fn station_m(&self, latitude_deg: f64, longitude_deg: f64, hint_m: Option<f64>) -> Option<f64> {
        let Place::Fixes(project) = &self.place else { return None };
        let [x_m, y_m] = project(latitude_deg, longitude_deg);
        let at = self.road.project(x_m, y_m, hint_m)?;
        (at.d_m.abs() <= OFF_ROAD_M).then_some(at.s_m)
    }

    fn table(&self) -> Table {
        let mut table = Table::new("map".to_owned(), &["s_m", "grade_frac", "curvature_1_m"]);
        let steps = (self.road.length_m() / MAP_STEP_M) as usize;
        for k in 0..=steps {
            let at = self.road.at(MAP_STEP_M * k as f64, 0.0);
            table.push(&[MAP_STEP_M * k as f64, at.grade_rad.tan(), at.curvature_1_m]);
        }
        table
    }
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

impl Report {
    /// What was made, for people.
    #[must_use]
    pub fn sentences(&self) -> String {
        let mut lines = Vec::new();
        for log in &self.logs {
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
                lines.push(format!(
                    "{} at {:.0} s left out: {}",
                    log.log, part.span.from_s, part.why
                ));
            }
            lines.extend(log.columns.iter().map(Choice::sentence));
            lines.extend(log.missing.iter().map(|m| format!("  no {}: {}", m.column, m.why)));
            if log.mass_kg.is_none() {
                lines.push("  no mass: neither --mass-kg nor a message (CVW)".to_owned());
            }
        }
        lines.extend(self.causes.sentences());
        lines.join("\n")
    }
}

impl Choice {
    fn sentence(&self) -> String {
        let more = if self.others.is_empty() {
            String::new()
        } else {
            format!("; also {}", self.others.join(", "))
        };
        format!(
            "  {} from {} of {:02X} every {:.0} ms, there {:.0} % of the time{more}",
            self.column,
            self.signal,
            self.address,
            1e3 * self.period_s,
            100.0 * self.fresh_frac
        )
    }
}
