//! What the firmware for a Cortex-M4 computes, on this computer. `./test` compares the bits that it
//! prints here, on AArch64 and on the Cortex-M4.
#![allow(clippy::disallowed_macros, reason = "the bits are printed")]

#[path = "../../j1939/tests/vectors/mod.rs"]
mod vectors;
#[allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "the firmware uses the rest")]
#[path = "../../j1939/firmware/src/work/mod.rs"]
mod work;

use work::drive::{Drive, TICKS};
use work::{Bits, codec, transfer};

fn bits(name: &str, bits: Bits) {
    println!("bits {name} {:016x}", bits.0);
}

#[test]
fn the_host_does_the_firmware_s_work() {
    codec::known_frames().unwrap();
    bits("signals", codec::every_signal().unwrap().1);
    bits("message", transfer::longest_message().unwrap().1);
    let drives = [
        ("cruise", Drive::cruise as fn() -> _, false),
        ("predictive", Drive::predictive, true),
        ("hills", Drive::hills, true),
    ];
    for (name, new, plans) in drives {
        let mut drive: Drive = new().unwrap();
        for _ in 0..TICKS {
            drive.tick().unwrap();
            drive.step();
        }
        assert_eq!(drive.plans() > 0, plans, "{name}");
        bits(name, drive.bits());
    }
}
