//! Logs of a bus, message by message: what the transport puts together is one message.

use std::io::BufRead;
use std::path::Path;

use j1939::bus::candump::{Reader, Skipped};
use j1939::bus::{Bus, BusError};
use j1939::{Frame, GLOBAL_ADDRESS, Id, TpEvent, Transport};
use tractrix_core::{Stamped, Time};

use crate::failure::Failure;

/// Transported messages under way at once, on each channel; more are counted as broken.
const SESSIONS: usize = 256;
/// Longest transported message, bytes: all of the transport protocol.
const MESSAGE_BYTES: usize = 1_785;
/// Priority of a transported message, which its packets do not tell.
const PRIORITY: u8 = 6;
/// Groups of the transport protocols (TP.CM, TP.DT, ETP.CM, ETP.DT): they carry others.
const TRANSPORT: [u32; 4] = [0xEC00, 0xEB00, 0xC800, 0xC700];

/// A message, out of one frame or of many.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Heard<'a> {
    pub(crate) time: Time,
    /// Number and name of the channel.
    pub(crate) channel_number: usize,
    pub(crate) channel: &'a str,
    pub(crate) id: Id,
    /// Destination; of a group that goes to everybody an address too, when it is transported.
    pub(crate) da: u8,
    pub(crate) bytes: &'a [u8],
}

/// What a log had in it.
#[derive(Debug, Default)]
pub(crate) struct Told {
    pub(crate) frames: u64,
    pub(crate) channels: usize,
    pub(crate) transported: u64,
    pub(crate) broken: u64,
    pub(crate) skipped: Skipped,
}

/// Reads a log of candump, in either of its forms, or compressed (`.gz`); `-` is standard input. `hear` says whether to go
/// on.
///
/// # Errors
/// [`Failure::Input`] for a log that cannot be read, with the line, and what `hear` fails with.
pub(crate) fn read(
    log: &Path,
    hear: &mut dyn FnMut(&Heard<'_>) -> Result<bool, Failure>,
) -> Result<Told, Failure> {
    let mut reader = Reader::new(open(log)?);
    let mut told = Told::default();
    let mut transports: Vec<Transport<SESSIONS, MESSAGE_BYTES>> = Vec::new();
    while let Some(entry) = reader.next() {
        let entry = entry.map_err(|e| Failure::file(log, e))?;
        let (time, frame, number) = (entry.heard.time, entry.heard.value, entry.channel);
        let channel = reader.channels().get(number).map_or("", String::as_str);
        transports.resize_with(transports.len().max(number + 1), Transport::listener);
        told.frames += 1;
        let goes_on = if TRANSPORT.contains(&frame.id().pgn()) {
            let Some(transport) = transports.get_mut(number) else { continue };
            let from = Heard {
                time,
                channel_number: number,
                channel,
                id: frame.id(),
                da: frame.id().da(),
                bytes: frame.bytes(),
            };
            transported(transport, &frame, &from, &mut told, hear)?
        } else {
            let (id, bytes) = (frame.id(), frame.bytes());
            hear(&Heard { time, channel_number: number, channel, id, da: id.da(), bytes })?
        };
        if !goes_on {
            break;
        }
    }
    told.skipped = reader.skipped();
    told.channels = reader.channels().len();
    Ok(told)
}

fn open(log: &Path) -> Result<Box<dyn BufRead>, Failure> {
    if log.as_os_str() == "-" {
        return Ok(Box::new(std::io::stdin().lock()));
    }
    let file = std::fs::File::open(log).map_err(|e| Failure::file(log, e))?;
    if log.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
        return Ok(Box::new(std::io::BufReader::new(flate2::read::MultiGzDecoder::new(file))));
    }
    Ok(Box::new(std::io::BufReader::new(file)))
}

/// A packet of a longer message, and the messages that end with it.
fn transported(
    transport: &mut Transport<SESSIONS, MESSAGE_BYTES>,
    frame: &Frame,
    from: &Heard<'_>,
    told: &mut Told,
    hear: &mut dyn FnMut(&Heard<'_>) -> Result<bool, Failure>,
) -> Result<bool, Failure> {
    let time = from.time;
    // first what is overdue: a packet that comes too late belongs to nothing
    transport.poll(time, &mut Nowhere).map_err(Failure::work)?;
    transport.on_frame(time, frame);
    transport.poll(time, &mut Nowhere).map_err(Failure::work)?;
    let mut goes_on = true;
    while let Some(event) = transport.event() {
        match event {
            TpEvent::Received(message) => {
                told.transported += 1;
                let (pgn, da, sa) = (message.pgn, message.da, message.sa);
                let id = Id::new(PRIORITY, pgn, da, sa)
                    .or_else(|_| Id::new(PRIORITY, pgn, GLOBAL_ADDRESS, sa))
                    .map_err(Failure::work)?;
                let (time, bytes) = (message.time, message.bytes);
                goes_on &= hear(&Heard { time, id, da, bytes, ..*from })?;
            }
            TpEvent::Failed { .. } => told.broken += 1,
            TpEvent::Sent { .. } => {}
        }
    }
    Ok(goes_on)
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
