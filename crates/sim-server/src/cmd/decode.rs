//! `decode LOG`: what a log of a J1939 bus says, signal by signal.

mod content;
mod print;
mod wanted;

use std::io::BufRead;
use std::path::{Path, PathBuf};

use clap::{Parser, ValueEnum};
use j1939::bus::candump::{Reader, Skipped};
use j1939::bus::{Bus, BusError};
use j1939::{Frame, GLOBAL_ADDRESS, Id, TpEvent, Transport};
use tractrix_core::{Stamped, Time};

use crate::failure::Failure;
use crate::output;
use content::Content;
use print::Printer;
use wanted::Wanted;

/// Transported messages under way at once, on each channel; more are counted as broken.
const SESSIONS: usize = 256;
/// Longest transported message, bytes: all of the transport protocol.
const MESSAGE_BYTES: usize = 1_785;
/// Priority of a transported message, which its packets do not tell.
const PRIORITY: u8 = 6;
/// Groups of the transport protocols (TP.CM, TP.DT, ETP.CM, ETP.DT): they carry others.
const TRANSPORT: [u32; 4] = [0xEC00, 0xEB00, 0xC800, 0xC700];

/// Prints every signal of a log of candump, in SI, with its state where it is no number.
///
/// Transported messages are put together, each channel by itself. Messages that are not in the table
/// are counted and left out. The summary goes to standard error.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The log, in either form of candump; `-` reads standard input.
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

/// A message, out of one frame or of many.
#[derive(Debug, Clone, Copy)]
struct Heard<'a> {
    time: Time,
    channel: &'a str,
    id: Id,
    /// Destination; of a group that goes to everybody an address too, when it is transported.
    da: u8,
    bytes: &'a [u8],
}

/// What a log had in it.
#[derive(Debug, Default)]
struct Counts {
    frames: u64,
    decoded: u64,
    too_short: u64,
    not_in_table: u64,
    transported: u64,
    broken: u64,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let wanted = Wanted::of(&args.signals)?;
    let mut reader = Reader::new(open(&args.log)?);
    let mut decoder =
        Decoder { wanted, printer: Printer::new(args.format)?, counts: Counts::default() };
    let mut transports: Vec<Transport<SESSIONS, MESSAGE_BYTES>> = Vec::new();
    while let Some(entry) = reader.next() {
        let entry = entry.map_err(|e| Failure::file(&args.log, e))?;
        let (time, frame) = (entry.heard.time, entry.heard.value);
        let channel = reader.channels().get(entry.channel).map_or("", String::as_str);
        transports.resize_with(transports.len().max(entry.channel + 1), Transport::listener);
        decoder.counts.frames += 1;
        if TRANSPORT.contains(&frame.id().pgn()) {
            if let Some(transport) = transports.get_mut(entry.channel) {
                decoder.transported(transport, time, &frame, channel)?;
            }
        } else {
            let (id, bytes) = (frame.id(), frame.bytes());
            decoder.message(&Heard { time, channel, id, da: id.da(), bytes })?;
        }
        if decoder.printer.nobody_reads() {
            return Ok(());
        }
    }
    decoder.printer.finish()?;
    output::note(&decoder.counts.summary(reader.skipped(), reader.channels().len()));
    Ok(())
}

fn open(log: &Path) -> Result<Box<dyn BufRead>, Failure> {
    if log.as_os_str() == "-" {
        return Ok(Box::new(std::io::stdin().lock()));
    }
    let file = std::fs::File::open(log).map_err(|e| Failure::file(log, e))?;
    Ok(Box::new(std::io::BufReader::new(file)))
}

/// What goes through a command.
struct Decoder {
    wanted: Wanted,
    printer: Printer,
    counts: Counts,
}

impl Decoder {
    /// A packet of a longer message, and the messages that end with it.
    fn transported(
        &mut self,
        transport: &mut Transport<SESSIONS, MESSAGE_BYTES>,
        time: Time,
        frame: &Frame,
        channel: &str,
    ) -> Result<(), Failure> {
        // first what is overdue: a packet that comes too late belongs to nothing
        transport.poll(time, &mut Nowhere).map_err(Failure::work)?;
        transport.on_frame(time, frame);
        transport.poll(time, &mut Nowhere).map_err(Failure::work)?;
        while let Some(event) = transport.event() {
            match event {
                TpEvent::Received(message) => {
                    self.counts.transported += 1;
                    let (pgn, da, sa) = (message.pgn, message.da, message.sa);
                    let id = Id::new(PRIORITY, pgn, da, sa)
                        .or_else(|_| Id::new(PRIORITY, pgn, GLOBAL_ADDRESS, sa))
                        .map_err(Failure::work)?;
                    let time = message.time;
                    self.message(&Heard { time, channel, id, da, bytes: message.bytes })?;
                }
                TpEvent::Failed { .. } => self.counts.broken += 1,
                TpEvent::Sent { .. } => {}
            }
        }
        Ok(())
    }

    fn message(&mut self, heard: &Heard<'_>) -> Result<(), Failure> {
        let Some((message, content)) = content::read(heard.id, heard.bytes) else {
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

/// The bus of who only listens.
struct Nowhere;

impl Bus for Nowhere {
    fn send(&mut self, _: Time, _: &Frame) -> Result<(), BusError> {
        Err(BusError::Full(0))
    }

    fn receive(&mut self, _: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        Ok(None)
    }
}

impl Counts {
    fn summary(&self, skipped: Skipped, channels: usize) -> String {
        format!(
            "{} frames on {channels} channels: {} messages decoded, {} too short or no text, {} not \
             in the table; {} transported, {} of them broken off; skipped {} frames with 11-bit \
             identifiers, {} remote, {} error",
            self.frames,
            self.decoded,
            self.too_short,
            self.not_in_table,
            self.transported + self.broken,
            self.broken,
            skipped.standard,
            skipped.remote,
            skipped.error,
        )
    }
}
