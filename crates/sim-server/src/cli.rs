//! The command line: commands, options, and errors on one line.

use clap::{Parser, Subcommand};

use crate::cmd;
use crate::failure::{Failure, one_line};

/// Simulation and planning for heavy highway trucks. Without a command: `run`.
#[derive(Debug, Parser)]
#[command(name = "sim-server", version, about)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Drives a scenario in closed loop: the main job.
    Run(Box<cmd::run::Args>),
    /// Plans the fuel-optimal speed of a whole trip, against cruise control.
    Plan(Box<cmd::plan::Args>),
    /// Finds what the simulation gets wrong on measured drives, and why.
    Diagnose(Box<cmd::diagnose::Args>),
    /// Plans measurements: which manoeuvres tell causes apart.
    #[command(subcommand)]
    Experiment(cmd::experiment::Command),
    /// Drives traffic alone, compares it with recordings, calibrates its drivers.
    Traffic(Box<cmd::traffic::Args>),
    /// Checks road maps.
    #[command(subcommand)]
    Map(cmd::map::Command),
    /// Drives the truck model with measured inputs and says how well it fits.
    Replay(cmd::replay::Args),
    /// Makes a whole recording of one torn by a crash.
    Recover(cmd::recover::Args),
    /// Lists and shows the built-in scenarios.
    #[command(subcommand)]
    Scenario(cmd::scenario::Command),
}

/// Wrong usage as one line: what is wrong, without the help that follows it.
pub(crate) fn usage_failure(error: &clap::Error) -> Failure {
    let text = error.to_string();
    let first = text.split("\n\n").next().unwrap_or(&text);
    let what = one_line(first.strip_prefix("error: ").unwrap_or(first));
    if error.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return Failure::Input("a subcommand is missing; see --help".to_owned());
    }
    Failure::Input(what)
}

/// A number of seconds, metres or the like: finite and above zero.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("not a finite number above zero".to_owned()),
    }
}

/// A quantity that may be zero: finite and not negative.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("not a finite number of zero or more".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn wrong_usage_is_one_line_that_names_the_flag() {
        let error = Cli::try_parse_from(["sim-server", "run", "--sede", "3"]).unwrap_err();
        let line = usage_failure(&error).line();
        assert!(line.contains("--sede") && !line.contains("Usage"), "{line}");
    }

    #[test]
    fn numbers_must_be_finite() {
        for bad in ["NaN", "inf", "-1", "0", "ten"] {
            assert!(positive(bad).is_err(), "{bad}");
        }
        assert_eq!(positive("2.5"), Ok(2.5));
        assert_eq!(not_negative("0"), Ok(0.0));
    }
}
