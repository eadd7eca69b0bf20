//! Who watches the program, and where it takes its pose from.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::panic, clippy::disallowed_methods, reason = "a test waits")]

mod support;

use std::io::Write;
use std::net::TcpListener;
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use planner::localise::MapProjection;
use road::Road;
use support::{Files, PATIENCE, Wire};

/// What systemd hears, up to and with a message that has these words.
fn until(systemd: &UnixDatagram, words: &str) -> Vec<String> {
    let (mut heard, mut bytes) = (Vec::new(), [0; 1024]);
    loop {
        let len = systemd.recv(&mut bytes).unwrap_or_else(|e| panic!("{words}: {e}, {heard:?}"));
        heard.push(String::from_utf8(bytes[..len].to_vec()).unwrap());
        if heard.last().unwrap().contains(words) {
            return heard;
        }
    }
}

#[test]
fn systemd_and_a_hardware_watchdog_are_fed_until_the_end() {
    let files = Files::new(3.0);
    let (socket, hardware) = (files.path("notify"), files.path("watchdog"));
    let systemd = UnixDatagram::bind(&socket).unwrap();
    systemd.set_read_timeout(Some(PATIENCE)).unwrap();
    std::fs::write(&hardware, "").unwrap();
    let wire = Wire::new();
    let environment = [("NOTIFY_SOCKET", &*socket), ("WATCHDOG_USEC", "100000")];
    let words = ["--watchdog", &hardware];
    let node = files.node_with(&wire.name, &words, &environment);
    assert_eq!(until(&systemd, "READY=1"), ["READY=1"]);
    for _ in 0..20 {
        let fed = until(&systemd, "WATCHDOG=1");
        assert_eq!(fed, ["WATCHDOG=1\nSTATUS=checking, off, 0.0 m/s"]);
    }
    node.terminate();
    until(&systemd, "STOPPING=1");
    let (status, said) = node.end();
    assert_eq!(status.code(), Some(0), "{said}");
    let fed = std::fs::read(&hardware).unwrap();
    let (last, before) = fed.split_last().unwrap();
    assert!(*last == b'V' && !before.is_empty() && before.iter().all(|b| *b == 0), "{fed:?}");
}

/// A sentence with its checksum.
fn gga(second: f64, [latitude_deg, longitude_deg]: [f64; 2]) -> String {
    let dm = |deg: f64| 100.0 * deg.floor() + 60.0 * deg.fract();
    let body = format!(
        "GPGGA,{:09.2},{:014.9},N,{:015.9},E,4,12,0.8,100.0,M,0.0,M,,",
        120_000.0 + second,
        dm(latitude_deg),
        dm(longitude_deg)
    );
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

/// The receiver stands a metre to the left of the truck: it is believed, and not the bus.
#[test]
fn the_pose_is_that_of_the_receiver_that_is_asked_for() {
    let files = Files::new(3.0);
    let road = Road::load(&files.path("road.xodr")).unwrap();
    let place = MapProjection::new(road.geo_reference().unwrap()).unwrap();
    let at = place.on_earth_deg(30.0, -0.875).unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let receiver = format!("nmea:{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let (mut to, _) = listener.accept().unwrap();
        for i in 0..500 {
            let garbage = if i % 3 == 0 { "$GPGGA,nonsense*00\r\n\u{fffd}" } else { "" };
            let sentence = gga(0.1 * f64::from(i), at);
            if write!(to, "{garbage}\n{sentence}").is_err() {
                break;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    let wire = Wire::new();
    let mut truck = files.truck(&wire.name);
    truck.until("is held until it is driven");
    let mut node = files.node(&wire.name, &["--pose", &receiver]);
    let pose = node.until("ok      pose");
    assert!(pose.contains("s 30.0 m, d -0.8"), "{pose}");
    node.terminate();
    let (status, said) = node.end();
    assert_eq!(status.code(), Some(0), "{said}");
    assert!(said.contains("drove 0 of"), "{said}");
}
