//! A bus that is only listened to: what its nodes send each other in packets, put together.

use tractrix_core::{Stamped, Time};

use crate::bus::{Bus, BusError};
use crate::{Frame, GLOBAL_ADDRESS, Id, TpEvent, Transport};

/// Groups of the transport protocols (TP.CM, TP.DT, ETP.CM, ETP.DT; SAE J1939-21): they carry others.
const TRANSPORT: [u32; 4] = [0xEC00, 0xEB00, 0xC800, 0xC700];
/// Priority of a transported message, which its packets do not tell: the default of what informs
/// (SAE J1939-21).
const PRIORITY: u8 = 6;

/// A message out of many frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whole<'a> {
    /// Time of its last packet.
    pub time: Time,
    /// Identifier, as if it had come in one frame. Of a group that goes to everybody its destination
    /// is not in it.
    pub id: Id,
    /// Destination.
    pub da: u8,
    /// Payload.
    pub bytes: &'a [u8],
}

/// Puts messages together, `SESSIONS` at once, each of at most `BYTES` bytes.
#[derive(Debug, Clone)]
pub struct Assembler<const SESSIONS: usize, const BYTES: usize>(Transport<SESSIONS, BYTES>);

impl<const SESSIONS: usize, const BYTES: usize> Assembler<SESSIONS, BYTES> {
    /// Nothing heard yet.
    #[must_use]
    pub fn new() -> Self {
        Self(Transport::listener())
    }

    /// Whether a frame of this identifier carries a part of a message.
    #[must_use]
    pub fn is_packet(id: Id) -> bool {
        TRANSPORT.contains(&id.pgn())
    }

    /// Hears a packet. `take` gets each message that ends with it, and `None` for each that broke
    /// off.
    ///
    /// # Errors
    /// What `take` fails with; messages behind that one wait for the next packet.
    pub fn hear<E>(
        &mut self,
        time: Time,
        frame: &Frame,
        take: &mut dyn FnMut(Option<Whole<'_>>) -> Result<(), E>,
    ) -> Result<(), E> {
        // First what is overdue: a packet that comes too late belongs to nothing. A listener sends
        // nothing, so that nothing can fail.
        let _ = self.0.poll(time, &mut Nowhere);
        self.0.on_frame(time, frame);
        let _ = self.0.poll(time, &mut Nowhere);
        while let Some(event) = self.0.event() {
            match event {
                TpEvent::Received(message) => {
                    let (pgn, da, sa) = (message.pgn, message.da, message.sa);
                    let id = Id::new(PRIORITY, pgn, da, sa)
                        .or_else(|_| Id::new(PRIORITY, pgn, GLOBAL_ADDRESS, sa));
                    let (time, bytes) = (message.time, message.bytes);
                    take(id.ok().map(|id| Whole { time, id, da, bytes }))?;
                }
                TpEvent::Failed { .. } => take(None)?,
                TpEvent::Sent { .. } => {}
            }
        }
        Ok(())
    }
}

impl<const SESSIONS: usize, const BYTES: usize> Default for Assembler<SESSIONS, BYTES> {
    fn default() -> Self {
        Self::new()
    }
}

/// The bus of who only listens.
struct Nowhere;

impl Bus for Nowhere {
    fn send(&mut self, _: Time, _: &Frame) -> Result<(), BusError> {
        Err(BusError::Off)
    }

    fn receive(&mut self, _: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use super::*;

    fn frame(id: u32, data: [u8; 8]) -> Frame {
        Frame::new(Id::from_raw(id), &data).unwrap()
    }

    /// DM1 of the brakes with two codes, to everybody; then one whose second packet never comes.
    #[test]
    fn packets_are_one_message_and_a_lost_one_breaks_it() {
        let mut bus = Assembler::<4, 1785>::new();
        let (mut whole, mut broken) = (Vec::new(), 0);
        let announced = frame(0x1CEC_FF0B, [0x20, 10, 0, 2, 0xFF, 0xCA, 0xFE, 0x00]);
        let first = frame(0x1CEB_FF0B, [1, 0x00, 0xFF, 0xBF, 0x00, 0x09, 0x01, 0x6E]);
        let second = frame(0x1CEB_FF0B, [2, 0x00, 0x13, 0x01, 0xFF, 0xFF, 0xFF, 0xFF]);
        let heard = [(0, announced), (10, first), (20, second), (1_000, announced), (3_000, first)];
        for (ms, packet) in heard {
            assert!(Assembler::<4, 1785>::is_packet(packet.id()));
            let heard = bus.hear(Time(ms * 1_000_000), &packet, &mut |message| {
                match message {
                    Some(m) => whole.push((m.time, m.id.pgn(), m.id.sa(), m.da, m.bytes.len())),
                    None => broken += 1,
                }
                Ok::<(), Infallible>(())
            });
            assert_eq!(heard, Ok(()));
        }
        assert_eq!(whole, [(Time(20_000_000), 0xFECA, 0x0B, 0xFF, 10)]);
        assert_eq!(broken, 1);
    }
}
