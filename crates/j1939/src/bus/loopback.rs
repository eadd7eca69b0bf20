//! A bus in memory: bit times with stuffing, arbitration, several nodes.
//!
//! Time comes with the calls; the same calls give the same frames at the same times. A frame that
//! is sent at `now` is heard when it is through, never in the same instant, so that the order in
//! which nodes are called within a tick does not matter.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tractrix_core::{Stamped, Time};

use super::{Bus, BusError};
use crate::{BitRate, BusLoad, Frame, frame_bits};

/// Frames in a node's send queue, in the order in which they were sent, as in SocketCAN.
const SEND_QUEUE: usize = 64;
/// Frames that wait to be received; more are lost, as in a controller that nobody reads.
const RECEIVE_QUEUE: usize = 4096;

/// The wire. Nodes are handles on it.
#[derive(Debug)]
pub struct Loopback(Arc<Mutex<Wire>>);

impl Loopback {
    /// An idle bus with a number of nodes.
    #[must_use]
    pub fn new(rate: BitRate, nodes: usize) -> Self {
        let free_at = Time(i64::MIN);
        let nodes = vec![Node::default(); nodes];
        Self(Arc::new(Mutex::new(Wire { rate, free_at, nodes, load: BusLoad::new(rate) })))
    }

    /// The handle of a node, counted from 0; any number of handles are the same node. A node that
    /// the bus does not have hears nothing, and its send queue has no room.
    #[must_use]
    pub fn node(&self, index: usize) -> LoopbackNode {
        LoopbackNode { wire: Arc::clone(&self.0), index }
    }

    /// A bus of its own with the same frames under way; its nodes have the same numbers.
    #[must_use]
    pub fn fork(&self) -> Self {
        Self(Arc::new(Mutex::new(lock(&self.0).clone())))
    }

    /// Share of the last second in which the bus was busy, 0 to 1.
    #[must_use]
    pub fn load(&self, now: Time) -> f64 {
        let mut wire = lock(&self.0);
        wire.advance(now);
        wire.load.share(now)
    }
}

/// One node of a [`Loopback`].
#[derive(Debug)]
pub struct LoopbackNode {
    wire: Arc<Mutex<Wire>>,
    index: usize,
}

impl LoopbackNode {
    /// Frames lost because the node did not receive in time.
    #[must_use]
    pub fn overruns(&self) -> u64 {
        lock(&self.wire).nodes.get(self.index).map_or(0, |node| node.overruns)
    }
}

impl Bus for LoopbackNode {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        let mut wire = lock(&self.wire);
        wire.advance(now);
        let room = BusError::Full(SEND_QUEUE);
        let node = wire.nodes.get_mut(self.index).ok_or(room.clone())?;
        if node.sending.len() >= SEND_QUEUE {
            return Err(room);
        }
        node.sending.push_back(Stamped { time: now, value: *frame });
        Ok(())
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let mut wire = lock(&self.wire);
        wire.advance(now);
        Ok(wire.nodes.get_mut(self.index).and_then(|node| node.heard.pop_front()))
    }
}

/// What a thread that panicked left behind is whole: every change is one push or pop.
fn lock(wire: &Mutex<Wire>) -> MutexGuard<'_, Wire> {
    wire.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Debug, Clone)]
struct Wire {
    rate: BitRate,
    /// End of the latest frame and of the space behind it.
    free_at: Time,
    nodes: Vec<Node>,
    load: BusLoad,
}

#[derive(Debug, Clone, Default)]
struct Node {
    sending: VecDeque<Stamped<Frame>>,
    heard: VecDeque<Stamped<Frame>>,
    overruns: u64,
}

impl Wire {
    /// Carries every frame that is through by `now`.
    fn advance(&mut self, now: Time) {
        while let Some((sender, start)) = self.next_sender() {
            let Some(frame) = self.nodes.get(sender).and_then(|n| n.sending.front()) else {
                return;
            };
            let frame = frame.value;
            let end = start.plus_nanos(i64::from(frame_bits(&frame)) * self.rate.bit_nanos());
            if end > now {
                return;
            }
            self.free_at = end;
            self.load.add(end, &frame);
            for (index, node) in self.nodes.iter_mut().enumerate() {
                if index == sender {
                    node.sending.pop_front();
                } else if node.heard.len() < RECEIVE_QUEUE {
                    node.heard.push_back(Stamped { time: end, value: frame });
                } else {
                    node.overruns += 1;
                }
            }
        }
    }

