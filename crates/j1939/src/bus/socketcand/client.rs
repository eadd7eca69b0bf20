//! A bus behind a socketcand server.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use tractrix_core::{Stamped, Time};

use super::WAITING;
use super::words::{Words, heard, parse_frame, send_message};
use crate::Frame;
use crate::bus::{Bus, BusError};

/// How long a server may take to accept, and for each of its answers.
const PATIENCE: Duration = Duration::from_secs(5);
/// Messages of the server before its answer; more is no socketcand.
const GREETINGS: usize = 100;
/// Frames that fit into what waits to be written.
const QUEUE: usize = WAITING / 64;

/// A connection to an interface of a server. Frames carry the time at which they are received here:
/// the server's clock is another.
#[derive(Debug)]
pub struct Client {
    words: Words,
    skipped: u64,
}

impl Client {
    /// Connects to `HOST:PORT` and opens an interface there, within a few seconds.
    ///
    /// # Errors
    /// When nobody answers there, or not as a socketcand, or without that interface.
    pub fn connect(server: &str, interface: &str) -> Result<Self, BusError> {
        let name = format!("{server}/{interface}");
        let fail = |e: std::io::Error| BusError::Io { what: name.clone(), why: e.to_string() };
        if interface.is_empty() || !interface.bytes().all(|b| b.is_ascii_alphanumeric()) {
            let why = "an interface has letters and digits only".to_owned();
            return Err(BusError::Io { what: name, why });
        }
        let mut failed = std::io::Error::other("no such host");
        for address in server.to_socket_addrs().map_err(fail)? {
            match TcpStream::connect_timeout(&address, PATIENCE) {
                Err(error) => failed = error,
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(fail)?;
                    stream.set_read_timeout(Some(PATIENCE)).map_err(fail)?;
                    let again = stream.try_clone().map_err(fail)?;
                    let mut client = Self { words: Words::new(stream, name.clone()), skipped: 0 };
                    client.expect("hi")?;
                    for wish in [format!("open {interface}"), "rawmode".to_owned()] {
                        client.words.say(&wish);
                        client.words.flush()?;
                        client.expect("ok")?;
                    }
                    again.set_nonblocking(true).map_err(fail)?;
                    return Ok(client);
                }
            }
        }
        Err(fail(failed))
    }

    /// Frames with 11-bit identifiers: never J1939.
    #[must_use]
    pub const fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Waits for an answer; frames that come before it are of a mode that is not asked for.
    fn expect(&mut self, answer: &str) -> Result<(), BusError> {
        for _ in 0..GREETINGS {
            match self.words.next()? {
                Some(word) if word == answer => return Ok(()),
                Some(word) if word.starts_with("error") => {
                    return Err(self.words.failure(format!("the server says: {word}")));
                }
                Some(_) => {}
                // part of a message, or the patience is over
                None => {}
            }
        }
        Err(self.words.failure(format!("no answer \"{answer}\": is this a socketcand?")))
    }
}

impl Bus for Client {
    fn send(&mut self, _now: Time, frame: &Frame) -> Result<(), BusError> {
        self.words.flush()?;
        if !self.words.say(&send_message(frame)) {
            return Err(BusError::Full(QUEUE));
        }
        self.words.flush()
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        self.words.flush()?;
        while let Some(word) = self.words.next()? {
            if let Some(text) = word.strip_prefix("frame ") {
                match parse_frame(text).map_err(|why| self.words.wrong(why))? {
                    Some(frame) => return Ok(Some(heard(now, frame))),
                    None => self.skipped += 1,
                }
            } else if word.starts_with("error") {
                return Err(self.words.failure(format!("the server says: {word}")));
            }
        }
        Ok(None)
    }
}
