//! SAE J1939 for trucks that drive themselves, without I/O: time is an argument, frames go in and
//! out as values.
//!
//! | module | what it is for | source |
//! |---|---|---|
//! | `id` | priority, PGN, destination and source of a 29-bit identifier | SAE J1939-21, 5.2 |
//! | `frame` | an identifier and up to eight bytes | SAE J1939-21, 5.1 |
//! | `request` | requests for a group and their acknowledgment | SAE J1939-21, 5.4 |
//! | `tp` | messages of more than eight bytes | SAE J1939-21, 5.10 |
//! | `listen` | those messages where they are only listened to | |
//! | `claim` | getting and keeping an address | SAE J1939-81 |
//! | `supervise` | notices what is lost, spoofed, taken over, flooded | |
//! | `wire` | how long a frame takes, how busy a bus is | ISO 11898-1 |
//! | `bus` | the trait of a bus; buses in memory, of logs, of the kernel, over TCP | |
//! | `slot` | a number, or why there is none | SAE J1939-71, 5.1.5 |
//! | `check` | counters and checksums of TSC1, XBR, AEBS2 and SAS | SAE J1939-71 |
//! | `dm` | trouble codes: DM1, DM2 | SAE J1939-73 |
//! | `ident` | text: VI, CI, SOFT | SAE J1939-71 |
//! | `steering` | the place for a maker's steering frame, and an example | none |
//! | `signal`, `message` | typed messages and the table of their signals | SAE J1939-71 and J1939DA |
//! | `dbc` | the table for tools that read CAN logs | |
//! | `truck` | a truck behind its bus: what the planning stack reads and commands | |
//!
//! The core needs neither an allocator nor an operating system (`no_std`); the features `alloc` and
//! `std` add owned buffers and the buses. Nothing that comes from a bus can panic here: what cannot
//! be decoded is an error value with its PGN.
#![cfg_attr(not(feature = "std"), no_std)]

mod address_set;
pub mod bus;
pub mod check;
mod claim;
pub mod dbc;
pub mod dm;
mod error;
mod frame;
mod id;
pub mod ident;
mod listen;
pub mod message;
mod request;
mod signal;
mod slot;
pub mod steering;
pub mod supervise;
mod tp;
pub mod truck;
#[cfg(test)]
#[path = "../tests/vectors/mod.rs"]
mod vectors;
mod wire;

pub use address_set::AddressSet;
pub use claim::{ADDRESS_CLAIMED_PGN, AddressClaim, COMMANDED_ADDRESS_PGN, ClaimState, Name};
pub use error::J1939Error;
pub use frame::Frame;
pub use id::{GLOBAL_ADDRESS, Id, NULL_ADDRESS, PGN_MAX};
pub use listen::{Assembler, Whole};
pub use message::{Message, MessageTable};
pub use request::{ACKNOWLEDGMENT_PGN, Acknowledgment, Answer, REQUEST_PGN, Request};
pub use signal::Signal;
pub use slot::Slot;
pub use tp::{AbortReason, TpCounts, TpEvent, TpMessage, Transport};
pub use wire::{BitRate, BusLoad, frame_bits};
