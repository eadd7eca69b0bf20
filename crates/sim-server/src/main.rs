//! The main program of Tractrix: command line, dashboard, recording.
//!
//! One file per command under `cmd/`. A run's world lives in its own thread ([`session`]), and is
//! commanded through one door; the recording and the viewers get its ticks over bounded channels,
//! lossless to the recording, lossy to viewers. Only this crate knows an async runtime.

mod bus_board;
mod bus_content;
mod cli;
mod cmd;
mod dashboard;
mod failure;
mod foxglove_door;
mod foxglove_live;
mod foxglove_played;
mod jobs;
mod listeners;
mod out_folder;
mod output;
mod picture;
mod progress;
mod provenance;
mod replayed;
mod ros2_node;
mod run_folder;
mod session;
mod signals;

use std::process::ExitCode;

use clap::error::ErrorKind;

fn main() -> ExitCode {
    let result = match cli::Cli::read(std::env::args_os()) {
        Ok(cli) => cmd::dispatch(cli),
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            return if e.print().is_ok() { ExitCode::SUCCESS } else { ExitCode::from(1) };
        }
        Err(e) => Err(cli::usage_failure(&e)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            output::error_line(&failure.line());
            ExitCode::from(failure.exit_code())
        }
    }
}
