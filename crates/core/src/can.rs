//! What happens on a bus, for who records it.

use crate::{Stamped, Time};

/// A frame of a classic CAN bus with a 29-bit identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RawFrame {
    /// Identifier.
    pub id: u32,
    /// Number of bytes.
    pub len: u8,
    /// Bytes; zero beyond `len`.
    pub data: [u8; 8],
}

/// Why a bus could not be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BusTrouble {
    /// The send queue had no room.
    Full,
    /// The controller was off the bus.
    Off,
    /// Anything else.
    Other,
}

/// Takes every call of a bus. Recording changes nothing.
pub trait BusRecorder {
    /// The bus was asked for a frame at `now`: it gave one, had none (`None`), or failed.
    fn received(&mut self, now: Time, what: Result<Option<Stamped<RawFrame>>, BusTrouble>);
    /// The bus was given a frame at `now`, and why it did not take it, if so.
    fn sent(&mut self, now: Time, frame: RawFrame, trouble: Option<BusTrouble>);
}

impl<A: BusRecorder, B: BusRecorder> BusRecorder for (A, B) {
    fn received(&mut self, now: Time, what: Result<Option<Stamped<RawFrame>>, BusTrouble>) {
        self.0.received(now, what);
        self.1.received(now, what);
    }

    fn sent(&mut self, now: Time, frame: RawFrame, trouble: Option<BusTrouble>) {
        self.0.sent(now, frame, trouble);
        self.1.sent(now, frame, trouble);
    }
}