    /// Who sends next and when: of those that wait when the wire becomes free, the lowest
    /// identifier wins (of equal ones, which no correct bus has, the first node's).
    fn next_sender(&self) -> Option<(usize, Time)> {
        let waiting =
            || self.nodes.iter().enumerate().filter_map(|(i, n)| Some((i, n.sending.front()?)));
        let start = waiting().map(|(_, head)| head.time).min()?.max(self.free_at);
        let eligible = waiting().filter(|(_, head)| head.time <= start);
        eligible.min_by_key(|(_, head)| head.value.id().raw()).map(|(index, _)| (index, start))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Id;

    const MS: i64 = 1_000_000;

    fn frame(raw: u32) -> Frame {
        Frame::of(Id::from_raw(raw), [0x55; 8])
    }

    fn all(node: &mut LoopbackNode, now: Time) -> Vec<(Time, u32)> {
        let next = || node.receive(now).unwrap();
        std::iter::from_fn(next).map(|heard| (heard.time, heard.value.id().raw())).collect()
    }

    #[test]
    fn a_frame_takes_its_bits_and_reaches_everybody_else() {
        for (rate, bit_nanos) in [(BitRate::Kbit250, 4_000), (BitRate::Kbit500, 2_000)] {
            let bus = Loopback::new(rate, 3);
            let [mut a, mut b, mut c] = [0, 1, 2].map(|i| bus.node(i));
            let sent = frame(0x0CF0_0400);
            a.send(Time(MS), &sent).unwrap();
            let end = Time(MS + i64::from(frame_bits(&sent)) * bit_nanos);
            assert_eq!(all(&mut b, end.plus_nanos(-1)), []);
            assert_eq!(all(&mut b, end), [(end, 0x0CF0_0400)]);
            assert_eq!(all(&mut c, end).len(), 1);
            assert_eq!(all(&mut a, end), [], "own frames are not heard");
        }
    }

    #[test]
    fn the_lowest_identifier_goes_first_whoever_sent_first_in_the_tick() {
        let orders = [[0, 1, 2], [2, 1, 0], [1, 2, 0]];
        let heard = orders.map(|order| {
            let bus = Loopback::new(BitRate::Kbit250, 4);
            for node in order {
                let raw = 0x0CF0_0400 - node as u32;
                bus.node(node).send(Time(MS), &frame(raw)).unwrap();
            }
            all(&mut bus.node(3), Time(10 * MS))
        });
        let ids: Vec<_> = heard[0].iter().map(|(_, raw)| *raw).collect();
        assert_eq!(ids, [0x0CF0_03FE, 0x0CF0_03FF, 0x0CF0_0400]);
        assert!(heard.iter().all(|h| *h == heard[0]));
    }

    #[test]
    fn a_frame_that_is_under_way_is_not_interrupted() {
        let bus = Loopback::new(BitRate::Kbit250, 3);
        bus.node(0).send(Time(0), &frame(0x18FF_0000)).unwrap();
        bus.node(1).send(Time(100_000), &frame(0x0000_0001)).unwrap();
        let ids: Vec<_> = all(&mut bus.node(2), Time(10 * MS)).iter().map(|h| h.1).collect();
        assert_eq!(ids, [0x18FF_0000, 1]);
    }

    #[test]
    fn a_babbling_node_starves_the_others_and_queues_stay_bounded() {
        let bus = Loopback::new(BitRate::Kbit250, 3);
        let [mut babbler, mut node, mut listener] = [0, 1, 2].map(|i| bus.node(i));
        node.send(Time(10 * MS), &frame(0x0CF0_0400)).unwrap();
        for tick in 0..200 {
            let now = Time(tick * 10 * MS);
            let sent = super::super::faults::babble(&mut babbler, now, &frame(0)).unwrap();
            assert!(sent <= SEND_QUEUE);
        }
        let now = Time(2_000 * MS);
        assert!(bus.load(now) > 0.99, "{}", bus.load(now));
        let heard = all(&mut listener, now);
        assert!(heard.len() > 3_000 && heard.iter().all(|(_, raw)| *raw == 0));
        assert_eq!(node.overruns(), 0);
    }

    #[test]
    fn a_node_that_does_not_listen_loses_the_newest_and_knows_it() {
        let bus = Loopback::new(BitRate::Kbit500, 2);
        let (mut a, mut b) = (bus.node(0), bus.node(1));
        for i in 0..RECEIVE_QUEUE as i64 + 10 {
            a.send(Time(i * MS), &frame(0)).unwrap();
        }
        let end = Time(1_000_000 * MS);
        assert_eq!(all(&mut b, end).len(), RECEIVE_QUEUE);
        assert_eq!(b.overruns(), 10);
    }

    #[test]
    fn a_fork_goes_its_own_way() {
        let bus = Loopback::new(BitRate::Kbit250, 2);
        bus.node(0).send(Time(0), &frame(1)).unwrap();
        let fork = bus.fork();
        assert_eq!(all(&mut bus.node(1), Time(MS)).len(), 1);
        bus.node(0).send(Time(MS), &frame(2)).unwrap();
        assert_eq!(all(&mut fork.node(1), Time(9 * MS)).len(), 1);
        assert!(matches!(bus.node(2).send(Time(0), &frame(1)), Err(BusError::Full(_))));
    }
}
