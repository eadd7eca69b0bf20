//! The command line: commands, options, and errors on one line.

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

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
    /// Prints what a log of a J1939 bus says, signal by signal.
    Decode(cmd::decode::Args),
    /// Makes measured drives of logs of a truck's bus.
    #[command(subcommand)]
    Drives(Box<cmd::drives::Command>),
    /// Finds what the simulation gets wrong on measured drives, and why.
    Diagnose(Box<cmd::diagnose::Args>),
    /// Makes a truck file of measured drives of a truck that is in order.
    Identify(Box<cmd::identify::Args>),
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
    /// Drives the stack again with what it was given in a recording, and compares every command.
    ProcessReplay(cmd::process_replay::Args),
    /// Looks at a J1939 bus, claims an address, asks, sends.
    Can(Box<cmd::can::Args>),
    /// Makes a whole recording of one torn by a crash.
    Recover(cmd::recover::Args),
    /// Shows a finished recording to viewers of Foxglove's protocol.
    Play(cmd::play::Args),
    /// Puts the virtual truck alone on a bus, in wall time.
    Ecu(cmd::ecu::Args),
    /// Makes truck files of data sheets, and sheets of truck files for programs on a truck.
    #[command(subcommand)]
    Truck(cmd::truck::Command),
    /// Lists and shows the built-in scenarios.
    #[command(subcommand)]
    Scenario(cmd::scenario::Command),
    /// Serves sessions that are asked for over HTTP.
    Serve(cmd::serve::Args),
}

impl Cli {
    /// Reads the command line.
    ///
    /// # Errors
    /// Wrong usage, or a wish for help or the version.
    pub(crate) fn read(
        arguments: impl IntoIterator<Item = std::ffi::OsString>,
    ) -> Result<Self, clap::Error> {
        let matches = values_may_be_negative(Self::command()).try_get_matches_from(arguments)?;
        Self::from_arg_matches(&matches)
    }
}

/// A negative number after an option is its value, not an unknown flag: the message names both.
fn values_may_be_negative(command: clap::Command) -> clap::Command {
    command
        .mut_args(|arg| {
            let takes_value = arg.get_action().takes_values();
            if takes_value { arg.allow_negative_numbers(true) } else { arg }
        })
        .mut_subcommands(values_may_be_negative)
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

/// The origin of a page, as a browser sends it: not `null`, which any page can be.
pub(crate) fn origin(text: &str) -> Result<String, String> {
    match text.split_once("://") {
        Some((scheme, host)) if !scheme.is_empty() && !host.contains('/') => Ok(text.to_owned()),
        _ => Err("SCHEME://HOST or SCHEME://HOST:PORT, without a path".to_owned()),
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
        let refusal = |words: &[&str]| {
            let words = ["sim-server"].iter().chain(words).map(std::ffi::OsString::from);
            usage_failure(&Cli::read(words).unwrap_err()).line()
        };
        let line = refusal(&["run", "--sede", "3"]);
        assert!(line.contains("--sede") && !line.contains("Usage"), "{line}");
        for (words, flag) in [
            (&["run", "--duration", "-1"][..], "--duration"),
            (&["run", "--duration", "-1e3"], "--duration"),
            (&["run", "--seed", "-1"], "--seed"),
            (&["traffic", "--out", "x", "--lanes", "-2"], "--lanes"),
        ] {
            let line = refusal(words);
            assert!(line.contains(flag) && line.contains(words.last().unwrap()), "{line}");
        }
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
