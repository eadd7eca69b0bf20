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

mod bad_input;
mod closed_loop;
mod driven_from_outside;
mod every_file;
mod ghost;
mod golden_maps;
mod import_graph;
mod incidents;
mod lane_end;
mod localise;
mod planner_closed_loop;
mod plant_pose;
mod speed_planner_closed_loop;
mod torque_on_the_bus;
mod traffic_modes;
