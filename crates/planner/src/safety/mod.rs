//! What keeps the truck from harm whatever was planned.
//!
//! | file | holds |
//! |---|---|
//! | `surroundings` | who is ahead, behind and alongside in a lane |
//! | `rss` | safe gaps (responsibility-sensitive safety) |
//! | `gate` | whether a lane change stays outside everyone's safe gap |
//! | `guard` | the last check: stale input, jumps of the command, minimal risk |

mod gate;
#[cfg(test)]
mod gate_tests;
mod guard;
mod rss;
mod surroundings;

pub use gate::{Gate, GateView};
pub(crate) use gate::{SpeedCourse, Strictness};
pub use guard::GuardConfig;
pub(crate) use guard::{GuardInput, GuardMemory, Headway, Inputs, inspect, limit};
pub use rss::{RearResponse, RssConfig, SafeGap};
pub(crate) use surroundings::{EgoExtent, ahead, behind, in_lane, reaches};
