//! The truck: a list of effects, an integrator and truck files.
//!
//! [`TruckParameters`] is a truck file; [`TruckModel`] one truck in one loading state;
//! [`TruckModel::step`] a pure function from state, command and road patch to the next state.
//! Reference point: centre of the drive-axle group, on the ground. SI and radians; truck files use
//! rpm where the field does.
//!
//! ```
//! use dynamics::{RoadPatch, TruckModel, TruckParameters};
//! use tractrix_core::Command;
//!
//! let truck = TruckModel::new(TruckParameters::load("longhaul")?, 21_000.0)?;
//! let uphill = RoadPatch { grade_rad: 0.02, ..RoadPatch::default() };
//! let command = Command { accelerator_pedal_frac: 1.0, ..Command::default() };
//! let mut state = truck.initial_state(0.0, 0.0, 0.0, 20.0);
//! for _ in 0..100 {
//!     state = truck.step(&state, &command, &uphill, 0.01)?;
//! }
//! assert!((state.distance_m - 20.0).abs() < 0.5);
//! # Ok::<(), dynamics::DynamicsError>(())
//! ```

mod bounds;
pub mod catalogue;
pub mod data_sheet;
mod ecu;
pub mod effects;
mod error;
pub mod lateral;
mod model;
mod output;
mod parameters;
mod provenance;
mod state;

pub use ecu::EcuState;
pub use effects::instruments::InstrumentParameters;
pub use error::DynamicsError;
pub use model::TruckModel;
pub use output::PaperOutputs;
pub use parameters::{BodyParameters, Overlay, OverlayValue, TruckParameters};
pub use provenance::{FigureOrigin, KnownBy, Provenance};
pub use state::{DelayLine, Forces, MAX_DELAY_S, RoadPatch, SUBSTEP_S, TruckState};
