//! The recording of a run: an MCAP file of the `ros2` profile (schemas `ros2msg`, messages CDR).
//!
//! [`Recording`] takes the ticks in the world's thread and hands them over a bounded channel to a
//! writer thread; when the disk is slower than the world, the world waits: nothing is dropped.
//! Chunks are closed every simulated second, so that a crash loses one second at most; [`recover`]
//! makes a whole file of the rest.
//!
//! Message times are simulation time (nanoseconds since the start of the run), so that a recording
//! of the same seed holds the same messages; the wall time of the start is in the metadata.

mod file;
mod layout;
mod recorder;
pub(crate) mod recover;
pub(crate) mod ros;
mod telemetry;

pub(crate) use layout::Layout;
pub(crate) use recorder::{Recording, RunHeader, Torn};
pub(crate) use telemetry::Combination;
