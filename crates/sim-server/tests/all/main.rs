//! The tests of this package in one program, which is compiled and linked once.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a test may fail, print and wait"
)]

#[path = "../../examples/bus_log.rs"]
mod bus_log;
#[path = "../support/mod.rs"]
mod support;

mod api;
mod bad_input;
mod bus_outside;
mod can;
mod changed_run;
mod decode;
mod diagnose;
mod documentation;
mod drives;
mod every_topic;
mod log_to_diagnosis;
mod main_job;
mod odd_roads;
mod out_folder;
mod own_truck;
mod plan_and_map;
mod process_replay;
mod serve;
mod traffic;
mod traffic_statistics;
