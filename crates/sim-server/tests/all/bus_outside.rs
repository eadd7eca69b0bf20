//! The closed loop and the virtual truck over a bus outside of the program: a socketcand server.

use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use crate::support::program;
use j1939::bus::Bus;
use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::bus::socketcand::Server;
use j1939::{BitRate, Name};
use tractrix_core::Time;

/// Runs the program beside a server; also says who claimed an address on its bus.
fn beside_a_server(words: &[&str]) -> (Output, Vec<u8>) {
    let wire = Loopback::new(BitRate::Kbit500, 2);
    let (node, mut listener): (LoopbackNode, LoopbackNode) = (wire.node(0), wire.node(1));
    let mut server = Server::bind("127.0.0.1:0", "can0", node).unwrap();
    let bus = format!("socketcand:{}/can0", server.address().unwrap());
    let words: Vec<String> = words.iter().map(|word| word.replace("BUS", &bus)).collect();
    let mut child =
        program().args(&words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let (start, mut claimed) = (Instant::now(), Vec::new());
    while child.try_wait().unwrap().is_none() {
        let now = Time(start.elapsed().as_nanos() as i64);
        server.poll(now).unwrap();
        while let Some(heard) = listener.receive(now).unwrap() {
            if Name::claimed_in(&heard.value).is_some() {
                claimed.push(heard.value.id().sa());
            }
        }
        std::thread::yield_now();
        if start.elapsed() > Duration::from_secs(100) {
            child.kill().unwrap();
        }
    }
    claimed.sort_unstable();
    (child.wait_with_output().unwrap(), claimed)
}

#[test]
fn both_ends_drive_in_step_over_a_server() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let words = ["run", "flat", "--headless", "--duration", "3", "--json", "--out", out];
    let (output, _) = beside_a_server(&[&words[..], &["--vehicle", "BUS"]].concat());
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{error}");
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["bus"]["ticks_not_driven"], 0, "{summary}");
    assert_eq!(summary["bus"]["refused"], 0, "{summary}");
    assert_eq!(summary["collisions"], 0);
    assert!(summary["distance_m"].as_f64().unwrap() > 50.0, "{summary}");
}

#[test]
fn the_virtual_truck_is_held_until_somebody_drives_it() {
    let (output, claimed) = beside_a_server(&["ecu", "flat", "--bus", "BUS", "--duration", "1"]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{error}");
    assert!(error.contains("it is held until it is driven"), "{error}");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("not driven: 0.00 km, 0 collisions"), "{said}");
    assert_eq!(claimed, [0x00, 0x03, 0x0B, 0x13, 0x29, 0x2A, 0x31]);
}
