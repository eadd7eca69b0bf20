//! Gives a bus to programs that connect.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};

use tractrix_core::{Stamped, Time};

use super::words::{Words, frame_message, heard, parse_send};
use crate::Frame;
use crate::bus::{Bus, BusError};

/// Programs at the same time; more are turned away.
const CLIENTS: usize = 8;
/// Messages of one program in one call; the rest is for the next.
const AT_ONCE: usize = 256;

/// A server of one interface. What one program sends goes to the bus and to the other programs.
#[derive(Debug)]
pub struct Server<B> {
    listener: TcpListener,
    interface: String,
    bus: B,
    clients: Vec<Session>,
    turned_away: u64,
}

/// A program that has connected.
#[derive(Debug)]
struct Session {
    words: Words,
    /// Whether it has opened the interface in raw mode.
    raw: bool,
}

impl<B: Bus> Server<B> {
    /// Listens on an address such as `127.0.0.1:29536`; port 0 takes a free one.
    ///
    /// # Errors
    /// When the address is no address or is taken.
    #[expect(clippy::disallowed_methods, reason = "a shell: it owns the socket")]
    pub fn bind(address: impl ToSocketAddrs, interface: &str, bus: B) -> Result<Self, BusError> {
        let fail =
            |e: std::io::Error| BusError::Io { what: interface.to_owned(), why: e.to_string() };
        let listener = TcpListener::bind(address).map_err(fail)?;
        listener.set_nonblocking(true).map_err(fail)?;
        let interface = interface.to_owned();
        Ok(Self { listener, interface, bus, clients: Vec::new(), turned_away: 0 })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// When the socket is gone.
    pub fn address(&self) -> Result<SocketAddr, BusError> {
        let fail =
            |e: std::io::Error| BusError::Io { what: self.interface.clone(), why: e.to_string() };
        self.listener.local_addr().map_err(fail)
    }

    /// Programs that are connected.
    #[must_use]
    pub fn clients(&self) -> usize {
        self.clients.len()
    }

    /// Programs that were turned away because there were too many.
    #[must_use]
    pub const fn turned_away(&self) -> u64 {
        self.turned_away
    }

    /// Carries what has come by `now`, without waiting. A program that says what it should not, or
    /// does not read what it is sent, is disconnected.
    ///
    /// # Errors
    /// When the bus or the listener fails.
    pub fn poll(&mut self, now: Time) -> Result<(), BusError> {
        self.accept()?;
        let mut all: Vec<(Option<usize>, Stamped<Frame>)> = Vec::new();
        let mut gone = Vec::new();
        for (index, client) in self.clients.iter_mut().enumerate() {
            // what a program said before it went is said
            let mut frames = Vec::new();
            if let Err(why) = client.listen(&self.interface, &mut frames) {
                client.words.say(&format!("error {why}"));
                gone.push(index);
            }
            all.extend(frames.into_iter().map(|frame| (Some(index), heard(now, frame))));
        }
        for (_, frame) in &all {
            match self.bus.send(now, &frame.value) {
                // the bus is slower than the program: as in socketcand, the frame is lost
                Ok(()) | Err(BusError::Full(_)) => {}
                Err(error) => return Err(error),
            }
        }
        for _ in 0..AT_ONCE * CLIENTS {
            match self.bus.receive(now)? {
                Some(frame) => all.push((None, frame)),
                None => break,
            }
        }
        for (index, client) in self.clients.iter_mut().enumerate() {
            let others = all.iter().filter(|(from, _)| *from != Some(index) && client.raw);
            let mut keeps_up = true;
            for (_, frame) in others {
                keeps_up &= client.words.say(&frame_message(frame));
            }
            if client.words.flush().is_err() || !keeps_up {
                gone.push(index);
            }
        }
        gone.sort_unstable();
        gone.dedup();
        for index in gone.into_iter().rev() {
            self.clients.remove(index);
        }
        Ok(())
    }

    fn accept(&mut self) -> Result<(), BusError> {
        for _ in 0..CLIENTS {
            match self.listener.accept() {
                Ok((_, _)) if self.clients.len() >= CLIENTS => self.turned_away += 1,
                Ok((stream, peer)) => {
                    let ready =
                        stream.set_nonblocking(true).and_then(|()| stream.set_nodelay(true));
                    let mut words = Words::new(stream, peer.to_string());
                    if ready.is_ok() && words.say("hi") {
                        self.clients.push(Session { words, raw: false });
                    }
                }
                Err(e) if e.kind() == ErrorKind::WouldBlock => break,
                // a program that has gone again
                Err(e)
                    if matches!(
                        e.kind(),
                        ErrorKind::ConnectionAborted | ErrorKind::Interrupted
                    ) => {}
                Err(e) => {
                    let what = self.interface.clone();
                    return Err(BusError::Io { what, why: e.to_string() });
                }
            }
        }
        Ok(())
    }
}

impl Session {
    /// Takes what the program sends to the bus.
    fn listen(&mut self, interface: &str, frames: &mut Vec<Frame>) -> Result<(), String> {
        for _ in 0..AT_ONCE {
            let Some(message) = self.words.next().map_err(|e| e.to_string())? else { break };
            let (command, rest) = message.split_once(' ').unwrap_or((&message, ""));
            match command {
                "open" if rest == interface => drop(self.words.say("ok")),
                "open" => return Err(format!("no interface {rest:?}")),
                "rawmode" => {
                    self.raw = true;
                    self.words.say("ok");
                }
                "echo" => drop(self.words.say("echo")),
                // 11-bit frames have no place on a J1939 bus
                "send" if self.raw => frames.extend(parse_send(rest)?),
                other => return Err(format!("unknown command {other:?}")),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
