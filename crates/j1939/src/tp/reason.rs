//! Why a transfer was given up.

use core::fmt;

/// Reason of an abort as on the wire (SAE J1939-21, table of abort reasons; the numbers above 8
/// differ between editions and stay numbers).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct AbortReason(pub u8);

impl AbortReason {
    /// The receiver has a session with this sender already.
    pub const BUSY: Self = Self(1);
    /// No memory, or needed for another session.
    pub const RESOURCES: Self = Self(2);
    /// Nothing came in time.
    pub const TIMEOUT: Self = Self(3);
    /// Clear to send while packets were being sent.
    pub const CTS_WHILE_SENDING: Self = Self(4);
    /// Packets were asked for again too often.
    pub const RETRANSMIT_LIMIT: Self = Self(5);
    /// Data without a session.
    pub const UNEXPECTED_DATA: Self = Self(6);
    /// A packet that does not exist or is not due was asked for.
    pub const BAD_SEQUENCE: Self = Self(7);
    /// A packet came twice.
    pub const DUPLICATE: Self = Self(8);
    /// None of the listed ones.
    pub const OTHER: Self = Self(250);
}

impl fmt::Display for AbortReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match *self {
            Self::BUSY => "already in a session",
            Self::RESOURCES => "no resources",
            Self::TIMEOUT => "timeout",
            Self::CTS_WHILE_SENDING => "clear to send while sending",
            Self::RETRANSMIT_LIMIT => "asked again too often",
            Self::UNEXPECTED_DATA => "unexpected data",
            Self::BAD_SEQUENCE => "bad sequence number",
            Self::DUPLICATE => "duplicate sequence number",
            Self::OTHER => "other",
            Self(0xFF) => "not stated",
            Self(number) => return write!(f, "reason {number}"),
        };
        f.write_str(text)
    }
}
