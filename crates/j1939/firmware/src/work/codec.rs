//! Known frames, and every signal of the table both ways.

use super::Bits;
use crate::vectors::{EEC1, NUMBERS, TSC1, XBR};
use j1939::check::{Carrier, Checker, Policy};
use j1939::message::{self, MESSAGES, Message};
use j1939::{Frame, Id, MessageTable, Slot};

/// How many messages with arbitrary bytes each signal is read from.
const MESSAGES_EACH: u32 = 32;

/// The checks of `vectors`; the name of the first that fails.
pub fn known_frames() -> Result<usize, &'static str> {
    for ((id, bytes), name, expected) in NUMBERS {
        let table = MessageTable::of(Id::from_raw(id).pgn()).ok_or(name)?;
        let signal = table.signals.iter().find(|signal| signal.name == name).ok_or(name)?;
        let right = match (signal.decode(&bytes), expected) {
            (Slot::Value(value), Some(expected)) => (value - expected).abs() < 1e-9,
            (Slot::Error(_), None) => true,
            _ => false,
        };
        if !right {
            return Err(name);
        }
    }
    let signed = TSC1.map(|frame| (Carrier::TSC1, frame));
    for (carrier, (id, bytes)) in signed.into_iter().chain([(Carrier::XBR, XBR)]) {
        let id = Id::from_raw(id);
        if carrier.protection.checksum(id, bytes) != bytes[7] >> 4 {
            return Err("checksum");
        }
        for bit in 0..64 {
            let mut wrong = bytes;
            wrong[bit / 8] ^= 1 << (bit % 8);
            let mut checker = Checker::new(carrier.protection, Policy::Required);
            if checker.check(&Frame::of(id, wrong)).passes() {
                return Err("a wrong bit passes the checksum");
            }
        }
    }
    there_and_back::<message::Eec1>(EEC1)?;
    // real ones: they send the bits that nobody uses as ones, as we do
    for frame in TSC1.into_iter().filter(|(id, _)| Id::from_raw(*id).sa() == 0x03) {
        there_and_back::<message::Tsc1>(frame)?;
    }
    Ok(NUMBERS.len() + TSC1.len() + 2)
}

/// A typed message, decoded and encoded, has the same bytes.
fn there_and_back<M: Message>((id, bytes): (u32, [u8; 8])) -> Result<(), &'static str> {
    let message = M::decode(Id::from_raw(id), &bytes).map_err(|_| M::TABLE.name)?;
    let again = message.encode().map_err(|_| M::TABLE.name)?;
    if again.as_ref() == bytes { Ok(()) } else { Err(M::TABLE.name) }
}

/// Decodes every signal of the table from arbitrary bytes and encodes it again: the signals read,
/// and the bits of their numbers.
pub fn every_signal() -> Result<(u32, Bits), &'static str> {
    let (mut signals, mut bits) = (0, Bits::NONE);
    let mut state = 1_u32;
    for _ in 0..MESSAGES_EACH {
        let mut bytes = [0; 40];
        for byte in &mut bytes {
            // the upper bits of a linear congruential generator
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *byte = (state >> 24) as u8;
        }
        for signal in MESSAGES.iter().flat_map(|table| table.signals) {
            let slot = signal.decode(&bytes);
            let raw = signal.encode(slot).map_err(|_| signal.name)?;
            // "not available" has many raw values and one form on the way out
            if slot != Slot::NotAvailable && raw != signal.raw(&bytes) {
                return Err(signal.name);
            }
            bits.add(slot.state().as_bytes());
            bits.number(slot.value().unwrap_or(0.0));
            signals += 1;
        }
    }
    Ok((signals, bits))
}
