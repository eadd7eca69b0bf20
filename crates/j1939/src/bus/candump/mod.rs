//! Logs of `candump` (can-utils): read, written and replayed.
//!
//! ```text
//! (1635188455.020850) can1 18F00E00#821639C4FFFFFFFF        candump -L
//! (1635188455.020850)  can1  18F00E00   [8]  82 16 39 C4 FF FF FF FF      candump -t a
//! ```

mod line;
mod messages;
mod read;
mod replay;
mod write;

pub use messages::{Heard, Told, messages};
pub use read::{Entry, Reader, Skipped};
pub use replay::{Pace, Replay};
pub use write::{Form, write};
