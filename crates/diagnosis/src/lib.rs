//! What the simulation gets wrong on measured drives, the named cause, the extended truck and the
//! gain.
#![cfg_attr(test, allow(clippy::indexing_slicing))]

mod channel;
pub mod clock;
mod drive;
mod error;
mod param;
mod plant;
mod plant_reference;
mod replay;
mod finding;
mod read;

pub use channel::Channel;
pub use drive::{Drive, DriveSet, RoadMap};
pub use error::DiagnosisError;
pub use finding::{Action, Finding, FindingKind};
pub use plant::Plant;
pub use replay::Module;
pub use read::{RawTable, read_drives, read_table};
