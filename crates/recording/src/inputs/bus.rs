//! What the truck's driver read from its bus and sent to it, reading by reading.
//!
//! A reading begins when the bus is asked for frames and ends before it is asked again after it had
//! none left. What failed is an error frame whose identifier is the class of the error
//! (`linux/can/error.h`).

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tractrix_core::{BusRecorder, BusTrouble, RawFrame, Stamped, Time};

use crate::error::RecordingError;
use crate::ros::input::{BusTick, CanFrame, FrameHeader};
use crate::ros::standard::Stamp;
use crate::topic::{CAN_FRAMES, CAN_TICKS, TopicMessage};

/// Readings that are kept until they are taken; older ones are lost.
const MOST_CALLS: usize = 4096;
/// `CAN_ERR_CRTL`, `CAN_ERR_BUSOFF`, `CAN_ERR_BUSERROR`.
const TROUBLES: [(BusTrouble, u32); 3] =
    [(BusTrouble::Full, 0x04), (BusTrouble::Off, 0x40), (BusTrouble::Other, 0x80)];
/// `frame_id` of what came and of what went.
pub(super) const RECEIVED: &str = "received";
pub(super) const SENT: &str = "sent";

/// What was wished of the driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DriverWish {
    /// Nothing.
    #[default]
    None,
    /// To drive.
    Engage,
    /// To let go.
    Disengage,
    /// The minimal-risk manoeuvre.
    Stop,
}

/// A frame that was to be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SentFrame {
    /// The frame.
    pub frame: RawFrame,
    /// Why it was not sent, if so.
    pub trouble: Option<BusTrouble>,
}

/// One reading of the bus and what was sent after it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BusCall {
    /// Time at which the bus was asked.
    pub now: Time,
    /// Number of the reading, from 0.
    pub number: u32,
    /// What was wished of the driver before it.
    pub wish: DriverWish,
    /// Frames that came, each with its own time, and failures, in order.
    pub received: Vec<Result<Stamped<RawFrame>, BusTrouble>>,
    /// Frames that went, in order.
    pub sent: Vec<SentFrame>,
}

/// A shared list of readings: who taps a bus writes it, who records the bus takes them.
#[derive(Debug, Clone, Default)]
pub struct BusTrace(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    done: Vec<BusCall>,
    current: Option<BusCall>,
    drained: bool,
    number: u32,
    wish: DriverWish,
}

impl State {
    fn close(&mut self) {
        if let Some(call) = self.current.take()
            && self.done.len() < MOST_CALLS
        {
            self.done.push(call);
        }
    }

    fn reading(&mut self, now: Time) -> &mut BusCall {
        if std::mem::take(&mut self.drained) || self.current.as_ref().is_some_and(|c| c.now != now)
        {
            self.close();
        }
        if self.current.is_none() {
            let (number, wish) = (self.number, std::mem::take(&mut self.wish));
            self.number = number.wrapping_add(1);
            self.current = Some(BusCall { now, number, wish, ..BusCall::default() });
        }
        self.current.get_or_insert_default()
    }
}

impl BusTrace {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Something is wished of the driver before the next reading.
    pub fn wished(&self, wish: DriverWish) {
        self.state().wish = wish;
    }

    /// The readings that are over.
    #[must_use]
    pub fn take(&self) -> Vec<BusCall> {
        std::mem::take(&mut self.state().done)
    }

    /// The readings that are over and the one under way, which was the last.
    #[must_use]
    pub fn take_all(&self) -> Vec<BusCall> {
        let mut state = self.state();
        state.close();
        std::mem::take(&mut state.done)
    }
}

impl BusRecorder for BusTrace {
    fn received(&mut self, now: Time, what: Result<Option<Stamped<RawFrame>>, BusTrouble>) {
        let mut state = self.state();
        let reading = state.reading(now);
        match what {
            Ok(Some(frame)) => reading.received.push(Ok(frame)),
            Ok(None) => {}
            Err(trouble) => reading.received.push(Err(trouble)),
        }
        state.drained = !matches!(what, Ok(Some(_)));
    }

    fn sent(&mut self, _now: Time, frame: RawFrame, trouble: Option<BusTrouble>) {
        if let Some(call) = &mut self.state().current {
            call.sent.push(SentFrame { frame, trouble });
        }
    }
}

