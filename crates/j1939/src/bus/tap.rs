//! Shows every frame, and every refusal, to a recorder, both ways.

use tractrix_core::{BusRecorder, BusTrouble, RawFrame, Stamped, Time};

use super::{Bus, BusError};
use crate::Frame;

/// A bus whose calls are also told to a recorder, each with the time at which it was made.
#[derive(Debug, Clone)]
pub struct Tap<B, R> {
    bus: B,
    recorder: R,
}

impl<B: Bus, R: BusRecorder> Tap<B, R> {
    /// A tap on `bus`.
    pub const fn new(bus: B, recorder: R) -> Self {
        Self { bus, recorder }
    }
}

impl<B: Bus, R: BusRecorder> Bus for Tap<B, R> {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        let sent = self.bus.send(now, frame);
        let trouble = sent.as_ref().err().map(BusTrouble::from);
        self.recorder.sent(now, RawFrame::from(frame), trouble);
        sent
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let heard = self.bus.receive(now);
        let raw = |Stamped { time, value }: &Stamped<Frame>| Stamped {
            time: *time,
            value: RawFrame::from(value),
        };
        let what = heard.as_ref().map(|frame| frame.as_ref().map(raw)).map_err(BusTrouble::from);
        self.recorder.received(now, what);
        heard
    }

    fn error_frames(&self) -> u64 {
        self.bus.error_frames()
    }
}

#[cfg(all(test, feature = "std"))]
#[expect(clippy::unwrap_used, reason = "what is counted is never trouble")]
mod tests {
    use super::*;
    use crate::bus::loopback::Loopback;
    use crate::{BitRate, Id};

    const NOW: Time = Time(1_000_000);

    /// Counts what went, what was refused, what came, and when nothing did.
    #[derive(Default)]
    struct Counts([usize; 4]);

    impl BusRecorder for &mut Counts {
        fn received(&mut self, now: Time, what: Result<Option<Stamped<RawFrame>>, BusTrouble>) {
            let heard = what.unwrap();
            assert_eq!(now, NOW);
            self.0[2 + usize::from(heard.is_none())] += 1;
            if let Some(heard) = heard {
                assert!(heard.time > Time::ZERO && heard.time < now, "the frame's own end");
                assert_eq!(heard.value, RawFrame { id: 0x0CF0_0400, len: 8, data: [1; 8] });
            }
        }

        fn sent(&mut self, now: Time, frame: RawFrame, trouble: Option<BusTrouble>) {
            assert_eq!((now, frame.id), (NOW, 0x0CF0_0400));
            assert!(matches!(trouble, None | Some(BusTrouble::Full)));
            self.0[usize::from(trouble.is_some())] += 1;
        }
    }

    #[test]
    fn both_directions_are_recorded_and_what_is_refused_as_refused() {
        let wire = Loopback::new(BitRate::Kbit250, 2);
        let mut counts = Counts::default();
        let mut tap = Tap::new(wire.node(0), &mut counts);
        let mut peer = wire.node(1);
        let frame = Frame::of(Id::from_raw(0x0CF0_0400), [1; 8]);
        peer.send(Time::ZERO, &frame).unwrap();
        assert!(tap.receive(NOW).unwrap().is_some());
        assert!(tap.receive(NOW).unwrap().is_none());
        let refused = (0..).find_map(|_| tap.send(NOW, &frame).err()).unwrap();
        let BusError::Full(room) = refused else { panic!("{refused}") };
        assert_eq!(counts.0, [room, 1, 1, 1]);
    }

    #[test]
    fn a_frame_comes_back_from_what_is_recorded_of_it() {
        for bytes in [&[][..], &[1, 2, 3], &[9; 8]] {
            let frame = Frame::new(Id::from_raw(0x18FE_F100), bytes).unwrap();
            assert_eq!(Frame::from(RawFrame::from(&frame)), frame);
        }
        let long = RawFrame { id: 1, len: 200, data: [7; 8] };
        assert_eq!(Frame::from(long), Frame::of(Id::from_raw(1), [7; 8]));
    }
}
