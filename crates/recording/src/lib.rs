//! The recording of a run: an MCAP file of the `ros2` profile (schemas `ros2msg`, messages CDR).
//!
//! [`messages`] is the pure step from a tick to the messages of its topics ([`TOPICS`]), for a file
//! or a network alike ([`static_frames`] and [`lanes_at_start`] come before the first tick). [`Recording`] takes the ticks in the world's thread and hands them over a bounded
//! channel to a writer thread; when the disk is slower than the world, the world waits and nothing
//! is left out, or ([`Backlog::Drop`], on a truck) the world goes on and the gap is counted. Chunks are closed
//! twice a simulated second, so that a crash loses less than one second;
//! [`recover`] makes a whole file of the rest. [`Reader`] reads fields by name, [`Inputs`] what the
//! stack and its bus were given, [`Player`] the messages as they are, from any time on.
//!
//! Message times are simulation time (nanoseconds since the start of the run), so that a recording
//! of the same seed holds the same messages; the wall time of the start is in the metadata.

mod error;
mod file;
mod inputs;
pub mod lane_lines;
mod layout;
mod player;
mod reader;
mod recorder;
mod records;
mod recover;
mod ros;
mod schedule;
mod telemetry;
mod topic;
mod writer;

pub use error::RecordingError;
pub use inputs::{About, BusCall, BusTrace, DriverWish, GivenStep, Inputs, SentFrame};
pub use player::{MOST_LATCHED, PlayedChannel, PlayedMessage, Player};
pub use reader::{Entry, Reader, Wanted};
pub use recorder::{Backlog, BusHeader, Listener, Recording, RunHeader, Torn};
pub use recover::{Recovered, recover, recover_into};
pub use schedule::{Due, Schedule};
pub use telemetry::{Combination, Geodesy, Scenery, lanes_at_start, messages, static_frames};
pub use topic::{BUS_FRAMES, TOPICS, Topic, TopicMessage, bus_name};

#[cfg(test)]
mod tests {
    use dynamics::{RoadPatch, TruckModel, TruckParameters};

    /// The sheet of a truck.
    pub(crate) fn sheet() -> String {
        let model = TruckModel::new(TruckParameters::load("reference").unwrap(), 2e4).unwrap();
        model.vehicle_limits_in(&RoadPatch::default()).unwrap().to_sheet().unwrap()
    }
}