/// The messages of a reading: its frames, then what it was.
pub(crate) fn call_messages(call: &BusCall) -> Result<Vec<TopicMessage>, RecordingError> {
    let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let received = call.received.iter().map(|heard| match heard {
        Ok(heard) => message(RECEIVED, heard.time, heard.value, None),
        Err(trouble) => message(RECEIVED, call.now, RawFrame::default(), Some(*trouble)),
    });
    let sent = call.sent.iter().map(|said| message(SENT, call.now, said.frame, said.trouble));
    let mut messages = received
        .chain(sent)
        .map(|frame| CAN_FRAMES.encode(&frame))
        .collect::<Result<Vec<_>, _>>()?;
    messages.push(CAN_TICKS.encode(&BusTick {
        now_ns: call.now.0,
        number: call.number,
        received: count(call.received.len()),
        sent: count(call.sent.len()),
        wish: match call.wish {
            DriverWish::None => 0,
            DriverWish::Engage => 1,
            DriverWish::Disengage => 2,
            DriverWish::Stop => 3,
        },
    })?);
    Ok(messages)
}

fn message(way: &str, time: Time, frame: RawFrame, trouble: Option<BusTrouble>) -> CanFrame {
    let class = trouble.and_then(|t| TROUBLES.iter().find(|(of, _)| *of == t));
    CanFrame {
        header: FrameHeader { stamp: Stamp::of(time), frame_id: way.to_owned() },
        id: class.map_or(frame.id, |(_, class)| *class),
        is_rtr: false,
        is_extended: trouble.is_none(),
        is_error: trouble.is_some(),
        dlc: frame.len,
        data: frame.data,
    }
}

/// What a message says; `None` if it is no frame of ours.
pub(super) fn frame_of(message: &CanFrame) -> Option<(RawFrame, Option<BusTrouble>)> {
    let trouble = match message.is_error {
        true => Some(TROUBLES.iter().find(|(_, class)| *class == message.id)?.0),
        false => None,
    };
    let frame = RawFrame { id: message.id, len: message.dlc, data: message.data };
    (message.dlc <= 8).then_some((frame, trouble))
}

/// The wish of a code.
pub(super) const fn wish_of(code: u8) -> Option<DriverWish> {
    Some(match code {
        0 => DriverWish::None,
        1 => DriverWish::Engage,
        2 => DriverWish::Disengage,
        3 => DriverWish::Stop,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(ns: i64, id: u32) -> Stamped<RawFrame> {
        Stamped { time: Time(ns), value: RawFrame { id, len: 3, data: [1, 2, 3, 0, 0, 0, 0, 0] } }
    }

    #[test]
    fn a_reading_ends_before_the_next_one_begins_even_at_the_same_time() {
        let mut trace = BusTrace::default();
        let said = SentFrame { frame: heard(0, 9).value, trouble: Some(BusTrouble::Full) };
        trace.sent(Time(-10), said.frame, said.trouble); // before any reading: nobody's
        trace.received(Time(-10), Ok(Some(heard(-12, 1))));
        trace.received(Time(-10), Ok(Some(heard(-11, 2))));
        trace.received(Time(-10), Ok(None));
        trace.sent(Time(-10), said.frame, said.trouble);
        trace.wished(DriverWish::Engage);
        assert_eq!(trace.take(), []);
        trace.received(Time(-10), Err(BusTrouble::Off));
        trace.received(Time(0), Ok(None));
        let calls = trace.take();
        assert_eq!(calls.len(), 2);
        assert_eq!(calls[0].received, [Ok(heard(-12, 1)), Ok(heard(-11, 2))]);
        assert_eq!(
            (calls[0].number, calls[0].wish, &calls[0].sent[..]),
            (0, DriverWish::None, &[said][..])
        );
        assert_eq!((calls[1].number, calls[1].wish), (1, DriverWish::Engage));
        assert_eq!(calls[1].received, [Err(BusTrouble::Off)]);
        assert_eq!(trace.take_all().len(), 1);
        let messages = call_messages(&calls[0]).unwrap();
        assert_eq!(messages.len(), 4);
        let frame = |i: usize| CAN_FRAMES.decode(&messages[i].cdr).unwrap();
        assert_eq!(
            (frame(0).header.stamp.time(), frame_of(&frame(0))),
            (Time(-12), Some((heard(0, 1).value, None)))
        );
        assert_eq!(frame_of(&frame(2)).unwrap().1, Some(BusTrouble::Full));
        assert_eq!(frame(2).header.frame_id, SENT);
    }
}
