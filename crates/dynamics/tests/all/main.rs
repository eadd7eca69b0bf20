//! The tests of this package in one program, which is compiled and linked once.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a test may fail, print and wait"
)]

#[path = "../support/cycle.rs"]
mod cycle;
#[path = "../support/declared.rs"]
mod declared;
#[path = "../multibody/mod.rs"]
mod multibody;
#[path = "../support/released_model.rs"]
mod released_model;
#[path = "../support/trace.rs"]
mod trace;

mod catalogue;
mod cooling;
mod data_sheet;
mod ecu;
mod fuel_map;
mod full_truck_lateral;
mod lateral_closed_forms;
mod lateral_fidelity;
mod lateral_multibody;
mod lateral_relaxation;
mod lateral_robustness;
mod lateral_stability;
mod longitudinal;
mod paper_traces;
mod sheets;
mod truck_files;
mod vecto;
