//! What can go wrong before a diagnosis: files, tables, too little data, another truck.

use std::path::PathBuf;

/// Errors of the crate. Expected outcomes (nothing found, not observable) are values of
/// [`crate::Diagnosis`], not errors.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnosisError {
    /// A file cannot be opened or read.
    #[error("{path}: {why}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's words.
        why: String,
    },
    /// `drives.toml` does not have the contract's form.
    #[error("{path}: {why}")]
    Index {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A log of a bus has no drive in it.
    #[error("no drive in the log: {why}")]
    NoDrive {
        /// Why.
        why: String,
    },
    /// A log of a bus is longer than can be held.
    #[error("more than {samples} samples by {until_s:.0} s of the log; split it")]
    LongLog {
        /// Most samples.
        samples: usize,
        /// How far it was read, s.
        until_s: f64,
    },
    /// A log of a bus cannot be read, or holds nothing that can be used.
    #[error("{path}: {why}")]
    Log {
        /// The log, as the user named it.
        path: PathBuf,
        /// What is wrong with it, with the line.
        why: String,
    },
    /// A description of a maker's signals cannot be used.
    #[error("{path}: {why}")]
    Dbc {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, with message and signal.
        why: String,
    },
    /// A drive cannot be laid on a road.
    #[error("map {map}: {why}")]
    Map {
        /// The road, as the user named it.
        map: String,
        /// Why.
        why: String,
    },
    /// A road cannot be read.
    #[error("{0}")]
    Road(String),
    /// A table cannot be decoded.
    #[error("{path}: {why}")]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A column that nothing can be done without is missing or unusable.
    #[error("drive {drive}: column {column} is needed and {why}")]
    Column {
        /// Name of the drive.
        drive: String,
        /// Name of the column.
        column: &'static str,
        /// Why it cannot be used.
        why: String,
    },
    /// The time column is not in seconds.
    #[error(
        "{}: column time_s {what}, taken as seconds; if it is in {suspected}, divide it by {divisor:.0}",
        path.display()
    )]
    NotSeconds {
        /// The file.
        path: PathBuf,
        /// What no log of a drive shows, with the value.
        what: String,
        /// The unit that it looks like.
        suspected: &'static str,
        /// How many of that unit are a second.
        divisor: f64,
    },
    /// The time column runs backwards.
    #[error(
        "drive {drive}: time_s runs backwards at row {row} ({before_s} s, then {after_s} s): rows are shuffled"
    )]
    ShuffledTime {
        /// Name of the drive.
        drive: String,
        /// First row that is earlier than the row before it, 0-based.
        row: usize,
        /// Time of the row before it, s.
        before_s: f64,
        /// Time of that row, s.
        after_s: f64,
    },
    /// A cause that the catalogue does not have.
    #[error("{} is not a cause of the catalogue", if id.is_empty() { "nothing" } else { id.as_str() })]
    Cause {
        /// The id, empty if none was given.
        id: String,
    },
    /// A drive is too short to say anything.
    #[error("drive {drive}: {seconds:.1} s of usable data, at least {needed_s:.0} s are needed")]
    TooShort {
        /// Name of the drive.
        drive: String,
        /// Length, s.
        seconds: f64,
        /// Length needed, s.
        needed_s: f64,
    },
    /// No drive is left to learn from.
    #[error("{what}")]
    NoDrives {
        /// What is missing.
        what: String,
    },
    /// A drive was made with another truck than the truck file describes.
    #[error(
        "drive {drive} does not belong to this truck file: engine_speed_rpm over speed_m_s in gear {gear} is {measured:.3}, the truck file says {expected:.3} (1/m, as (rad/s)/(m/s)){hint}"
    )]
    WrongTruck {
        /// Name of the first such drive.
        drive: String,
        /// Gear with most data among those that disagree.
        gear: usize,
        /// Measured ratio, 1/m.
        measured: f64,
        /// Ratio of the truck file, 1/m.
        expected: f64,
        /// What it could be instead, in words that go on.
        hint: &'static str,
    },
    /// An engine cannot burn so much or so little for the work that it does.
    #[error(
        "drive {drive}: column fuel_rate_g_s makes {g_per_kwh:.0} g for a kWh at the crank under load, taken as g/s; an engine burns 180 to 250{hint}"
    )]
    FuelUnit {
        /// Name of the drive.
        drive: String,
        /// Fuel over work under load, g/kWh.
        g_per_kwh: f64,
        /// The unit that it looks like, in words that go on.
        hint: &'static str,
    },
    /// The truck file is not usable.
    #[error("truck: {0}")]
    Truck(String),
    /// A matrix that must be positive definite is not: the data hold non-finite numbers.
    #[error("numerics: {0}")]
    Numerics(String),
}
