//! Shows every frame to a recorder, both ways.

use tractrix_core::{Stamped, Time};

use super::{Bus, BusError};
use crate::Frame;

/// Which way a frame went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From this node to the bus.
    Sent,
    /// From the bus to this node.
    Received,
}

/// A bus whose frames are also given to `record`. Recording changes nothing.
#[derive(Debug, Clone)]
pub struct Tap<B, F> {
    bus: B,
    record: F,
}

impl<B: Bus, F: FnMut(Direction, &Stamped<Frame>)> Tap<B, F> {
    /// A tap on `bus`.
    pub const fn new(bus: B, record: F) -> Self {
        Self { bus, record }
    }
}

impl<B: Bus, F: FnMut(Direction, &Stamped<Frame>)> Bus for Tap<B, F> {
    /// A frame that the bus refuses is not recorded.
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        self.bus.send(now, frame)?;
        (self.record)(Direction::Sent, &Stamped { time: now, value: *frame });
        Ok(())
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let heard = self.bus.receive(now)?;
        if let Some(heard) = &heard {
            (self.record)(Direction::Received, heard);
        }
        Ok(heard)
    }

    fn error_frames(&self) -> u64 {
        self.bus.error_frames()
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use crate::bus::loopback::Loopback;
    use crate::{BitRate, Id};

    #[test]
    fn both_directions_are_recorded_and_refused_frames_are_not() {
        let wire = Loopback::new(BitRate::Kbit250, 2);
        let mut seen = Vec::new();
        let mut tap =
            Tap::new(wire.node(0), |way, heard: &Stamped<Frame>| seen.push((way, *heard)));
        let mut peer = wire.node(1);
        let frame = Frame::of(Id::from_raw(0x0CF0_0400), [1; 8]);
        peer.send(Time::ZERO, &frame).unwrap();
        assert!(tap.receive(Time(1_000_000)).unwrap().is_some());
        let refused = (0..).find_map(|_| tap.send(Time(1_000_000), &frame).err()).unwrap();
        let BusError::Full(room) = refused else { panic!("{refused}") };
        assert_eq!(seen.len(), 1 + room);
        assert_eq!((seen[0].0, seen[1].0), (Direction::Received, Direction::Sent));
    }
}
