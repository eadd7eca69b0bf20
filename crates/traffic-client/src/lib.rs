//! Where the other vehicles come from.
//!
//! [`native`]: IDM car following and MOBIL lane changes on any road, deterministic to the bit.
//! [`sumo`]: SUMO over TraCI. [`replay`]: recorded trajectories. Every source implements [`tractrix_core::TrafficSource`].
//!
//! ```
//! use std::sync::Arc;
//! use tractrix_core::{EgoState, Geometry, Time, TrafficSource};
//! use traffic_client::native::{NativeTraffic, TrafficConfig};
//!
//! let road = Arc::new(road::builtin::flat(5_000.0));
//! let mut traffic = NativeTraffic::new(road, Geometry::default(), TrafficConfig::default())?;
//! let ego = EgoState { s_m: 1_000.0, speed_m_s: 20.0, ..EgoState::default() };
//! let scene = traffic.advance(Time::from_seconds(1.0), &ego)?;
//! assert!(!scene.neighbours.is_empty());
//! # Ok::<(), traffic_client::TrafficError>(())
//! ```

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
