//! The virtual truck and the program that drives it: two processes, a bus between them, real time.
#![cfg(target_os = "linux")]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "a test waits, and prints figures"
)]

mod support;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use j1939::bus::Bus;
use j1939::bus::loopback::LoopbackNode;
use j1939::{Frame, Id};
use tractrix_core::Time;

use support::{Files, Wire, number_after, sim_server};

/// Engages, follows what drives ahead, and stops when it is asked to end.
fn drives_and_stops(bus: &str, drive_s: f64) {
    let files = Files::new(3.0);
    let (out, health) = (files.path("out"), free_address());
    let mut truck = files.truck(bus);
    truck.until("is held until it is driven");
    let words = ["--engage-after-checks", "--out", &out, "--health", &health];
    let mut node = files.node(bus, &words);
    node.until("ready");
    let engaged = node.until("engaged");
    let start_s = engaged.split(' ').next().unwrap().parse::<f64>().unwrap();
    let state = loop {
        let state = state_of(&health);
        // A busy machine may hold either program up for longer than a signal may be old
        let is_over = state["time_s"].as_f64().unwrap() > start_s + drive_s;
        if is_over && state["engagement"] == "engaged" {
            break state;
        }
        assert!(state["time_s"].as_f64().unwrap() < 60.0, "{state}");
        std::thread::sleep(std::time::Duration::from_millis(50));
    };
    println!("{state}");
    assert!(state["speed_m_s"].as_f64().unwrap() > 0.5, "{state} {}", node.said());
    let gap_m = state["lead"]["gap_m"].as_f64().unwrap();
    assert!(gap_m > 5.0 && gap_m < 80.0, "{state}");
    node.terminate();
    node.until("asked to end: stops");
    // A signal that was late just before may have begun the manoeuvre already
    node.until("stands");
    let summary = node.until("let go at");
    println!("{summary}");
    assert!(number_after(&summary, "guarded,") > 0.0, "no minimal risk: {summary}");
    let (status, said) = node.end();
    assert_eq!(status.code(), Some(0), "{said}");
    assert!(number_after(&summary, "let go at") < 0.1, "{summary}");
    assert!(number_after(&summary, "nearest") > 5.0, "{summary}");
    truck.terminate();
    let (status, said) = truck.end();
    println!("{said}");
    assert_eq!(status.code(), Some(0), "{said}");
    assert!(said.contains(" 0 collisions"), "{said}");
    std::fs::remove_file(files.path("road.xodr")).unwrap();
    for from in ["frames", "ego"] {
        assert_same_again(&format!("{out}/run.mcap"), from);
    }
}

/// The recording holds all that drove the truck: road, sheet, set-up, frames.
fn assert_same_again(file: &str, from: &str) {
    let replayed =
        sim_server().args(["process-replay", file, "--from", from, "--json"]).output().unwrap();
    let errors = String::from_utf8_lossy(&replayed.stderr).into_owned();
    let report: serde_json::Value =
        serde_json::from_slice(&replayed.stdout).unwrap_or_else(|e| panic!("{e}: {errors}"));
    println!("{report}");
    assert_eq!((replayed.status.code(), &report["ticks_different"]), (Some(0), &0.into()));
    assert!(report["ticks_compared"].as_u64().unwrap() > 150, "{report}");
    assert!(!errors.contains("cannot tell"), "{errors}");
}

/// The driver's foot on the accelerator, as the cab's control unit tells it right after the engine
/// has told of a pedal that nobody touches.
fn foot(presses: Arc<AtomicBool>) -> impl FnMut(Time, &mut LoopbackNode) + Send + 'static {
    move |now, bus| {
        while let Some(heard) = bus.receive(now).unwrap() {
            let is_eec2 = heard.value.id().raw() == 0x0CF0_0300;
            if is_eec2 && presses.load(Ordering::Relaxed) {
                let half = [0xFF, 125, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF];
                bus.send(now, &Frame::of(Id::from_raw(0x0CF0_0331), half)).unwrap();
            }
        }
    }
}

/// What is answered to a word.
fn told(control: &str, word: &str) -> String {
    let mut stream = UnixStream::connect(control).unwrap();
    writeln!(stream, "{word}").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer.trim().to_owned()
}

#[test]
fn who_has_taken_over_keeps_the_truck_until_he_hands_it_over_again() {
    let presses = Arc::new(AtomicBool::new(false));
    let wire = Wire::with(foot(Arc::clone(&presses)));
    let files = Files::new(3.0);
    let (out, health, control) = (files.path("out"), free_address(), files.path("control"));
    let mut truck = files.truck(&wire.name);
    truck.until("is held until it is driven");
    let words = ["--out", &out, "--health", &health, "--control", &control];
    let mut node = files.node(&wire.name, &words);
    node.until("ready");
    // not asked for by anybody so far
    assert_eq!(told(&control, "engage"), "engaged");
    node.until("engaged");
    assert_eq!(told(&control, "nonsense"), "engage or disengage, and a new line");
    presses.store(true, Ordering::Relaxed);
    node.until("override");
    let refused = told(&control, "engage");
    assert!(refused != "engaged", "the foot is on the pedal: {refused}");
    presses.store(false, Ordering::Relaxed);
    node.until("ready");
    let driven = |state: &serde_json::Value| state["driven_ticks"].as_u64().unwrap();
    let before = state_of(&health);
    let over_s = before["time_s"].as_f64().unwrap() + 1.0;
    let after = loop {
        let state = state_of(&health);
        assert_eq!(state["engagement"], "ready", "{state}");
        if state["time_s"].as_f64().unwrap() > over_s {
            break state;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    };
    assert_eq!(driven(&before), driven(&after), "nobody has asked for it");
    assert_eq!(told(&control, "engage"), "engaged");
    node.until("engaged");
    assert_eq!(told(&control, "disengage"), "ready");
    assert!(driven(&state_of(&health)) > driven(&after));
    node.terminate();
    let (status, said) = node.end();
    assert_eq!(status.code(), Some(0), "{said}");
    truck.terminate();
    assert_eq!(truck.end().0.code(), Some(0));
    assert!(!std::path::Path::new(&control).exists());
    assert_same_again(&format!("{out}/run.mcap"), "frames");
}

/// A free port of this machine; somebody else may take it, but nobody here does.
fn free_address() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().to_string()
}

fn state_of(health: &str) -> serde_json::Value {
    let mut text = String::new();
    TcpStream::connect(health).unwrap().read_to_string(&mut text).unwrap();
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text:?}"))
}

#[test]
fn drives_and_stops_over_a_server() {
    let wire = Wire::new();
    drives_and_stops(&wire.name, 4.0);
}

#[test]
#[ignore = "needs CAN sockets: tests/can/uml.sh"]
fn drives_and_stops_over_the_kernel() {
    drives_and_stops("can:vcan0", 10.0);
}
