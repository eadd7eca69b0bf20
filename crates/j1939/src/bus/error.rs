//! What a bus can refuse.

use tractrix_core::BusTrouble;

/// Why a frame could not be sent or received.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BusError {
    /// The send queue has no room; the frame is not sent.
    #[error("the send queue is full, it holds {0} frames")]
    Full(usize),
    /// The controller took itself off the bus after too many errors.
    #[error("the controller is off the bus after too many errors (bit rate, wiring, lone node?)")]
    Off,
    /// A line of a log or of a network bus is not what it should be.
    #[cfg(feature = "std")]
    #[error("line {line}: {why}")]
    Line {
        /// Number of the line, from 1.
        line: u64,
        /// What is wrong, with the offending text.
        why: String,
    },
    /// The file, interface or connection failed.
    #[cfg(feature = "std")]
    #[error("{what}: {why}")]
    Io {
        /// The interface, address or line that failed.
        what: String,
        /// What the operating system said.
        why: String,
    },
}

impl From<&BusError> for BusTrouble {
    fn from(error: &BusError) -> Self {
        match error {
            BusError::Full(_) => Self::Full,
            BusError::Off => Self::Off,
            #[cfg(feature = "std")]
            _ => Self::Other,
        }
    }
}

#[cfg(feature = "std")]
impl From<BusTrouble> for BusError {
    /// What a recording does not hold of it is left out.
    fn from(trouble: BusTrouble) -> Self {
        match trouble {
            BusTrouble::Full => Self::Full(0),
            BusTrouble::Off => Self::Off,
            BusTrouble::Other => Self::Io { what: "bus".to_owned(), why: "as recorded".to_owned() },
        }
    }
}
