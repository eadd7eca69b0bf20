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
#![allow(clippy::duplicate_mod, reason = "`pcc` has its data sheet also in examples and benches")]

#[path = "../support/pcc/mod.rs"]
mod pcc;
#[path = "../support/mod.rs"]
mod support;

mod closed_loop;
mod emergencies;
mod guarded;
mod lane_changes;
mod no_courtesy;
mod pcc_reference;
mod pcc_solvers;
mod policy;
mod random_policy;
mod safe_gap;
mod speed_plan;
mod would_pass;
