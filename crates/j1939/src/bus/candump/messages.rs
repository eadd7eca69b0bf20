//! A log message by message: what the transport puts together is one message.

use std::io::BufRead;

use tractrix_core::Time;

use super::{Reader, Skipped};
use crate::bus::BusError;
use crate::{Assembler, Id, Whole};

/// Transported messages under way at once, on each channel; more are counted as broken.
const SESSIONS: usize = 256;
/// Longest transported message, bytes: all of the transport protocol.
const MESSAGE_BYTES: usize = 1_785;

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
    let mut assemblers: Vec<Assembler<SESSIONS, MESSAGE_BYTES>> = Vec::new();
    while let Some(entry) = reader.next() {
        let entry = entry?;
        let (time, frame, number) = (entry.heard.time, entry.heard.value, entry.channel);
        let channel = reader.channels().get(number).map_or("", String::as_str);
        assemblers.resize_with(assemblers.len().max(number + 1), Assembler::new);
        told.frames += 1;
        let (id, bytes) = (frame.id(), frame.bytes());
        let from = Heard { time, channel_number: number, channel, id, da: id.da(), bytes };
        let goes_on = if Assembler::<SESSIONS, MESSAGE_BYTES>::is_packet(id) {
            let Some(assembler) = assemblers.get_mut(number) else { continue };
            let mut goes_on = true;
            assembler.hear(time, &frame, &mut |whole| {
                let Some(Whole { time, id, da, bytes }) = whole else {
                    told.broken += 1;
                    return Ok::<(), E>(());
                };
                told.transported += 1;
                goes_on &= hear(&Heard { time, id, da, bytes, ..from })?;
                Ok(())
            })?;
            goes_on
        } else {
            hear(&from)?
        };
        if !goes_on {
            break;
        }
    }
    told.skipped = reader.skipped();
    told.channels = reader.channels().len();
    Ok(told)
}
