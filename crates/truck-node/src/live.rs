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
            self.next = self.bus.receive(self.clock.now())?;
        }
        Ok(self.next.take_if(|frame| frame.time <= now))
    }

    fn error_frames(&self) -> u64 {
        self.bus.error_frames()
    }
}
