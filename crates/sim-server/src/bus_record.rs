//! Between a bus and what a recording holds of it.

use j1939::bus::tap::{Tap, Tapped};
use j1939::bus::{Bus, BusError};
use j1939::{BitRate, Frame, Id};
use recording::{BusTrace, BusTrouble, RawFrame, SentFrame};
use tractrix_core::{Stamped, Time};

/// Keys of the recording's record `bus`.
pub(crate) const RATE_KEY: &str = "rate_kbit_s";
pub(crate) const SETUP_KEY: &str = "driver";

/// A bus whose frames both ways are written into a trace.
pub(crate) fn tapped<B>(bus: B, trace: &BusTrace) -> Box<dyn Bus + Send + Sync>
where
    B: Bus + Send + Sync + 'static,
{
    let trace = trace.clone();
    Box::new(Tap::new(bus, move |now: Time, what: Tapped<'_>| match what {
        Tapped::Sent(frame) => trace.sent(SentFrame { frame: raw(frame), trouble: None }),
        Tapped::NotSent(frame, why) => {
            trace.sent(SentFrame { frame: raw(frame), trouble: Some(trouble(why)) });
        }
        Tapped::Received(heard) => {
            let frame = Stamped { time: heard.time, value: raw(&heard.value) };
            trace.received(now, Ok(Some(frame)));
        }
        Tapped::Empty => trace.received(now, Ok(None)),
        Tapped::NotReceived(why) => trace.received(now, Err(trouble(why))),
    }))
}

/// A frame as a recording has it.
pub(crate) fn raw(frame: &Frame) -> RawFrame {
    let mut data = [0; 8];
    data.iter_mut().zip(frame.bytes()).for_each(|(to, from)| *to = *from);
    RawFrame { id: frame.id().raw(), len: frame.bytes().len() as u8, data }
}

/// The frame again.
pub(crate) fn frame(raw: &RawFrame) -> Frame {
    let bytes = raw.data.get(..usize::from(raw.len)).unwrap_or(&raw.data);
    // At most eight bytes are always a frame
    Frame::new(Id::from_raw(raw.id), bytes).unwrap_or(Frame::of(Id::from_raw(raw.id), raw.data))
}

const fn trouble(error: &BusError) -> BusTrouble {
    match error {
        BusError::Full(_) => BusTrouble::Full,
        BusError::Off => BusTrouble::Off,
        _ => BusTrouble::Other,
    }
}

/// The failure again.
pub(crate) fn failure(trouble: BusTrouble) -> BusError {
    match trouble {
        BusTrouble::Full => BusError::Full(0),
        BusTrouble::Off => BusError::Off,
        BusTrouble::Other => BusError::Io { what: "bus".to_owned(), why: "as recorded".to_owned() },
    }
}

/// A bit rate in kbit/s.
pub(crate) const fn rate_kbit_s(rate: BitRate) -> i64 {
    1_000_000 / rate.bit_nanos()
}

/// The bit rate of so many kbit/s.
pub(crate) fn bit_rate(kbit_s: &str) -> Option<BitRate> {
    [BitRate::Kbit250, BitRate::Kbit500]
        .into_iter()
        .find(|rate| rate_kbit_s(*rate).to_string() == kbit_s)
}
