//! `run`: the main job, a scenario in closed loop with dashboard and recording.

use std::path::PathBuf;

use clap::builder::RangedU64ValueParser;
use clap::{Parser, ValueEnum};

use crate::cli::{origin, positive};
use crate::dashboard::AccessArgs;
use crate::failure::Failure;
use crate::session::Pace;

mod execute;
mod options;
mod report;

/// Drives a scenario in closed loop, with a live dashboard, and records it.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// A scenario file, or the name of a built-in one (`scenario list`).
    #[arg(default_value = "highway")]
    scenario: String,
    /// Another road: .xodr, .csv, builtin:highway, builtin:highway-sag, builtin:test-site or builtin:flat.
    #[arg(long)]
    road: Option<String>,
    /// Another truck: a truck file or a built-in name.
    #[arg(long)]
    truck: Option<String>,
    /// Another payload on the trailer.
    #[arg(long, value_name = "KG", value_parser = crate::cli::not_negative)]
    payload_kg: Option<f64>,
    /// The other vehicles: native, sumo, replay:FILE or none.
    #[arg(long, value_name = "SOURCE")]
    traffic: Option<String>,
    /// pure (does not see the ego), inter (reacts to it), re (a run again, with --manifest), rep
    /// (recorded).
    #[arg(long)]
    mode: Option<String>,
    /// traffic.manifest.toml of the run that mode re repeats; its seed is taken too.
    #[arg(long, value_name = "FILE")]
    manifest: Option<PathBuf>,
    /// When the traffic source fails: stop, or native (the native engine goes on).
    #[arg(long, value_name = "WHAT")]
    on_traffic_failure: Option<String>,
    /// Who decides on lane changes: keep, rules:50, rules:100, rules:150, mobil, rollout (drives
    /// ahead what each change leads to), external (the dashboard and its API), dqn (the trained
    /// policy) or dqn:FILE (policy.safetensors, policy.json beside it).
    #[arg(long)]
    decider: Option<String>,
    /// Who sets the reference speed: cruise or predictive.
    #[arg(long)]
    speed_planner: Option<String>,
    /// How the stack reaches the truck: direct, bus (J1939 in memory), can:IFACE or
    /// socketcand:HOST:PORT/IFACE (J1939 over that bus, both ends in this process).
    #[arg(long, default_value = "direct", value_parser = vehicle)]
    vehicle: String,
    /// Ends the run after this simulated time.
    #[arg(long, value_name = "S", value_parser = positive)]
    duration: Option<f64>,
    /// Goes on when a wheel leaves the road; it is counted all the same.
    #[arg(long)]
    allow_off_road: bool,
    /// realtime, max, or simulated seconds per second [default: realtime, max with --headless].
    #[arg(long)]
    pace: Option<Pace>,
    /// Seed of everything that is drawn at random [default: the manifest's or the scenario's, else 1].
    #[arg(long)]
    seed: Option<u64>,
    /// Folder of run.mcap and summary.json [default: a new one under runs/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replaces the run that is in that folder.
    #[arg(long, requires = "out")]
    overwrite: bool,
    /// No dashboard.
    #[arg(long)]
    headless: bool,
    /// Port of the dashboard; 0 takes a free one.
    #[arg(long, default_value_t = 8080, value_parser = RangedU64ValueParser::<u16>::new())]
    port: u16,
    #[command(flatten)]
    access: AccessArgs,
    /// Keeps the dashboard open after the end, until Ctrl-C, SIGTERM or SIGHUP.
    #[arg(long, conflicts_with = "headless")]
    keep_open: bool,
    /// Prints the summary as one JSON object, and nothing else, on stdout.
    #[arg(long)]
    json: bool,
    /// Shows the run as a node of the ROS 2 domain ROS_DOMAIN_ID, and takes commands from it; on
    /// this machine alone unless ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET. Nobody is authenticated.
    #[arg(long)]
    ros2: bool,
    /// Names of its topics: tractrix, or autoware for those of Autoware too
    /// (/localization/kinematic_state, /vehicle/status/...).
    #[arg(long, value_name = "NAMES", requires = "ros2", hide_possible_values = true)]
    ros2_names: Option<Names>,
    /// Shows the run to Foxglove and Lichtblick, and takes commands from them, on this port of
    /// 127.0.0.1 (0: a free one). No program is authenticated; of pages in a browser those of this
    /// machine and of app.foxglove.dev are let in.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "8765")]
    foxglove: Option<u16>,
    /// Another page that may show the run, by its origin (`https://viewer.example`, `file://`).
    #[arg(long, value_name = "ORIGIN", requires = "foxglove", value_parser = origin)]
    foxglove_origin: Vec<String>,
}

/// Whose names the ROS 2 node has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Names {
    Tractrix,
    Autoware,
}

/// A way to the truck.
fn vehicle(text: &str) -> Result<String, String> {
    match text.split_once(':') {
        None if ["direct", "bus"].contains(&text) => Ok(text.to_owned()),
        Some(("can" | "socketcand", _)) => Ok(text.to_owned()),
        _ => Err("direct, bus, can:IFACE or socketcand:HOST:PORT/IFACE".to_owned()),
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let scenario = options::scenario(args)?;
    let seed = scenario.seed(args.seed).map_err(Failure::input)?;
    execute::execute(args, seed, &scenario)
}
