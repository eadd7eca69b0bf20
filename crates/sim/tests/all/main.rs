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

#[path = "../support/arrays.rs"]
mod arrays;
#[path = "../support/mod.rs"]
mod support;

mod advantages;
mod batch;
mod braking_margin;
mod hot_retarder;
mod jam;
mod main_job;
mod promised_fuel;
mod rollout_decider;
mod words;
