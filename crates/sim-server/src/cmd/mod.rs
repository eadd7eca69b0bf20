//! One file per command.

pub(crate) mod can;
pub(crate) mod decode;
pub(crate) mod diagnose;
pub(crate) mod drives;
pub(crate) mod ecu;
pub(crate) mod experiment;
pub(crate) mod identify;
pub(crate) mod map;
pub(crate) mod plan;
pub(crate) mod play;
pub(crate) mod process_replay;
pub(crate) mod recover;
pub(crate) mod replay;
pub(crate) mod run;
pub(crate) mod scenario;
pub(crate) mod serve;
pub(crate) mod traffic;
pub(crate) mod truck;

use clap::Parser;

use crate::cli::{Cli, Command};
use crate::failure::Failure;

/// A number to this many significant digits.
fn rounded(x: f64, digits: usize) -> f64 {
    format!("{x:.*e}", digits.saturating_sub(1)).parse().unwrap_or(x)
}

/// Runs the command that was asked for.
pub(crate) fn dispatch(cli: Cli) -> Result<(), Failure> {
    match cli.command {
        None => run::run(&run::Args::parse_from(["run"])),
        Some(Command::Run(args)) => run::run(&args),
        Some(Command::Plan(args)) => plan::run(&args),
        Some(Command::Decode(args)) => decode::run(&args),
        Some(Command::Drives(command)) => drives::run(&command),
        Some(Command::Diagnose(args)) => diagnose::run(&args),
        Some(Command::Identify(args)) => identify::run(&args),
        Some(Command::Experiment(command)) => experiment::run(&command),
        Some(Command::Traffic(args)) => traffic::run(&args),
        Some(Command::Map(command)) => map::run(command),
        Some(Command::Replay(args)) => replay::run(&args),
        Some(Command::ProcessReplay(args)) => process_replay::run(&args),
        Some(Command::Can(args)) => can::run(&args),
        Some(Command::Play(args)) => play::run(args),
        Some(Command::Recover(args)) => recover::run(&args),
        Some(Command::Ecu(args)) => ecu::run(&args),
        Some(Command::Truck(command)) => truck::run(&command),
        Some(Command::Scenario(command)) => scenario::run(&command),
        Some(Command::Serve(args)) => serve::run(&args),
    }
}

#[cfg(test)]
mod tests {
    use super::rounded;

    /// An error of the yaw rate fell "from 0.001 to 0.001".
    #[test]
    fn numbers_have_significant_digits_whatever_their_unit() {
        for (x, printed) in [
            (0.001_063_4, "0.00106"),
            (0.387, "0.387"),
            (-1_234.5, "-1230"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(rounded(x, 3).to_string(), printed);
        }
    }
}
