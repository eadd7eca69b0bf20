//! `play RUN.mcap`: a finished recording for viewers of Foxglove's protocol.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Parser;

use crate::failure::Failure;

/// Shows a finished recording to Foxglove and Lichtblick, which play, pause, seek and choose the
/// speed; until a signal.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The recording.
    file: PathBuf,
    /// Port on 127.0.0.1; 0 takes a free one. No program is authenticated; of pages in a browser
    /// those of this machine and of app.foxglove.dev are let in.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_value_t = 8765, default_missing_value = "8765")]
    foxglove: u16,
    /// Another page that may show it, by its origin (`https://viewer.example`, `file://`).
    #[arg(long, value_name = "ORIGIN", value_parser = crate::cli::origin)]
    foxglove_origin: Vec<String>,
}

/// Runs the command.
pub(crate) fn run(args: Args) -> Result<(), Failure> {
    let Args { file, foxglove, foxglove_origin } = args;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(Failure::work)?;
    let stop = Arc::new(AtomicBool::new(false));
    runtime.spawn(crate::signals::raise(Arc::clone(&stop)));
    let pages = foxglove_origin;
    let served = crate::foxglove_played::serve(&file, foxglove, pages, runtime.handle(), &stop);
    runtime.shutdown_background();
    served
}
