//! Where the other vehicles come from.
//!
//! [`native`]: IDM car following and MOBIL lane changes on any road, deterministic to the bit.
//! [`sumo`]: SUMO over TraCI. [`replay`]: recorded trajectories. Every source implements [`tractrix_core::TrafficSource`].

pub mod calibrate;
mod error;
mod hash;
mod mode;
pub mod native;
mod perception;
mod philox;
pub mod replay;
pub mod schedule;
mod search;
pub mod serve;
pub mod stats;
pub mod sumo;

pub use error::TrafficError;
pub use mode::{Hashed, Manifest, Mode, TICKS_PER_HASH};
pub use perception::{Perceived, PerceptionConfig};

/// Longest step that a source takes at once, s.
pub(crate) const LONGEST_JUMP_S: f64 = 600.0;
