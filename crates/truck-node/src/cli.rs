//! The command line.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use j1939::BitRate;
use planner::SpeedPlannerKind;

/// Drives a truck over its J1939 bus. Without --engage-after-checks it only listens and reports.
///
/// Exit codes: 0 ended as asked (signal, --duration); 1 something broke while running; 2 what was
/// given, the bus, the truck or the road cannot be used; 3 not ready in time; 4 the truck still
/// moved when the time for its stop was over.
#[derive(Debug, Parser)]
#[command(version)]
pub(crate) struct Args {
    /// The bus: a CAN interface (can0, can:can0) or socketcand:HOST:PORT/IFACE.
    #[arg(long, value_name = "IFACE")]
    pub(crate) can: String,
    /// Bit rate of that bus, kbit/s; what its load is measured against.
    #[arg(long, value_name = "KBIT_S", value_enum, default_value = "250")]
    pub(crate) bit_rate: Rate,
    /// The road: .xodr with a geo reference, or a built-in one (builtin:flat, for trials).
    #[arg(long, value_name = "ROAD")]
    pub(crate) map: String,
    /// The truck's sheet, made by `sim-server truck sheet`, with its tables `bus` and `pose`.
    #[arg(long, value_name = "SHEET.toml")]
    pub(crate) truck: PathBuf,
    /// Where the truck is: bus (VP1 and VDS of a receiver on the bus) or nmea:SOURCE, a serial
    /// device, a named pipe or HOST:PORT with NMEA 0183.
    #[arg(long, value_name = "SOURCE", default_value = "bus")]
    pub(crate) pose: Pose,
    /// Who sets the reference speed.
    #[arg(long, value_enum, default_value = "cruise")]
    pub(crate) speed_planner: SpeedPlanner,
    /// The driver's set speed, m/s.
    #[arg(long, value_name = "V", default_value = "20")]
    pub(crate) set_speed_m_s: f64,
    /// Address to claim, in place of the sheet's (0x27, or 39).
    #[arg(long, value_name = "ADDRESS", value_parser = address)]
    pub(crate) address: Option<u8>,
    /// Folder of the recording, run.mcap; none: nothing is recorded.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replaces the recording that is in that folder.
    #[arg(long, requires = "out")]
    pub(crate) overwrite: bool,
    /// Drives as soon as all checks are passed, once: after the driver has taken over it only
    /// listens, until --control asks again.
    #[arg(long)]
    pub(crate) engage_after_checks: bool,
    /// A Unix socket, made here: who may open it writes a line, engage or disengage, and reads who
    /// drives then. Nothing else hands the truck over again.
    #[arg(long, value_name = "SOCKET")]
    pub(crate) control: Option<PathBuf>,
    /// The checks must be passed within this time.
    #[arg(long, value_name = "S", default_value = "60", value_parser = positive)]
    pub(crate) ready_within: f64,
    /// The stop at the end may take so long.
    #[arg(long, value_name = "S", default_value = "60", value_parser = positive)]
    pub(crate) stop_within: f64,
    /// Ends after this time, as a signal does.
    #[arg(long, value_name = "S", value_parser = positive)]
    pub(crate) duration: Option<f64>,
    /// A hardware watchdog, such as /dev/watchdog: written to once a second.
    #[arg(long, value_name = "FILE")]
    pub(crate) watchdog: Option<PathBuf>,
    /// Tells its state as one JSON object to who connects here; a loopback address.
    #[arg(long, value_name = "127.0.0.1:PORT", value_parser = loopback)]
    pub(crate) health: Option<SocketAddr>,
}

/// Where fixes come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Pose {
    Bus,
    Nmea(String),
}

impl std::str::FromStr for Pose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "bus" => Ok(Self::Bus),
            Some(("nmea", source)) if !source.is_empty() => Ok(Self::Nmea(source.to_owned())),
            _ => Err("bus or nmea:SOURCE".to_owned()),
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum SpeedPlanner {
    /// Set speed, limits and curves.
    Cruise,
    /// The fuel-optimal profile.
    Predictive,
}

impl From<SpeedPlanner> for SpeedPlannerKind {
    fn from(planner: SpeedPlanner) -> Self {
        match planner {
            SpeedPlanner::Cruise => Self::Cruise,
            SpeedPlanner::Predictive => Self::Predictive,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Rate {
    #[value(name = "250")]
    Kbit250,
    #[value(name = "500")]
    Kbit500,
}

impl From<Rate> for BitRate {
    fn from(rate: Rate) -> Self {
        match rate {
            Rate::Kbit250 => Self::Kbit250,
            Rate::Kbit500 => Self::Kbit500,
        }
    }
}

/// A name that `j1939::bus::open` knows.
pub(crate) fn bus_name(can: &str) -> String {
    if can.contains(':') { can.to_owned() } else { format!("can:{can}") }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1e7 => Ok(value),
        _ => Err("a positive number of seconds".to_owned()),
    }
}

fn address(text: &str) -> Result<u8, String> {
    let parsed = match text.strip_prefix("0x") {
        Some(hex) => u8::from_str_radix(hex, 16),
        None => text.parse(),
    };
    parsed.ok().filter(|a| *a < j1939::NULL_ADDRESS).ok_or_else(|| "0 to 253".to_owned())
}

fn loopback(text: &str) -> Result<SocketAddr, String> {
    let address: SocketAddr = text.parse().map_err(|_| "an address such as 127.0.0.1:8090")?;
    if address.ip().is_loopback() { Ok(address) } else { Err("not a loopback address".to_owned()) }
}
