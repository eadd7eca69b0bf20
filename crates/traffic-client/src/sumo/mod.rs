//! SUMO as a traffic source, over TraCI.
//!
//! Layers, each usable alone: [`codec`] (bytes), [`session`] (conversation, no I/O), [`tcp`]
//! (socket), [`process`] (the program), [`link`] (all of them together, with the failures).
//!
//! SUMO is EPL-2.0/GPL-2.0; it is started as a separate program and spoken to over a socket.

mod check;
pub mod codec;
mod config;
mod demand;
mod error;
pub mod link;
pub mod network;
mod odd;
mod plain;
pub mod process;
pub mod session;
mod shown;
mod source;
mod step;
pub mod tcp;

pub use check::{ImportCheck, TOLERANCE_M, check};
pub use config::{SumoConfig, TypeAttributes};
pub use error::SumoError;
pub use link::{Link, Timeouts};
pub use process::Programs;
pub use source::SumoTraffic;
