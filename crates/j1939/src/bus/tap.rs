//! Shows every frame, and every refusal, to a recorder, both ways.

use tractrix_core::{Stamped, Time};

use super::{Bus, BusError};
use crate::Frame;

/// What happened at a call of a bus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tapped<'a> {
    /// A frame of this node went to the bus.
    Sent(&'a Frame),
    /// The bus refused a frame of this node.
    NotSent(&'a Frame, &'a BusError),
    /// A frame came from the bus.
    Received(&'a Stamped<Frame>),
    /// There was no further frame.
    Empty,
    /// Nothing could be received.
    NotReceived(&'a BusError),
}

/// A bus whose calls are also given to `record`, each with the time at which it was made. Recording
/// changes nothing.
#[derive(Debug, Clone)]
pub struct Tap<B, F> {
    bus: B,
    record: F,
}

impl<B: Bus, F: FnMut(Time, Tapped<'_>)> Tap<B, F> {
    /// A tap on `bus`.
    pub const fn new(bus: B, record: F) -> Self {
        Self { bus, record }
    }
}

impl<B: Bus, F: FnMut(Time, Tapped<'_>)> Bus for Tap<B, F> {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        let sent = self.bus.send(now, frame);
        let what = match &sent {
            Ok(()) => Tapped::Sent(frame),
            Err(error) => Tapped::NotSent(frame, error),
        };
        (self.record)(now, what);
        sent
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let heard = self.bus.receive(now);
        let what = match &heard {
            Ok(Some(frame)) => Tapped::Received(frame),
            Ok(None) => Tapped::Empty,
            Err(error) => Tapped::NotReceived(error),
        };
        (self.record)(now, what);
        heard
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
    fn both_directions_are_recorded_and_what_is_refused_as_refused() {
        let wire = Loopback::new(BitRate::Kbit250, 2);
        let (mut calls, mut kinds) = (0, [0; 5]);
        let mut tap = Tap::new(wire.node(0), |now: Time, what: Tapped<'_>| {
            assert_eq!(now, Time(1_000_000));
            calls += 1;
            kinds[match what {
                Tapped::Sent(_) => 0,
                Tapped::NotSent(_, BusError::Full(_)) => 1,
                Tapped::Received(heard) => {
                    assert!(heard.time > Time::ZERO && heard.time < now, "the frame's own end");
                    2
                }
                Tapped::Empty => 3,
                Tapped::NotSent(..) | Tapped::NotReceived(_) => 4,
            }] += 1;
        });
        let mut peer = wire.node(1);
        let frame = Frame::of(Id::from_raw(0x0CF0_0400), [1; 8]);
        peer.send(Time::ZERO, &frame).unwrap();
        let now = Time(1_000_000);
        assert!(tap.receive(now).unwrap().is_some());
        assert!(tap.receive(now).unwrap().is_none());
        let refused = (0..).find_map(|_| tap.send(now, &frame).err()).unwrap();
        let BusError::Full(room) = refused else { panic!("{refused}") };
        assert_eq!((calls, kinds), (room + 3, [room, 1, 1, 1, 0]));
    }
}
