//! The tests of this package in one program, which is compiled and linked once.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a test may fail, print and wait"
)]

#[path = "../common/mod.rs"]
mod common;

mod against_xodr;
mod fuzz;
mod jinan;
mod maps;
mod netconvert;
mod opendrive;
mod road_view;
