//! The tests of this package in one program, which is compiled and linked once.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a test may fail, print and wait"
)]

#[path = "../../examples/window/measure.rs"]
mod measure;

mod capacity;
mod happenings;
mod native_campaign;
mod native_traffic;
mod replay;
mod sumo_faults;
mod sumo_real;
mod takeover;
mod window;
