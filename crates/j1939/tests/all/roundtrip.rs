//! Every signal of the table, every raw value: what is decoded encodes to the same bits again, and
//! nothing outside the data band becomes a number.

use j1939::message::MESSAGES;
use j1939::{Signal, Slot};

/// The raw values that are tried: all up to 16 bits; beyond, the edges of the bands and a million
/// steps of a full-period generator (an odd constant modulo 2³² visits every residue).
fn raw_values(signal: &Signal) -> Box<dyn Iterator<Item = u32>> {
    let all_ones = u32::MAX >> (32 - u32::from(signal.length_bits));
    if signal.length_bits <= 16 {
        return Box::new(0..=all_ones);
    }
    let edge = 1 << (signal.length_bits - 8);
    let edges = (0xF9..=0xFF_u32).flat_map(move |top| [top * edge - 1, top * edge, top * edge + 1]);
    let samples = (0..1_000_000_u32).map(move |i| i.wrapping_mul(2_654_435_769) & all_ones);
    Box::new([0, 1, 2, all_ones - 1, all_ones].into_iter().chain(edges).chain(samples))
}

#[test]
fn encoding_what_was_decoded_gives_the_same_bits() {
    let mut tried = 0_u64;
    for message in &MESSAGES {
        for signal in message.signals {
            let all_ones = u32::MAX >> (32 - u32::from(signal.length_bits));
            let mut around = [0xFF; 40];
            place(&mut around, signal, 0);
            for raw in raw_values(signal) {
                // the signal's bits in a message whose other bits are zeros, and ones
                let mut others = [0x00; 40];
                place(&mut others, signal, raw);
                let mut bytes = around;
                bytes.iter_mut().zip(others).for_each(|(byte, other)| *byte |= other);
                assert_eq!(signal.raw(&bytes), raw, "{}", signal.name);
                assert_eq!(signal.raw(&others), raw, "{}", signal.name);

                let slot = signal.decode(&bytes);
                let context = || format!("{} {} raw {raw}: {slot:?}", message.name, signal.name);
                assert_eq!(slot.value().is_some(), raw <= signal.data_max, "{}", context());
                // "not available" has one form on the way out
                let expected = if slot == Slot::NotAvailable { all_ones } else { raw };
                assert_eq!(signal.encode(slot).unwrap(), expected, "{}", context());

                let mut written = bytes;
                signal.write(&mut written, slot).unwrap();
                if expected != raw {
                    place(&mut bytes, signal, expected);
                }
                assert_eq!(written, bytes, "{}", context());
                tried += 1;
            }
        }
    }
    assert!(tried > 10_000_000, "only {tried}");
}

/// Puts raw bits one at a time: the slow way that shares no code with the crate.
fn place(bytes: &mut [u8], signal: &Signal, raw: u32) {
    for i in 0..u16::from(signal.length_bits) {
        let at = signal.start_bit + i;
        let (byte, mask) = (usize::from(at / 8), 1 << (at % 8));
        if raw >> i & 1 == 1 {
            bytes[byte] |= mask;
        } else {
            bytes[byte] &= !mask;
        }
    }
}

#[test]
fn numbers_outside_the_data_band_are_refused() {
    for message in &MESSAGES {
        for signal in message.signals {
            let at = |raw: f64| raw * signal.scale + signal.offset;
            let beyond = at(f64::from(signal.data_max) + 1.0);
            for value in [at(-1.0), beyond, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
                let refused = signal.encode(Slot::Value(value));
                assert!(refused.is_err(), "{} {} {value}", message.name, signal.name);
            }
        }
    }
}

#[test]
fn no_two_signals_of_a_message_share_a_bit_or_a_name() {
    for message in &MESSAGES {
        let mut taken = [false; 320];
        for signal in message.signals {
            for at in 0..usize::from(signal.length_bits) {
                let bit = &mut taken[usize::from(signal.start_bit) + at];
                assert!(!*bit, "{} {}", message.name, signal.name);
                *bit = true;
            }
            let same = message.signals.iter().filter(|other| other.name == signal.name);
            assert_eq!(same.count(), 1, "{} {}", message.name, signal.name);
        }
    }
}
