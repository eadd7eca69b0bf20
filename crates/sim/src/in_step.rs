//! Two ends of a bus outside of this process whose time is that of the ticks.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use j1939::Frame;
use j1939::bus::{Bus, BusError};
use tractrix_core::{Stamped, Time};

/// How often an end looks for a frame that the other one has sent before it counts as lost: some
/// tenths of a second.
const LOOKS: u32 = 200_000;

/// Makes two connections to one bus carry every frame within the tick in which it is sent, at any
/// pace: an end that asks for frames waits until it has as many as the other one has sent. What
/// does not come is given up after a bounded wait; frames of others on that bus shorten it.
#[must_use]
pub fn in_step<B: Bus + Send + Sync + 'static>(a: B, b: B) -> [Box<dyn Bus + Send + Sync>; 2] {
    let sent = [Arc::new(AtomicU64::new(0)), Arc::new(AtomicU64::new(0))];
    let [from_a, from_b] = &sent;
    let end =
        |bus: B, sent: &Arc<AtomicU64>, to_come: &Arc<AtomicU64>| -> Box<dyn Bus + Send + Sync> {
            let (sent, to_come) = (Arc::clone(sent), Arc::clone(to_come));
            Box::new(InStep { bus, sent, to_come, came: 0 })
        };
    [end(a, from_a, from_b), end(b, from_b, from_a)]
}

struct InStep<B> {
    bus: B,
    /// Frames that this end has sent.
    sent: Arc<AtomicU64>,
    /// Frames that the other end has sent.
    to_come: Arc<AtomicU64>,
    /// Frames that came here.
    came: u64,
}

impl<B: Bus> Bus for InStep<B> {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        self.bus.send(now, frame)?;
        self.sent.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        for _ in 0..LOOKS {
            if let Some(frame) = self.bus.receive(now)? {
                self.came += 1;
                return Ok(Some(frame));
            }
            if self.came >= self.to_come.load(Ordering::Relaxed) {
                return Ok(None);
            }
            std::thread::yield_now();
        }
        self.came = self.to_come.load(Ordering::Relaxed);
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::sync::Mutex;

    use j1939::Id;

    use super::*;

    /// A wire on which a frame is there after the reader has looked a number of times.
    struct Slow {
        out: Arc<Mutex<VecDeque<Frame>>>,
        within: Arc<Mutex<VecDeque<Frame>>>,
        looks: u32,
    }

    impl Bus for Slow {
        fn send(&mut self, _: Time, frame: &Frame) -> Result<(), BusError> {
            self.out.lock().unwrap().push_back(*frame);
            Ok(())
        }

        fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
            self.looks += 1;
            if !self.looks.is_multiple_of(7) {
                return Ok(None);
            }
            let value = self.within.lock().unwrap().pop_front();
            Ok(value.map(|value| Stamped { time: now, value }))
        }
    }

    #[test]
    fn every_frame_comes_in_the_tick_in_which_it_was_sent_and_lost_ones_end_the_wait() {
        let wires = [(); 2].map(|()| Arc::new(Mutex::new(VecDeque::new())));
        let slow = |out: usize, within: usize| Slow {
            out: Arc::clone(&wires[out]),
            within: Arc::clone(&wires[within]),
            looks: 0,
        };
        let [mut a, mut b] = in_step(slow(0, 1), slow(1, 0));
        let frame = Frame::of(Id::from_raw(0x0CF0_0400), [0; 8]);
        for _ in 0..5 {
            a.send(Time(0), &frame).unwrap();
        }
        let heard = std::iter::from_fn(|| b.receive(Time(0)).unwrap()).count();
        assert_eq!(heard, 5);
        a.send(Time(1), &frame).unwrap();
        wires[0].lock().unwrap().clear();
        assert_eq!(b.receive(Time(1)).unwrap(), None);
        b.send(Time(2), &frame).unwrap();
        assert!(a.receive(Time(2)).unwrap().is_some());
    }
}
