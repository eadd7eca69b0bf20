//! Where frames come from and go to: one trait, several buses.
//!
//! | module | what it is | feature |
//! |---|---|---|
//! | `loopback` | a bus in memory with bit times, stuffing and arbitration | `std` |
//! | `faults` | loss, delay, duplicates, corruption and bus-off around any bus | `std` |
//! | `tap` | every frame both ways to a recorder | |
//! | `candump` | logs of the tool of that name: read, write, replay | `std` |
//! | `socketcan` | an interface of the Linux kernel | `std` |
//! | `socketcand` | frames over TCP, client and server | `std` |

#[cfg(feature = "std")]
pub mod candump;
mod error;
#[cfg(feature = "std")]
pub mod faults;
#[cfg(feature = "std")]
pub mod loopback;
#[cfg(feature = "std")]
mod open;
#[cfg(all(feature = "std", target_os = "linux"))]
pub mod socketcan;
#[cfg(feature = "std")]
pub mod socketcand;
pub mod tap;

pub use error::BusError;
#[cfg(feature = "std")]
pub use open::open;
use tractrix_core::{Stamped, Time};

use crate::Frame;

/// A classic CAN bus as one node has it. Calls never wait, and what a bus holds for a node is
/// bounded. A node does not receive what it sent itself.
pub trait Bus {
    /// Puts a frame in the send queue at `now`.
    ///
    /// # Errors
    /// [`BusError::Full`] when the queue has no room: the frame is not sent. Other errors say that
    /// the bus cannot be used at present.
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError>;

    /// The next frame that has come in by `now`, with the time of its end; none when there is none.
    ///
    /// # Errors
    /// When the bus cannot be used at present, or a log cannot be read.
    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError>;

    /// Error frames of the controller so far: many of them and no other frame are a wrong bit rate
    /// or wrong wiring. A bus without a controller has none.
    fn error_frames(&self) -> u64 {
        0
    }
}

impl<B: Bus + ?Sized> Bus for &mut B {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        (**self).send(now, frame)
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        (**self).receive(now)
    }

    fn error_frames(&self) -> u64 {
        (**self).error_frames()
    }
}

#[cfg(feature = "std")]
impl<B: Bus + ?Sized> Bus for Box<B> {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        (**self).send(now, frame)
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        (**self).receive(now)
    }

    fn error_frames(&self) -> u64 {
        (**self).error_frames()
    }
}
