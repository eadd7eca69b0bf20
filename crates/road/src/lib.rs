//! Road geometry, lanes, grade, bank, curvature and limits.
//!
//! A [`Road`] is one carriageway as the ego drives it: station `s` in metres along the reference
//! line, offset `d` to the left of it. Grade is positive uphill, bank positive with the left side
//! up, curvature positive to the left, headings counter-clockwise from map x.
//!
//! ```
//! let road = road::Road::load("builtin:highway")?; // or a map.xodr, a profile.csv
//! assert_eq!(road.lanes_at(7_000.0).count(), 3); // a climbing lane
//! let here = road.at(2_000.0, 0.0);
//! let back = road.project(here.x_m, here.y_m, Some(1_950.0));
//! assert!(back.is_some_and(|p| (p.s_m - 2_000.0).abs() < 0.01));
//! # Ok::<(), road::RoadError>(())
//! ```
#![cfg_attr(not(feature = "std"), no_std)]
extern crate alloc;

mod bake;
pub mod builtin;
#[cfg(feature = "std")]
mod csv_profile;
mod cubics;
mod error;
mod findings;
mod geo;
mod lane;
mod line;
#[cfg(feature = "std")]
pub mod opendrive;
mod road;
mod shape;
mod small;
#[cfg(feature = "std")]
mod smooth;
#[cfg(feature = "std")]
pub mod xml;

pub use bake::BAKE_TOLERANCE_M;
pub use cubics::Cubics;
pub use error::RoadError;
pub use findings::{Finding, Severity};
pub use geo::GeoReference;
pub use lane::{LaneEnd, LaneKind, LaneSource, LaneTrack};
pub use line::{Knot, Line};
pub use road::{ProfilePoint, Road, RoadObject, RoadPoint, RoadPosition, Surface};
pub use shape::{Jet, Placed, Shape};
