//! `decode LOG`: what a log of a J1939 bus says, signal by signal.

mod print;
mod wanted;

use std::io::BufRead;
use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use j1939::bus::BusError;
use j1939::bus::candump::{Heard, Told, messages};

use crate::bus_content::{self, Content};
use crate::failure::Failure;
use crate::output;
use print::Printer;
use wanted::Wanted;

/// Prints every signal of a log of candump, in SI, with its state where it is no number.
///
/// Transported messages are put together, each channel by itself. Messages that are not in the table
/// are counted and left out. The summary goes to standard error.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The log, in either form of candump, or compressed (`.gz`); `-` reads standard input.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// A line per signal, or an object per message.
    #[arg(long, value_enum, default_value = "csv")]
    format: Format,
    /// Only these: messages (EEC1), signals (speed_m_s) or both (CCVS1.speed_m_s), with commas
    /// between.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    signals: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A line per signal.
    Csv,
    /// An object per message.
    Jsonl,
}

/// What the messages of a log were.
#[derive(Debug, Default)]
struct Counts {
    decoded: u64,
    too_short: u64,
    not_in_table: u64,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let wanted = Wanted::of(&args.signals)?;
    let mut decoder =
        Decoder { wanted, printer: Printer::new(args.format)?, counts: Counts::default() };
    let input: Box<dyn BufRead> = if args.log.as_os_str() == "-" {
        Box::new(std::io::stdin().lock())
    } else {
        diagnosis::from_log::open(&args.log).map_err(|e| Failure::file(&args.log, e))?
    };
    let told = messages(input, &mut |heard| {
        decoder.message(heard).map_err(Stop::Print)?;
        Ok(!decoder.printer.nobody_reads())
    });
    let told = told.map_err(|e| match e {
        Stop::Log(e) => Failure::file(&args.log, e),
        Stop::Print(failure) => failure,
    })?;
    if decoder.printer.nobody_reads() {
        return Ok(());
    }
    decoder.printer.finish()?;
    output::note(&decoder.counts.summary(&told));
    Ok(())
}

/// Why reading ends before the log does.
enum Stop {
    Log(BusError),
    Print(Failure),
}

impl From<BusError> for Stop {
    fn from(error: BusError) -> Self {
        Self::Log(error)
    }
}

/// What goes through a command.
struct Decoder {
    wanted: Wanted,
    printer: Printer,
    counts: Counts,
}

impl Decoder {
    fn message(&mut self, heard: &Heard<'_>) -> Result<(), Failure> {
        let Some((message, content)) = bus_content::read(heard.id, heard.bytes) else {
            self.counts.not_in_table += 1;
            return Ok(());
        };
        match &content {
            Content::Said(_) => self.counts.decoded += 1,
            Content::Wrong(_) => self.counts.too_short += 1,
        }
        match self.wanted.of_message(message, content) {
            Some(content) => self.printer.print(heard, message, &content),
            None => Ok(()),
        }
    }
}

impl Counts {
    fn summary(&self, told: &Told) -> String {
        format!(
            "{} frames on {} channels: {} messages decoded, {} too short or no text, {} not \
             in the table; {} transported, {} of them broken off; skipped {} frames with 11-bit \
             identifiers, {} remote, {} error",
            told.frames,
            told.channels,
            self.decoded,
            self.too_short,
            self.not_in_table,
            told.transported + told.broken,
            told.broken,
            told.skipped.standard,
            told.skipped.remote,
            told.skipped.error,
        )
    }
}
