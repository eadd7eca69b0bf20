//! What is fuzzed: everything that takes bytes of a stranger. Used by the fuzz targets, by the test
//! that runs their corpus, and by the soak.
#![allow(unreachable_pub, dead_code, clippy::unwrap_used, reason = "each test uses a part")]

use std::io::Write;
use std::net::TcpStream;

use j1939::bus::Bus;
use j1939::bus::candump::{Pace, Reader, Replay};
use j1939::bus::loopback::{Loopback, LoopbackNode};
use j1939::bus::socketcand::Server;
use j1939::check::{Carrier, Policy};
use j1939::dm::DiagnosticMessage;
use j1939::supervise::{BusBounds, Exclusive, Supervisor, Watch};
use j1939::{
    AddressClaim, AddressSet, BitRate, Frame, Id, MessageTable, Name, TpEvent, Transport, ident,
};
use tractrix_core::Time;

const MS: i64 = 1_000_000;
/// Bytes of a fuzzed frame: identifier, data, length and step of time.
const FRAME_BYTES: usize = 14;

/// A node and an observer that hear the same frames; what they send goes to nobody.
pub struct Listeners {
    node: Box<Transport<8, 4_000>>,
    observer: Box<Transport<64, 1785>>,
    claim: AddressClaim,
    supervisor: Box<Supervisor<2, 2>>,
    bus: LoopbackNode,
    nobody: LoopbackNode,
    /// Signals that were numbers, so that decoding is not optimised away.
    pub numbers: u64,
    /// Long messages that were whole.
    pub messages: u64,
}

impl Listeners {
    pub fn new() -> Self {
        let wire = Loopback::new(BitRate::Kbit500, 2);
        let watch = |pgn, sa, protection| {
            let (period_nanos, timeout_nanos) = (10 * MS, 90 * MS);
            Watch { pgn, sa, period_nanos, timeout_nanos, protection }
        };
        let tsc1 = (Carrier::TSC1.protection, Policy::WherePresent);
        let watches = [watch(61_444, 0x00, None), watch(0, 0x03, Some(tsc1))];
        let exclusive = |pgn, da| Exclusive { pgn, da, senders: AddressSet::EMPTY };
        let exclusives = [exclusive(0, 0x00), exclusive(1024, 0x0B)];
        let bounds = BusBounds::usual(BitRate::Kbit500);
        Self {
            node: Box::new(Transport::new(255)),
            observer: Box::new(Transport::listener()),
            claim: AddressClaim::new(Name(1 << 63 | 77), 0x2A, 3),
            supervisor: Box::new(Supervisor::new(bounds, watches, exclusives)),
            bus: wire.node(0),
            nobody: wire.node(1),
            numbers: 0,
            messages: 0,
        }
    }

    /// All of them hear a frame.
    pub fn hear(&mut self, now: Time, frame: &Frame) {
        self.numbers += decode(frame.id(), frame.bytes());
        self.supervisor.on_frame(now, frame);
        self.supervisor.poll(now);
        while self.supervisor.take_new().is_some() {}
        self.claim.on_frame(now, frame);
        self.claim.poll(now, &mut self.bus).unwrap();
        self.node.set_address(self.claim.address());
        self.node.on_frame(now, frame);
        self.node.poll(now, &mut self.bus).unwrap();
        while let Some(event) = self.node.event() {
            if let TpEvent::Received(message) = event {
                self.claim.on_message(&message);
            }
        }
        self.observer.on_frame(now, frame);
        self.observer.poll(now, &mut self.bus).unwrap();
        while let Some(event) = self.observer.event() {
            if let TpEvent::Received(message) = event {
                self.messages += 1;
                let raw = 6 << 26 | message.pgn << 8 | u32::from(message.sa);
                self.numbers += decode(Id::from_raw(raw), message.bytes);
            }
        }
        assert!(self.node.sessions() <= 8 && self.observer.sessions() <= 64);
        while self.nobody.receive(now).unwrap().is_some() {}
    }
}

/// Decodes everything that a message can say; returns how many numbers it had.
pub fn decode(id: Id, bytes: &[u8]) -> u64 {
    let table = MessageTable::of(id.pgn());
    let signals =
        table.filter(|t| t.check_length(id, bytes).is_ok()).map_or(&[][..], |t| t.signals);
    let numbers = signals.iter().filter(|s| s.decode(bytes).value().is_some_and(f64::is_finite));
    let mut count = numbers.count() as u64;
    if let Ok(message) = DiagnosticMessage::decode(id, bytes) {
        count += message.dtcs().count() as u64;
    }
    count + ident::fields(id, bytes).filter(Result::is_ok).count() as u64
}

/// Frames at any times.
pub fn frames(data: &[u8]) {
    let mut listeners = Listeners::new();
    let mut now = Time(0);
    for chunk in data.chunks_exact(FRAME_BYTES) {
        let [i0, i1, i2, i3, bytes @ .., len, step] = chunk else { continue };
        now = now.plus_nanos(i64::from(*step) * 10 * MS - 100 * MS);
        let raw = u32::from_le_bytes([*i0, *i1, *i2, *i3]);
        let data = &bytes[..usize::from(*len % 9)];
        listeners.hear(now, &Frame::new(Id::from_raw(raw), data).unwrap());
    }
}

/// A message of any length: parameter group and source, then its bytes.
pub fn messages(data: &[u8]) {
    if let Some((head, bytes)) = data.split_first_chunk::<4>() {
        decode(Id::from_raw(u32::from_le_bytes(*head)), bytes);
    }
}

/// A log, read and replayed.
pub fn candump(data: &[u8]) {
    let read = Reader::new(data).filter(Result::is_ok).count();
    let mut replay = Replay::new(Reader::new(data), None, Pace::Full, Time(0));
    let replayed = std::iter::from_fn(|| replay.receive(Time(0)).ok().flatten()).count();
    assert!(replayed <= read, "{replayed} of {read}");
}

/// What a program says to a server, and what a node hears of it.
pub fn socketcand(data: &[u8]) {
    let wire = Loopback::new(BitRate::Kbit500, 2);
    let mut node = wire.node(1);
    let mut server = Server::bind("127.0.0.1:0", "can0", wire.node(0)).unwrap();
    let mut stream = TcpStream::connect(server.address().unwrap()).unwrap();
    // what does not fit into the socket is not read by a server that has hung up
    let _ = stream.write_all(data);
    drop(stream);
    let mut heard = 0;
    for tick in 0..50 {
        let now = Time(tick * MS);
        server.poll(now).unwrap();
        while node.receive(now).unwrap().is_some() {
            heard += 1;
        }
    }
    // a frame is said in twelve bytes and more
    assert!(heard * 12 <= data.len(), "{heard} frames of {} bytes", data.len());
}
