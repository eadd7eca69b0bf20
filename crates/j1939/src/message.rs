//! Messages with a fixed layout: one struct each, made by `build.rs` from `table/messages.csv` and
//! `table/signals.csv`.
//!
//! Fields are in SI with the unit in their name; codes and counts have no unit. Signs and axes are
//! those of the standard: a steering wheel angle and a yaw rate are positive to the left, an
//! acceleration is positive forward, a bearing is clockwise from north. A default message says "not
//! available" everywhere; where a code has no such state (the override mode of TSC1, the counter of
//! XBR) it cannot be encoded before the code is set. Bits that no signal uses are sent as ones.

use crate::{Frame, Id, J1939Error, Signal, Slot};

/// What the standard fixes of a message.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct MessageTable {
    /// Parameter group number.
    pub pgn: u32,
    /// The standard's acronym.
    pub name: &'static str,
    /// What the message is for.
    pub title: &'static str,
    /// How many bytes a sender of the newest edition sends.
    pub length_bytes: usize,
    /// How many bytes the shortest edition has; signals beyond its end are not available.
    pub min_length_bytes: usize,
    /// Default priority, 0 (first) to 7.
    pub priority: u8,
    /// Shortest usual period, ms; `None` where the message is sent on request.
    pub period_ms: Option<u32>,
    /// Its signals, in the order of their bits.
    pub signals: &'static [Signal],
}

impl MessageTable {
    /// The table of a parameter group, if it is one of [`MESSAGES`].
    #[must_use]
    pub fn of(pgn: u32) -> Option<&'static Self> {
        let at = MESSAGES.binary_search_by_key(&pgn, |message| message.pgn).ok()?;
        MESSAGES.get(at)
    }

    /// Checks that a received message is not shorter than the shortest edition.
    ///
    /// # Errors
    /// [`J1939Error::Short`] with PGN, source and length.
    #[inline]
    pub fn check_length(&self, id: Id, bytes: &[u8]) -> Result<(), J1939Error> {
        if bytes.len() < self.min_length_bytes {
            let need = self.min_length_bytes;
            return Err(J1939Error::Short { pgn: id.pgn(), sa: id.sa(), len: bytes.len(), need });
        }
        Ok(())
    }
}

/// A message with a fixed layout.
pub trait Message: Sized {
    /// What the standard fixes of it.
    const TABLE: &'static MessageTable;
    /// The bytes of the newest edition.
    type Bytes: AsRef<[u8]>;

    /// Decodes the bytes of a frame or of a transported message; `id` tells the error where they
    /// came from. Bytes beyond the newest edition are ignored.
    ///
    /// # Errors
    /// [`J1939Error::Short`] with PGN, source and length.
    fn decode(id: Id, bytes: &[u8]) -> Result<Self, J1939Error>;

    /// The bytes of the message.
    ///
    /// # Errors
    /// [`J1939Error::NotEncodable`] names the first field that has no raw value.
    fn encode(&self) -> Result<Self::Bytes, J1939Error>;

    /// The message as a frame of its default priority, from `sa` to `da`
    /// ([`GLOBAL_ADDRESS`](crate::GLOBAL_ADDRESS) where it goes to everybody).
    ///
    /// # Errors
    /// As [`Message::encode`] and [`Id::new`], and for more than eight bytes.
    fn frame(&self, da: u8, sa: u8) -> Result<Frame, J1939Error> {
        let id = Id::new(Self::TABLE.priority, Self::TABLE.pgn, da, sa)?;
        Frame::new(id, self.encode()?.as_ref())
    }
}

/// Proprietary A: to one address, the layout is the maker's (SAE J1939-21).
pub const PROPRIETARY_A: u32 = 0xEF00;

include!(concat!(env!("OUT_DIR"), "/messages.rs"));
