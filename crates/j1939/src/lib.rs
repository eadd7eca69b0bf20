//! SAE J1939 for trucks that drive themselves, without I/O: time is an argument, frames go in and
//! out as values.
//!
//! | module | what it is for | source |
//! |---|---|---|
//! | `id` | priority, PGN, destination and source of a 29-bit identifier | SAE J1939-21, 5.2 |
//! | `frame` | an identifier and up to eight bytes | SAE J1939-21, 5.1 |
//!
//! The core needs neither an allocator nor an operating system (`no_std`); the features `alloc` and
//! `std` add owned buffers and the buses. Nothing that comes from a bus can panic here: what cannot
//! be decoded is an error value with its PGN.
#![cfg_attr(not(feature = "std"), no_std)]

mod error;
mod frame;
mod id;

pub use error::J1939Error;
pub use frame::Frame;
pub use id::{GLOBAL_ADDRESS, Id, NULL_ADDRESS, PGN_MAX};
