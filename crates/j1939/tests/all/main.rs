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

#[path = "../fuzzed/mod.rs"]
mod fuzzed;
#[path = "../support/mod.rs"]
mod support;
#[path = "../typed/mod.rs"]
mod typed;
#[path = "../vectors/mod.rs"]
mod vectors;

mod attack_logs;
mod bus_truck;
mod bus_truck_fuzz;
mod corpus;
mod messages;
mod network_logs;
mod protection_logs;
mod roundtrip;
