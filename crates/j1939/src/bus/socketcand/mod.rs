//! Frames over TCP in the text protocol of `socketcand` (raw mode): a bus for several programs
//! where the kernel has no CAN, and for tools such as python-can.
//!
//! ```text
//! < hi >  < open can0 >  < ok >  < rawmode >  < ok >
//! < send 18EAFFFE 3 0 ee 0 >  < frame 18EEFF27 12.345678 0700000000000000 >
//! ```
//! The protocol knows no passwords: whoever can connect can send. Servers listen on 127.0.0.1
//! unless another address is asked for. This is a shell: it opens sockets; it never waits except in
//! [`Client::connect`].

mod client;
mod server;
mod words;

pub use client::Client;
pub use server::Server;

/// Port that `socketcand` has.
pub const PORT: u16 = 29_536;
/// Bytes that wait to be written to one peer; about a thousand frames.
const WAITING: usize = 65_536;
