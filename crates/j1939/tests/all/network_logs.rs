//! Transport and supervision on logs of real trucks.

use std::io::BufReader;

use flate2::read::GzDecoder;
use j1939::bus::candump::{Pace, Reader, Replay};
use j1939::bus::{Bus, loopback::Loopback};
use j1939::supervise::{BusBounds, BusFault, Exclusive, Supervisor, Watch};
use j1939::{AddressSet, BitRate, Frame, TpEvent, Transport};
use tractrix_core::{Stamped, Time};

const EEC1: u32 = 61_444;
const TSC1: u32 = 0;

/// All frames of a log, from time zero.
fn frames(log: &str) -> Vec<Stamped<Frame>> {
    let path = format!("{}/../../tests/data/j1939/{log}.log.gz", env!("CARGO_MANIFEST_DIR"));
    let file = std::fs::File::open(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let reader = Reader::new(BufReader::new(GzDecoder::new(file)));
    let mut replay = Replay::new(reader, None, Pace::Full, Time::ZERO);
    let next = || replay.receive(Time::ZERO).unwrap();
    std::iter::from_fn(next).collect()
}

#[test]
fn the_broadcasts_of_the_logs_are_whole() {
    for (log, count, sent) in
        [("t270_normal", 44, 19_957), ("t270_tsc1", 45, 21_568), ("t270_address_claim", 36, 15_723)]
    {
        let frames = frames(log);
        assert_eq!(frames.len(), sent, "{log}");
        let mut transport = Transport::<8, 1785>::listener();
        let mut nowhere = Loopback::new(BitRate::Kbit250, 0).node(0);
        let (mut whole, mut broken) = (0, Vec::new());
        for heard in frames {
            transport.on_frame(heard.time, &heard.value);
            transport.poll(heard.time, &mut nowhere).unwrap();
            while let Some(event) = transport.event() {
                match event {
                    TpEvent::Received(message) => {
                        assert_eq!(message.da, 0xFF);
                        whole += 1;
                    }
                    other => broken.push(format!("{:?}: {other:?}", heard.time)),
                }
            }
        }
        assert_eq!((whole, broken), (count, vec![]), "{log}");
    }
}

/// What the supervision of a truck's messages says about a log: fault and when it was first seen.
fn events(log: &str, rate: BitRate, watches: &[(u32, u8, i64, i64)]) -> Vec<(BusFault, f64)> {
    let ms = 1_000_000;
    let watch = |at: usize| {
        let (pgn, sa, period, timeout) = watches.get(at).copied().unwrap_or((u32::MAX, 0, 1, 1));
        let (period_nanos, timeout_nanos) = (period * ms, timeout * ms);
        Watch { pgn, sa, period_nanos, timeout_nanos, protection: None }
    };
    let watches: [Watch; 8] = std::array::from_fn(watch);
    // an engine, a retarder and the brakes obey one source each, whoever it is
    let exclusives = [(TSC1, 0x00), (TSC1, 0x29), (1024, 0x0B)];
    let senders = AddressSet::EMPTY;
    let exclusives = exclusives.map(|(pgn, da)| Exclusive { pgn, da, senders });
    let mut supervisor = Supervisor::new(BusBounds::usual(rate), watches, exclusives);
    let mut found = Vec::new();
    for heard in frames(log) {
        supervisor.on_frame(heard.time, &heard.value);
        supervisor.poll(heard.time);
        let new = std::iter::from_fn(|| supervisor.take_new());
        found.extend(new.map(|event| (event.fault, event.since.seconds())));
    }
    assert_eq!(supervisor.dropped(), 0);
    found
}

/// Engine, brakes, transmission and speed of the T270; period and timeout in ms.
const T270: [(u32, u8, i64, i64); 6] = [
    (EEC1, 0x00, 20, 90),
    (61_443, 0x00, 20, 90),
    (61_442, 0x03, 10, 90),
    (61_441, 0x0B, 100, 300),
    (65_265, 0x00, 100, 300),
    (65_265, 0x31, 100, 300),
];

#[test]
fn healthy_trucks_cause_no_event() {
    assert_eq!(events("t270_normal", BitRate::Kbit250, &T270), []);
    let css = [(EEC1, 0x00, 10, 90), (65_265, 0x00, 100, 300), (61_443, 0x00, 50, 300)];
    assert_eq!(events("css_truck_idle", BitRate::Kbit250, &css), []);
    // the recorder lost frames: EEC1 stays away for up to 100.3 ms
    let uthp = [
        (EEC1, 0x00, 20, 110),
        (61_449, 0x0B, 10, 90),
        (65_134, 0x0B, 10, 90),
        (61_469, 0x13, 10, 90),
        (65_265, 0x00, 100, 400),
    ];
    assert_eq!(events("uthp_modern_parked", BitRate::Kbit500, &uthp), []);
}

#[test]
fn the_claim_that_silences_the_engine_is_noticed_at_once_and_the_silence_within_100_ms() {
    let found = events("t270_address_claim", BitRate::Kbit250, &T270);
    let (fault, at_s) = found[0];
    assert_eq!(fault, BusFault::NullName { address: 0 });
    // the log counts from its first frame; the claim is at 15.498163 s there
    assert!((15.49..15.50).contains(&at_s), "{at_s}");
    let lost = BusFault::SignalLost { pgn: EEC1, sa: 0 };
    let (_, at_s) = found.iter().find(|(fault, _)| *fault == lost).unwrap();
    assert!(at_s - 15.488_864 < 0.1, "last heard at 15.488864 s, lost at {at_s}");
}

#[test]
fn injected_torque_demands_are_noticed_in_the_first_frame() {
    let found = events("t270_tsc1", BitRate::Kbit250, &T270);
    assert_eq!(found.len(), 1, "{found:?}");
    let (fault, at_s) = found[0];
    assert_eq!(fault, BusFault::Spoofed { pgn: TSC1, sa: 0x0B });
    assert!((at_s - 14.975_137).abs() < 1e-9, "{at_s}");
}
