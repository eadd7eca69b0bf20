//! `can`: a node on a J1939 bus, for looking and asking.

mod station;
mod words;

use clap::{Parser, Subcommand};
use j1939::bus::Bus;
use j1939::bus::candump::{Form, write};
use j1939::{AddressClaim, GLOBAL_ADDRESS, Name};

use crate::cli::not_negative;
use crate::failure::Failure;
use crate::output;
use station::{Heard, Station};
use words::{Bytes, address, data, destination, name, pgn};

/// Looks at a J1939 bus, claims an address on it, asks for parameter groups, sends them.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The bus: can:IFACE or socketcand:HOST:PORT/IFACE.
    #[arg(long, value_name = "BUS", global = true)]
    bus: Option<String>,
    /// Address to claim; 249 is the first of service tools.
    #[arg(long, value_name = "ADDRESS", value_parser = address, default_value = "249", global = true)]
    address: u8,
    /// NAME to claim it with, 64 bits in hexadecimal; the default is a service tool that can take
    /// another address.
    #[arg(long, value_name = "HEX", value_parser = name, default_value = "8000810000000001", global = true)]
    name: u64,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Prints every frame as `candump -L` does, without an address.
    Dump {
        /// Ends after so many seconds.
        #[arg(long, value_name = "S", value_parser = not_negative)]
        duration: Option<f64>,
        /// Ends after so many frames.
        #[arg(long, value_name = "N")]
        count: Option<u64>,
    },
    /// Claims the address and defends it.
    Claim {
        /// Ends after so many seconds; without it the address is held until the program is ended.
        #[arg(long, value_name = "S", value_parser = not_negative)]
        duration: Option<f64>,
    },
    /// Claims the address and asks for a parameter group.
    Request {
        /// The group: a number, or 0x and hexadecimal digits.
        #[arg(value_parser = pgn)]
        pgn: u32,
        /// Who is asked; everybody by default.
        #[arg(long, value_name = "ADDRESS", value_parser = destination, default_value_t = GLOBAL_ADDRESS)]
        to: u8,
    },
    /// Claims the address and sends a message of any length.
    Send {
        /// The group: a number, or 0x and hexadecimal digits.
        #[arg(value_parser = pgn)]
        pgn: u32,
        /// Its bytes in hexadecimal.
        #[arg(value_parser = data)]
        data: Bytes,
        /// To whom; to everybody by default.
        #[arg(long, value_name = "ADDRESS", value_parser = destination, default_value_t = GLOBAL_ADDRESS)]
        to: u8,
        /// Priority, 0 (first) to 7.
        #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u8).range(0..=7))]
        priority: u8,
    },
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let missing = || Failure::input("--bus is missing: can:IFACE or socketcand:HOST:PORT/IFACE");
    let bus_name = args.bus.as_ref().ok_or_else(missing)?;
    let bus = j1939::bus::open(bus_name).map_err(|e| Failure::input(format!("--bus {e}")))?;
    let delay_steps = std::process::id() as u8;
    let claim = AddressClaim::new(Name(args.name), args.address, delay_steps);
    let mut station = Station::new(bus, claim);
    match &args.command {
        Command::Dump { duration, count } => {
            let channel = bus_name.rsplit([':', '/']).next().unwrap_or(bus_name);
            dump(&mut station, channel, *duration, *count)
        }
        Command::Claim { duration } => hold(&mut station, *duration),
        Command::Request { pgn, to } => request(&mut station, *pgn, *to),
        Command::Send { pgn, data, to, priority } => {
            let own = station.claimed()?;
            station.send(*priority, *pgn, *to, &data.0)?;
            output::result(&format!("{} bytes sent from {own:#04X}", data.0.len()))
        }
    }
}

fn dump(
    station: &mut Station<impl Bus>,
    channel: &str,
    duration_s: Option<f64>,
    count: Option<u64>,
) -> Result<(), Failure> {
    let mut printed = 0;
    while duration_s.is_none_or(|s| station.elapsed_s() < s) && count.is_none_or(|n| printed < n) {
        let mut lines = Vec::new();
        for heard in station.listen()? {
            if count.is_none_or(|n| printed < n) {
                write(&mut lines, Form::Log, channel, &heard).map_err(Failure::work)?;
                printed += 1;
            }
        }
        if !lines.is_empty() {
            output::result(&String::from_utf8_lossy(&lines))?;
        }
    }
    Ok(())
}

fn hold(station: &mut Station<impl Bus>, duration_s: Option<f64>) -> Result<(), Failure> {
    let mut own = station.claimed()?;
    output::result(&format!("claimed {own:#04X}"))?;
    while duration_s.is_none_or(|s| station.elapsed_s() < s) {
        station.step(|_| {})?;
        // after a contention that was lost it takes another address, or fails in there
        let now = station.claimed()?;
        if now != own {
            own = now;
            output::result(&format!("claimed {own:#04X}"))?;
        }
    }
    Ok(())
}

fn request(station: &mut Station<impl Bus>, pgn: u32, to: u8) -> Result<(), Failure> {
    station.claimed()?;
    let mut answers = 0;
    station.ask(pgn, to, |heard| {
        let line = match heard {
            Heard::Message { sa, bytes } => {
                let hex: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
                format!("{sa:#04X} {hex}")
            }
            Heard::Refused { sa, answer } => format!("{sa:#04X} answers {answer:?}"),
        };
        answers += 1;
        output::result(&line)
    })?;
    match answers {
        0 => Err(Failure::Work(format!("nobody answered the request for PGN {pgn}"))),
        _ => Ok(()),
    }
}
