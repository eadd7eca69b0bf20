//! What the program sends: nothing before it is engaged, and no proprietary frame that the sheet
//! does not name.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic, clippy::disallowed_methods, reason = "a test waits")]

mod support;

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex};

use j1939::bus::Bus;
use support::{Files, Wire};

const OURS: u8 = 0x27;
/// Claims, requests, flow of long messages to us.
const LISTENING: [u32; 3] = [60_928, 59_904, 60_416];
const TSC1: u32 = 0;
const XBR: u32 = 1_024;
const ADSC1: u32 = 64_211;
const PROPRIETARY_A: u32 = 61_184;

/// Parameter groups that we sent beside the virtual truck, until `words` are said, with this `[bus]`
/// in the sheet.
fn sent(table: &str, options: &[&str], words: &str) -> BTreeSet<u32> {
    let files = Files::new(3.0);
    let sheet = files.path("sheet.toml");
    let whole = std::fs::read_to_string(&sheet).unwrap();
    let limits = whole.split("[bus.steering]").next().unwrap();
    std::fs::write(&sheet, format!("{limits}{table}")).unwrap();
    let groups = Arc::new(Mutex::new(BTreeSet::new()));
    let heard = Arc::clone(&groups);
    let wire = Wire::with(move |now, bus| {
        while let Some(frame) = bus.receive(now).unwrap() {
            if frame.value.id().sa() == OURS {
                heard.lock().unwrap().insert(frame.value.id().pgn());
            }
        }
    });
    let mut truck = files.truck(&wire.name);
    truck.until("is held until it is driven");
    let mut node = files.node(&wire.name, options);
    node.until(words);
    node.terminate();
    node.until("let go at");
    let (status, said) = node.end();
    assert_eq!(status.code(), Some(0), "{said}");
    let groups = groups.lock().unwrap();
    groups.clone()
}

#[test]
fn who_only_listens_asks_nothing_of_the_truck() {
    let groups = sent("", &[], "ready");
    assert!(groups.iter().all(|pgn| LISTENING.contains(pgn)), "{groups:?}");
    assert!(groups.contains(&60_928), "{groups:?}");
}

#[test]
fn no_proprietary_frame_is_sent_that_the_sheet_does_not_name() {
    let groups = sent("", &["--engage-after-checks"], "engaged");
    assert!([TSC1, XBR, ADSC1].iter().all(|pgn| groups.contains(pgn)), "{groups:?}");
    assert!(!groups.contains(&PROPRIETARY_A), "{groups:?}");
}

/// Brakes that take XBR in Proprietary A get it there, and there alone.
#[test]
fn a_maker_s_brake_demand_goes_where_the_sheet_says() {
    let table = "[bus]\nxbr = { pgn = 61184, priority = 3, key = 0x3C }\n";
    let groups = sent(table, &["--engage-after-checks"], "engaged");
    assert!(groups.contains(&PROPRIETARY_A) && !groups.contains(&XBR), "{groups:?}");
}
