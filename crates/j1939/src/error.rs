//! Errors of the J1939 core.

use crate::{Slot, check::Verdict};

/// What a caller or a bus can get wrong.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum J1939Error {
    /// Priorities have three bits.
    #[error("priority {0} is not one of 0 to 7")]
    Priority(u8),
    /// Parameter group numbers have 18 bits, and those with a destination end in a zero byte.
    #[error("PGN {0} does not exist: 18 bits, and a zero last byte below PDU format 240")]
    Pgn(u32),
    /// A parameter group of format PDU2 goes to everybody.
    #[error("PGN {pgn} goes to everybody, it cannot go to address {da:#04X}")]
    Destination {
        /// The parameter group.
        pgn: u32,
        /// The address asked for.
        da: u8,
    },
    /// A classic CAN frame has at most eight bytes.
    #[error("a frame of PGN {pgn} cannot hold {len} bytes, eight at most")]
    Length {
        /// The parameter group.
        pgn: u32,
        /// Bytes asked for.
        len: usize,
    },
    /// A message is shorter than the shortest edition of its layout.
    #[error("PGN {pgn} from {sa:#04X} has {len} bytes, it needs {need}")]
    Short {
        /// The parameter group.
        pgn: u32,
        /// Who sent it.
        sa: u8,
        /// Its bytes.
        len: usize,
        /// Bytes of the shortest edition.
        need: usize,
    },
    /// A number outside the data band, or a state that the signal has no raw value for.
    #[error("PGN {pgn}: {signal} cannot say {slot:?}")]
    NotEncodable {
        /// The parameter group.
        pgn: u32,
        /// The signal.
        signal: &'static str,
        /// What it should have said.
        slot: Slot<f64>,
    },
    /// A trouble code that does not fit into its bits.
    #[error(
        "PGN {pgn}: trouble code {spn}/{fmi} does not fit: 19 bits, 5 bits, up to 126 occurrences"
    )]
    Dtc {
        /// The parameter group.
        pgn: u32,
        /// Its suspect parameter number.
        spn: u32,
        /// Its failure mode.
        fmi: u8,
    },
    /// A message does not fit into the caller's buffer.
    #[error("PGN {pgn} needs {need} bytes, the buffer has {len}")]
    Buffer {
        /// The parameter group.
        pgn: u32,
        /// Bytes of the buffer.
        len: usize,
        /// Bytes of the message.
        need: usize,
    },
    /// A field of text is no printable ASCII.
    #[error("PGN {pgn} of {sa:#04X}: a field is no printable ASCII")]
    Text {
        /// The parameter group.
        pgn: u32,
        /// Who sent it.
        sa: u8,
    },
    /// A demand whose counter or checksum does not let it act.
    #[error("PGN {pgn} from {sa:#04X} must not act: {verdict:?}")]
    Unprotected {
        /// The parameter group.
        pgn: u32,
        /// Who sent it.
        sa: u8,
        /// What was found.
        verdict: Verdict,
    },
    /// A signal that is needed carries no number.
    #[error("PGN {pgn} from {sa:#04X}: {signal} has no value")]
    NoValue {
        /// The parameter group.
        pgn: u32,
        /// Who sent it.
        sa: u8,
        /// The signal.
        signal: &'static str,
    },
    /// Only a node that has claimed an address may send.
    #[error("no address is claimed, nothing may be sent")]
    NoAddress,
    /// A message that the transport cannot carry.
    #[error("a message of PGN {pgn} cannot hold {len} bytes, it has 1 to {most}")]
    MessageLength {
        /// The parameter group.
        pgn: u32,
        /// Bytes asked for.
        len: usize,
        /// The most there may be, for this destination and memory.
        most: usize,
    },
    /// A message to the same destination is under way, or no memory is free.
    #[error("PGN {pgn} cannot go to {da:#04X} yet: a message is under way, or no session is free")]
    TransportBusy {
        /// The parameter group.
        pgn: u32,
        /// The destination.
        da: u8,
    },
}
