//! `truck-node`: drives a truck over its J1939 bus with the planning stack.
//!
//! | file | holds |
//! |---|---|
//! | `cli` | the command line |
//! | `sheet` | the truck's sheet: limits, `[bus]`, `[pose]` |
//! | `roll_call` | who is on the bus before anything is claimed |
//! | `checks` | what must be in order before anything is actuated, and the report of it |
//! | `node` | the loop: checks, driving, the stop at the end |
//! | `live` | the bus in wall time |
//! | `radar` | the vehicle ahead as a source of traffic |
//! | `pose`, `nmea` | where the truck is |
//! | `log` | the recording |
//! | `watchdog`, `health` | who watches the program |
//! | `control` | the driver's wish to hand over, or to drive himself |
//!
//! A shell: it owns clock, signals, sockets and files. What decides is in the crates that it links.

mod checks;
mod cli;
mod clock;
mod control;
mod failure;
mod first_wish;
mod health;
mod live;
mod log;
mod nmea;
mod node;
mod output;
mod pose;
mod radar;
mod roll_call;
mod sheet;
mod watchdog;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = cli::Args::parse();
    match node::run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::note(&format!("error: {failure}"));
            failure.exit_code()
        }
    }
}
