//! `can`: on a bus behind a server, with another node on it.

use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use crate::support::{program, refused};
use j1939::bus::Bus;
use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::bus::socketcand::Server;
use j1939::{
    Acknowledgment, AddressClaim, Answer, BitRate, Frame, Id, Name, Request, TpEvent, Transport,
};
use tractrix_core::Time;

/// What a node at 0x00 answers with.
const VI: u32 = 65_260;
const VIN: &[u8] = b"TRACTRIX000000001*";

/// A truck with one unit: address 0, a VIN, an engine speed every 10 ms, and what it was sent.
struct Truck {
    start: Instant,
    server: Server<LoopbackNode>,
    node: LoopbackNode,
    claim: AddressClaim,
    transport: Transport<4, 1785>,
    ticks: u64,
    received: Vec<(u32, Vec<u8>)>,
}

impl Truck {
    fn new() -> (Self, String) {
        let wire = Loopback::new(BitRate::Kbit250, 2);
        let server = Server::bind("127.0.0.1:0", "can0", wire.node(0)).unwrap();
        let bus = format!("socketcand:{}/can0", server.address().unwrap());
        let claim = AddressClaim::new(Name(5), 0x00, 0);
        let (transport, received) = (Transport::new(16), Vec::new());
        let start = Instant::now();
        (Self { start, server, node: wire.node(1), claim, transport, ticks: 0, received }, bus)
    }

    fn step(&mut self) {
        let now = Time(self.start.elapsed().as_nanos() as i64);
        self.server.poll(now).unwrap();
        while let Some(heard) = self.node.receive(now).unwrap() {
            self.claim.on_frame(heard.time, &heard.value);
            self.transport.on_frame(heard.time, &heard.value);
            match Request::of(&heard.value) {
                Some(Request { pgn: VI, sa, .. }) => {
                    self.transport.send(now, 6, VI, sa, VIN).unwrap();
                }
                Some(Request { pgn, sa, .. }) if pgn != j1939::ADDRESS_CLAIMED_PGN => {
                    let answer = Answer::Negative;
                    let no = Acknowledgment { answer, group_function: 0xFF, address: sa, pgn };
                    self.node.send(now, &no.frame(0x00)).unwrap();
                }
                _ => {}
            }
        }
        if now.0 / 10_000_000 > self.ticks as i64 {
            self.ticks = (now.0 / 10_000_000) as u64;
            let id = Id::new(3, 61_444, 0xFF, 0x00).unwrap();
            self.node.send(now, &Frame::of(id, self.ticks.to_le_bytes())).unwrap();
        }
        self.claim.poll(now, &mut self.node).unwrap();
        self.transport.set_address(self.claim.address());
        self.transport.poll(now, &mut self.node).unwrap();
        while let Some(event) = self.transport.event() {
            if let TpEvent::Received(message) = event {
                self.received.push((message.pgn, message.bytes.to_vec()));
            }
        }
    }
}

/// Runs the program on the truck's bus.
fn can(truck: &mut Truck, bus: &str, words: &[&str]) -> Output {
    let mut command = program();
    command.args(["can", "--bus", bus]).args(words);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        truck.step();
        std::thread::sleep(Duration::from_micros(200));
        if start.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
        }
    }
    child.wait_with_output().unwrap()
}

fn said(output: &Output) -> (String, String, Option<i32>) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    (text(&output.stdout), text(&output.stderr), output.status.code())
}

#[test]
fn a_bus_is_looked_at() {
    let (mut truck, bus) = Truck::new();
    let (lines, error, code) = said(&can(&mut truck, &bus, &["dump", "--count", "20"]));
    assert_eq!((lines.lines().count(), code), (20, Some(0)), "{error}");
    let entries: Vec<_> =
        j1939::bus::candump::Reader::new(lines.as_bytes()).map(Result::unwrap).collect();
    let engine = entries.iter().filter(|e| e.heard.value.id().pgn() == 61_444);
    assert!(engine.count() >= 18, "{lines}");
    assert!(lines.lines().all(|line| line.contains(") can0 ")), "{lines}");
    let (_, error, code) = said(&can(&mut truck, &bus, &["dump", "--duration", "0.05"]));
    assert_eq!(code, Some(0), "{error}");
}

#[test]
fn an_address_is_claimed_or_is_another_s() {
    let (mut truck, bus) = Truck::new();
    let claim = |truck: &mut Truck, words: &[&str]| {
        said(&can(truck, &bus, &[&["claim", "--duration", "0.1"], words].concat()))
    };
    assert_eq!(claim(&mut truck, &[]).0, "claimed 0xF9");
    let (line, error, _) = claim(&mut truck, &["--address", "0"]);
    assert_eq!(line, "claimed 0x80", "a NAME that can choose takes a free one: {error}");
    let (_, error, code) = claim(&mut truck, &["--address", "0", "--name", "77"]);
    assert_eq!(
        (error.as_str(), code),
        ("error: the address is another's, with a smaller NAME", Some(2))
    );
}

#[test]
fn what_is_asked_for_is_answered() {
    let (mut truck, bus) = Truck::new();
    let hex: String = VIN.iter().map(|byte| format!("{byte:02X}")).collect();
    for words in [&["request", "65260", "--to", "0"][..], &["request", "0xFEEC"]] {
        let (line, error, code) = said(&can(&mut truck, &bus, words));
        assert_eq!((line, code), (format!("0x00 {hex}"), Some(0)), "{error}");
    }
    let (line, _, _) = said(&can(&mut truck, &bus, &["request", "65259", "--to", "0"]));
    assert_eq!(line, "0x00 answers Negative");
    let (_, error, code) = said(&can(&mut truck, &bus, &["request", "65259", "--to", "9"]));
    assert_eq!(
        (error.as_str(), code),
        ("error: nobody answered the request for PGN 65259", Some(1))
    );
}

#[test]
fn messages_of_any_length_are_sent() {
    let (mut truck, bus) = Truck::new();
    let words = ["send", "0xEF00", &"5A".repeat(300), "--to", "0"];
    let (line, error, _) = said(&can(&mut truck, &bus, &words));
    assert_eq!(line, "300 bytes sent from 0xF9", "{error}");
    assert_eq!(truck.received, [(0xEF00, vec![0x5A; 300])]);
    let (_, error, code) =
        said(&can(&mut truck, &bus, &["send", "0xEF00", &"5A".repeat(300), "--to", "7"]));
    assert_eq!(code, Some(1));
    assert!(error.contains("PGN 61184 to 0x07: this node gave up: timeout"), "{error}");
}

#[test]
fn wrong_usage_is_one_line() {
    for (words, says) in [
        (&["can", "dump"][..], "--bus is missing"),
        (&["can", "--bus", "vcan0", "dump"], "--bus vcan0: a bus is can:IFACE"),
        (&["can", "--bus", "can:nosuch0", "dump"], "nosuch0: "),
        (&["can", "--bus", "socketcand:127.0.0.1:1/can0", "dump"], "127.0.0.1:1/can0: "),
        (&["can", "--bus", "can:a", "claim", "--address", "254"], "--address"),
        (&["can", "--bus", "can:a", "send", "61184", "0"], "hexadecimal"),
    ] {
        let line = refused(words);
        assert!(line.contains(says), "{line}");
    }
}
