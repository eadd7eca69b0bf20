//! Two nodes and an observer on a bus in memory, and what they have seen.

use super::super::*;
use crate::BitRate;
use crate::bus::faults::{FaultPlan, Faults};
use crate::bus::loopback::{Loopback, LoopbackNode};

pub(super) type Node = Transport<4, 2000>;

/// What a node has seen.
#[derive(Debug, PartialEq)]
pub(super) enum Seen {
    Received { pgn: u32, sa: u8, bytes: Vec<u8> },
    Sent { pgn: u32 },
    Failed { reason: AbortReason, by_peer: bool },
}

/// Two nodes, 0x80 and 0x90, and an observer on a bus of 250 kbit/s, polled every millisecond.
pub(super) struct Rig<T = Node> {
    pub(super) now: i64,
    pub(super) nodes: [(T, Faults<LoopbackNode>); 2],
    pub(super) observer: LoopbackNode,
    pub(super) listener: Transport<8, 2000>,
    pub(super) seen: [Vec<Seen>; 2],
    pub(super) heard: Vec<(i64, Frame)>,
    pub(super) overheard: Vec<Seen>,
}

pub(super) fn seen(event: TpEvent<'_>) -> Seen {
    match event {
        TpEvent::Received(m) => Seen::Received { pgn: m.pgn, sa: m.sa, bytes: m.bytes.to_vec() },
        TpEvent::Sent { pgn, .. } => Seen::Sent { pgn },
        TpEvent::Failed { reason, by_peer, .. } => Seen::Failed { reason, by_peer },
    }
}

impl<const S: usize, const B: usize> Rig<Transport<S, B>> {
    pub(super) fn new(windows: [u8; 2], plan: FaultPlan, seed: u64) -> Self {
        let bus = Loopback::new(BitRate::Kbit250, 3);
        let node = |i: usize, address| {
            let mut transport = Transport::new(windows[i]);
            transport.set_address(Some(address));
            (transport, Faults::new(bus.node(i), plan, seed + i as u64))
        };
        let nodes = [node(0, 0x80), node(1, 0x90)];
        let listener = Transport::listener();
        let (seen, heard) = ([Vec::new(), Vec::new()], Vec::new());
        Self { now: 0, nodes, observer: bus.node(2), listener, seen, heard, overheard: Vec::new() }
    }

    pub(super) fn plain() -> Self {
        Self::new([16; 2], FaultPlan::default(), 1)
    }

    pub(super) fn run_ms(&mut self, ms: i64) {
        for _ in 0..ms {
            self.now += MS;
            let now = Time(self.now);
            for ((transport, bus), seen_here) in self.nodes.iter_mut().zip(&mut self.seen) {
                while let Some(heard) = bus.receive(now).unwrap() {
                    transport.on_frame(heard.time, &heard.value);
                }
                transport.poll(now, bus).unwrap();
                while let Some(event) = transport.event() {
                    seen_here.push(seen(event));
                }
            }
            while let Some(heard) = self.observer.receive(now).unwrap() {
                self.listener.on_frame(heard.time, &heard.value);
                self.heard.push((heard.time.0 / MS, heard.value));
            }
            self.listener.poll(now, &mut self.observer).unwrap();
            while let Some(event) = self.listener.event() {
                self.overheard.push(seen(event));
            }
        }
    }

    pub(super) fn send(
        &mut self,
        from: usize,
        pgn: u32,
        da: u8,
        bytes: &[u8],
    ) -> Result<(), J1939Error> {
        self.nodes[from].0.send(Time(self.now), 6, pgn, da, bytes)
    }

    /// A frame of an outsider.
    pub(super) fn say(&mut self, pgn: u32, da: u8, sa: u8, data: [u8; 8]) {
        let id = Id::new(7, pgn, da, sa).unwrap();
        self.observer.send(Time(self.now), &Frame::of(id, data)).unwrap();
    }

    /// Control bytes of what was heard of a group since the last call.
    pub(super) fn controls(&mut self) -> Vec<(u8, [u8; 8])> {
        let heard = std::mem::take(&mut self.heard);
        let control = |f: &Frame| matches!(f.id().pgn(), 60_416 | 51_200);
        let bytes = |f: &Frame| (f.id().sa(), f.bytes().try_into().unwrap());
        heard.iter().filter(|(_, f)| control(f)).map(|(_, f)| bytes(f)).collect()
    }
}
