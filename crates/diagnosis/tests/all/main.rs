//! The tests of this package in one program, which is compiled and linked once. What needs a
//! program of its own stands beside.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a test may fail, print and wait"
)]

#[allow(dead_code, reason = "the example `campaign` uses the rest")]
#[path = "../support/mod.rs"]
mod support;

mod bad_input;
mod coast_down;
mod generator;
mod hidden_effects;
mod identify;
mod meters;
mod reading;
mod whole_traces;
