//! A log message by message: what the transport puts together is one message.

use std::io::BufRead;

use tractrix_core::{Stamped, Time};

use super::{Reader, Skipped};
use crate::bus::{Bus, BusError};
use crate::{Frame, GLOBAL_ADDRESS, Id, TpEvent, Transport};

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
pub struct Heard<'a> {
    /// Time in the log.
    pub time: Time,
    /// Number of the channel, in the order in which they came.
    pub channel_number: usize,
    /// Name of the channel.
    pub channel: &'a str,
    /// Identifier.
    pub id: Id,
    /// Destination; of a group that goes to everybody an address too, when it is transported.
    pub da: u8,
    /// Payload.
    pub bytes: &'a [u8],
}

/// What a log had in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Told {
    /// J1939 frames.
    pub frames: u64,
    /// Channels.
    pub channels: usize,
    /// Messages that the transport put together.
    pub transported: u64,
    /// Messages of several frames that broke off.
    pub broken: u64,
    /// What is no J1939 frame.
    pub skipped: Skipped,
}

/// Reads a log of candump, in either of its forms. `hear` says whether to go on.
///
/// # Errors
/// [`BusError`] with the line for a log that cannot be read, and what `hear` fails with.
pub fn messages<E: From<BusError>>(
    log: impl BufRead,
    hear: &mut dyn FnMut(&Heard<'_>) -> Result<bool, E>,
) -> Result<Told, E> {
    let mut reader = Reader::new(log);
    let mut told = Told::default();
    let mut transports: Vec<Transport<SESSIONS, MESSAGE_BYTES>> = Vec::new();
    while let Some(entry) = reader.next() {
        let entry = entry?;
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

/// A packet of a longer message, and the messages that end with it.
fn transported<E: From<BusError>>(
    transport: &mut Transport<SESSIONS, MESSAGE_BYTES>,
    frame: &Frame,
    from: &Heard<'_>,
    told: &mut Told,
    hear: &mut dyn FnMut(&Heard<'_>) -> Result<bool, E>,
) -> Result<bool, E> {
    let time = from.time;
    // first what is overdue: a packet that comes too late belongs to nothing
    transport.poll(time, &mut Nowhere)?;
    transport.on_frame(time, frame);
    transport.poll(time, &mut Nowhere)?;
    let mut goes_on = true;
    while let Some(event) = transport.event() {
        match event {
            TpEvent::Received(message) => {
                told.transported += 1;
                let (pgn, da, sa) = (message.pgn, message.da, message.sa);
                let id = Id::new(PRIORITY, pgn, da, sa)
                    .or_else(|_| Id::new(PRIORITY, pgn, GLOBAL_ADDRESS, sa));
                let Ok(id) = id else {
                    told.broken += 1;
                    continue;
                };
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
