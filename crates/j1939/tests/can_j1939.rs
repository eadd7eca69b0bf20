//! Against can-j1939, the J1939 stack of Python: over TCP everywhere, over the kernel's CAN sockets
//! in User-Mode Linux. `./test` runs both with the Python that has the peer in `CAN_PYTHON`.
#![cfg(target_os = "linux")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "a test waits"
)]

mod wall;

use std::collections::BTreeSet;

use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::bus::socketcan::SocketCan;
use j1939::bus::socketcand::Server;
use j1939::bus::{Bus, BusError};
use j1939::dm::{DiagnosticMessage, Dtc, Lamps};
use j1939::{AddressClaim, BitRate, Frame, GLOBAL_ADDRESS, Id, Name, Request};
use tractrix_core::{Stamped, Time};
use wall::{Node, Seen, Tool};

const OURS: u8 = 0x80;
const THEIRS: u8 = 0x90;
/// NAME of the peer: maker 666, function 1, serial number 1234567 (tests/py/can_j1939_peer.py).
const THEIR_NAME: u64 = 1 << 40 | 666 << 21 | 1_234_567;
/// What the peer sends back.
const PROPRIETARY_A: u32 = 61_184;
/// What each asks the other for: vehicle and component identification.
const VI: u32 = 65_260;
const CI: u32 = 65_259;
const DM1: u32 = 65_226;
const VIN: &[u8] = b"TRACTRIX000000001*";

/// A bus in memory whose other node is a server that programs connect to.
struct Served {
    server: Server<LoopbackNode>,
    node: LoopbackNode,
}

impl Bus for Served {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        self.node.send(now, frame)
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        self.server.poll(now)?;
        self.node.receive(now)
    }
}

fn dtc(spn: u32, fmi: u8, occurrences: u8) -> Dtc {
    Dtc { spn, fmi, occurrences: Some(occurrences), old_order: false }
}

/// The peer with these words behind its own name.
fn peer(words: &[&str]) -> Tool {
    let python = std::env::var("CAN_PYTHON").expect("CAN_PYTHON: the Python that has can-j1939");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/py/can_j1939_peer.py");
    Tool::start(&[&[python.as_str(), script], words].concat())
}

/// Claims, requests, 500 bytes and trouble codes, each both ways.
fn talk(bus: impl Bus, words: &[&str]) {
    let mut node = Node::new(bus, AddressClaim::new(Name(1), OURS, 0));
    node.until("our own address", |node, _| node.claim.address().is_some());
    let peer = peer(words);
    let claimed = |seen: &Seen| match seen {
        Seen::Frame(frame) => Name::claimed_in(frame).map(|name| (name.0, frame.id().sa())),
        _ => None,
    };
    node.until("the peer's claim", |_, seen| claimed(&seen) == Some((THEIR_NAME, THEIRS)));

    // all of it in any order: sent again until it is answered
    let bytes: Vec<u8> = (0..500).map(|i| (i * 7 + i / 256) as u8).collect();
    let mut codes = [0; 64];
    let dtcs = [dtc(191, 9, 8), dtc(84, 9, 8), dtc(5357, 31, 1)];
    let codes = j1939::dm::write(DM1, &Lamps::default(), &dtcs, &mut codes).unwrap();
    let mut done = BTreeSet::new();
    let (mut line, mut next_s) = (String::new(), 0.0);
    node.until("all answers", |node, seen| {
        while let Ok(byte) = peer.output.try_recv() {
            if byte != b'\n' {
                line.push(char::from(byte));
                continue;
            }
            let vin = String::from_utf8_lossy(VIN).into_owned();
            match line.split_once(' ') {
                Some(("vi", text)) if text == vin => drop(done.insert("VI at the peer")),
                Some(("dm1", "191/9/8 84/9/8 5357/31/1")) => drop(done.insert("DM1 at the peer")),
                Some(("claimed", "144")) => drop(done.insert("its address")),
                Some(("bytes", "500")) => drop(done.insert("500 bytes at the peer")),
                _ => panic!("the peer says {line:?}"),
            }
            line.clear();
        }
        match seen {
            Seen::Frame(frame) => {
                // what it asks for is answered by the transport, to it alone
                let wanted = Request { pgn: VI, da: OURS, sa: THEIRS };
                if Request::of(&frame) == Some(wanted) {
                    let _ = node.transport.send(node.now(), 6, VI, THEIRS, VIN);
                }
            }
            Seen::Received { pgn: PROPRIETARY_A, sa: THEIRS, bytes: back } => {
                assert!(back == bytes, "the bytes differ");
                done.insert("500 bytes back");
            }
            Seen::Received { pgn: CI, sa: THEIRS, bytes } => {
                assert_eq!(bytes, b"PYTHON*J1939*2.0.12*");
                done.insert("its CI");
            }
            Seen::Received { pgn: DM1, sa: THEIRS, bytes } => {
                let id = Id::new(6, DM1, GLOBAL_ADDRESS, THEIRS).unwrap();
                let message = DiagnosticMessage::decode(id, &bytes).unwrap();
                let theirs: Vec<Dtc> = message.dtcs().collect();
                assert_eq!(theirs, [dtc(100, 1, 3), dtc(524_000, 31, 126), dtc(110, 0, 1)]);
                done.insert("its DM1");
            }
            _ => {}
        }
        let now = node.now();
        if now.seconds() > next_s && node.claim.address().is_some() {
            next_s = now.seconds() + 1.0;
            if !done.contains("500 bytes back") {
                // busy while the last one is under way
                let _ = node.transport.send(now, 6, PROPRIETARY_A, THEIRS, &bytes);
            }
            if !done.contains("its CI") {
                let request = Request { pgn: CI, da: THEIRS, sa: OURS }.frame().unwrap();
                node.bus.send(now, &request).unwrap();
            }
            if !done.contains("DM1 at the peer") {
                let _ = node.transport.send(now, 6, DM1, GLOBAL_ADDRESS, codes);
            }
        }
        done.len() == 7
    });
}

#[test]
#[ignore = "needs can-j1939: ./test sets CAN_PYTHON"]
fn over_tcp() {
    let wire = Loopback::new(BitRate::Kbit250, 2);
    let server = Server::bind("127.0.0.1:0", "can0", wire.node(0)).unwrap();
    let port = server.address().unwrap().port().to_string();
    let bus = Served { server, node: wire.node(1) };
    talk(bus, &["socketcand", "can0", "--host", "127.0.0.1", "--port", &port]);
}

#[test]
#[ignore = "needs can-j1939 and CAN sockets: ./test sets CAN_PYTHON, tests/can/uml.sh runs it"]
fn over_the_kernel() {
    talk(SocketCan::open("vcan0", &[]).unwrap(), &["socketcan", "vcan0"]);
}
