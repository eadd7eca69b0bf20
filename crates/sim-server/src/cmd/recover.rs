//! `recover FILE.mcap`: a whole file from one torn by a crash.

use std::path::PathBuf;

use clap::Parser;
use recording::{Recovered, recover};
use serde::Serialize;

use crate::failure::Failure;
use crate::output;
use crate::provenance::Provenance;

/// Writes FILE.recovered.mcap with everything up to the tear.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The torn recording.
    file: PathBuf,
    /// Prints one JSON object instead of a sentence.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    provenance: Provenance,
    #[serde(flatten)]
    recovered: Recovered,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let recovered = recover(&args.file)?;
    if args.json {
        let report = Report { provenance: Provenance::of_seed(0), recovered };
        output::result(&serde_json::to_string(&report).map_err(Failure::work)?)
    } else {
        output::result(&format!(
            "{}: {} messages on {} channels to {:.3} s, {} attachments, {} metadata records{}",
            recovered.file.display(),
            recovered.messages,
            recovered.channels,
            recovered.last_message_time_s,
            recovered.attachments,
            recovered.metadata_records,
            if recovered.was_torn { "" } else { "; the file was whole" },
        ))
    }
}
