//! A bus in wall time: frames are read against the clock of the moment, not against that of the
//! tick's beginning.
//!
//! A kernel tells how old a frame is when it is read. Where the program was held up in the middle of
//! a tick, that age taken from the tick's time would put frames into the past, as if they had come
//! all at once, and supervision would take them for two senders'.

use j1939::Frame;
use j1939::bus::{Bus, BusError};
use tractrix_core::{Stamped, Time};

use crate::clock::Clock;

/// The bus.
pub(crate) struct Live<B> {
    bus: B,
    clock: Clock,
    /// A frame that came in after the tick's time: it is the next tick's.
    next: Option<Stamped<Frame>>,
}

impl<B> Live<B> {
    pub(crate) const fn new(bus: B, clock: Clock) -> Self {
        Self { bus, clock, next: None }
    }
}

impl<B: Bus> Bus for Live<B> {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        self.bus.send(now, frame)
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        if self.next.is_none() {
            let read = self.clock.now();
            let unstamped = |frame: &Stamped<Frame>| frame.time == read;
            self.next = self.bus.receive(read)?.map(|frame| match unstamped(&frame) {
                // A bus that does not say when: it is there, and that is all that is known
                true => Stamped { time: now, ..frame },
                false => frame,
            });
        }
        Ok(self.next.take_if(|frame| frame.time <= now))
    }

    fn error_frames(&self) -> u64 {
        self.bus.error_frames()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use j1939::Id;

    use super::*;

    /// Frames with their ages, ns; none: the time at which they are read.
    struct Queue(VecDeque<Option<i64>>);

    impl Bus for Queue {
        fn send(&mut self, _: Time, _: &Frame) -> Result<(), BusError> {
            Ok(())
        }

        fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
            let value = Frame::of(Id::from_raw(0x0CF0_0400), [0; 8]);
            let age = self.0.pop_front();
            Ok(age.map(|age| Stamped { time: now.plus_nanos(-age.unwrap_or(0)), value }))
        }
    }

    #[test]
    fn what_came_after_the_tick_began_is_the_next_ones_and_all_else_is_there_at_once() {
        let clock = Clock::start();
        let hour = 3_600_000_000_000;
        let ages = [None, Some(hour), None, Some(1), None];
        let mut bus = Live::new(Queue(ages.into_iter().collect()), clock);
        let began = clock.now();
        let times: Vec<_> =
            std::iter::from_fn(|| bus.receive(began).unwrap()).map(|heard| heard.time).collect();
        let [first, old, third] = times[..] else { panic!("{times:?}") };
        assert!(first == began && third == began && old < began.plus_nanos(-hour / 2));
        let next = clock.now();
        let times: Vec<_> =
            std::iter::from_fn(|| bus.receive(next).unwrap()).map(|heard| heard.time).collect();
        assert!(times.len() == 2 && times[0] > began && times[1] == next, "{times:?}");
    }
}
