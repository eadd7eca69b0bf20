//! The longest message of the transport protocol, from one node to another.

use super::Bits;
use j1939::bus::{Bus, BusError};
use j1939::{Frame, TpEvent, Transport};
use tractrix_core::{Stamped, Time};

/// The longest message, bytes.
const LENGTH: usize = 1_785;
/// Proprietary A.
const PGN: u32 = 0xEF00;
const FROM: u8 = 0x27;
const TO: u8 = 0x0B;

/// The way between two nodes: what one sends the other receives. A window of packets fits.
struct Queue {
    frames: [Option<Frame>; 64],
    sent: usize,
    received: usize,
}

impl Queue {
    const EMPTY: Self = Self { frames: [None; 64], sent: 0, received: 0 };
}

/// One node's end: where it sends to and where it receives from.
struct End<'a>(&'a mut Queue, &'a mut Queue);

impl Bus for End<'_> {
    fn send(&mut self, _now: Time, frame: &Frame) -> Result<(), BusError> {
        let to = &mut self.0;
        let room = to.frames.len();
        if to.sent - to.received == room {
            return Err(BusError::Full(room));
        }
        to.frames[to.sent % room] = Some(*frame);
        to.sent += 1;
        Ok(())
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let from = &mut self.1;
        if from.sent == from.received {
            return Ok(None);
        }
        let frame = from.frames[from.received % from.frames.len()];
        from.received += 1;
        Ok(frame.map(|value| Stamped { time: now, value }))
    }
}

/// Takes what has come and sends what is due; the bits of a message that has come whole.
fn turn(
    node: &mut Transport<1, LENGTH>,
    now: Time,
    mut end: End<'_>,
    expected: &[u8],
) -> Result<Option<Bits>, &'static str> {
    while let Ok(Some(frame)) = end.receive(now) {
        node.on_frame(now, &frame.value);
    }
    node.poll(now, &mut end).map_err(|_| "the bus refuses")?;
    let mut whole = None;
    while let Some(event) = node.event() {
        match event {
            TpEvent::Received(message) if message.bytes == expected => {
                let mut bits = Bits::NONE;
                bits.add(message.bytes);
                whole = Some(bits);
            }
            TpEvent::Received(_) => return Err("other bytes have come than were sent"),
            TpEvent::Sent { .. } => {}
            TpEvent::Failed { .. } => return Err("a session was given up"),
        }
    }
    Ok(whole)
}

/// Sends 1785 bytes by RTS/CTS in windows of 16: the frames that it takes both ways, and the bits
/// that have come.
pub fn longest_message() -> Result<(usize, Bits), &'static str> {
    let mut bytes = [0; LENGTH];
    for (i, byte) in bytes.iter_mut().enumerate() {
        *byte = (i * 31 % 251) as u8;
    }
    let (mut a, mut b) = (Transport::new(16), Transport::new(16));
    a.set_address(Some(FROM));
    b.set_address(Some(TO));
    let (mut there, mut back) = (Queue::EMPTY, Queue::EMPTY);
    a.send(Time::ZERO, 7, PGN, TO, &bytes).map_err(|_| "it cannot be sent")?;
    let mut arrived = None;
    for ms in 0..1_000 {
        let now = Time(ms * 1_000_000);
        turn(&mut a, now, End(&mut there, &mut back), &bytes)?;
        arrived = turn(&mut b, now, End(&mut back, &mut there), &bytes)?.or(arrived);
        if let Some(bits) = arrived.filter(|_| a.sessions() == 0) {
            return Ok((there.sent + back.sent, bits));
        }
    }
    Err("it has not arrived within a second")
}
