//! The socket: sends one request, waits for its answer, never longer than it is told to.

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use socket2::{Domain, Socket, Type};

use super::codec::Frames;
use super::error::SumoError;

/// A connection to SUMO.
#[derive(Debug)]
pub struct Connection {
    stream: TcpStream,
    frames: Frames,
    body: Vec<u8>,
    chunk: Vec<u8>,
    /// Timeout that the socket has now; not set again for each exchange.
    timeout: Option<Duration>,
}

/// Why no answer came; the caller knows what to say about the process.
#[derive(Debug)]
pub enum LinkError {
    /// The peer closed or reset the connection.
    Closed,
    /// No complete answer in time.
    TimedOut,
    /// The answer breaks the protocol.
    Protocol(super::codec::ProtocolError),
}

#[expect(clippy::disallowed_methods, reason = "the socket shell needs a clock for its deadlines")]
fn now() -> Instant {
    Instant::now()
}

impl Connection {
    /// Connects to a local port as soon as it opens. `is_alive` is asked between attempts.
    ///
    /// # Errors
    /// `None` in the error: the process ended; otherwise a timeout.
    #[expect(clippy::disallowed_methods, reason = "this is the one place that opens SUMO's socket")]
    pub fn open(
        port: u16,
        timeout: Duration,
        mut is_alive: impl FnMut() -> bool,
    ) -> Result<Self, LinkError> {
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let deadline = now() + timeout;
        loop {
            if let Ok(stream) = TcpStream::connect_timeout(&address, Duration::from_secs(1)) {
                // Without this a step costs 40 ms (delayed acknowledgement).
                let _ = stream.set_nodelay(true);
                return Ok(Self {
                    stream,
                    frames: Frames::default(),
                    body: Vec::new(),
                    chunk: vec![0; 1 << 16],
                    timeout: None,
                });
            }
            if !is_alive() {
                return Err(LinkError::Closed);
            }
            if now() >= deadline {
                return Err(LinkError::TimedOut);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Sends a request and waits for its answer, which is returned without its length.
    ///
    /// # Errors
    /// [`LinkError`]; the connection is unusable afterwards.
    pub fn exchange(&mut self, message: &[u8], timeout: Duration) -> Result<&[u8], LinkError> {
        let deadline = now() + timeout;
        self.wait_at_most(timeout)?;
        self.stream.write_all(message).map_err(|e| link(&e))?;
        loop {
            if self.frames.take(&mut self.body).map_err(LinkError::Protocol)? {
                return Ok(&self.body);
            }
            if self.frames.is_partial() {
                let left = deadline.saturating_duration_since(now());
                if left.is_zero() {
                    return Err(LinkError::TimedOut);
                }
                self.wait_at_most(left)?;
            }
            match self.stream.read(&mut self.chunk) {
                Ok(0) => return Err(LinkError::Closed),
                Ok(n) => self.frames.push(self.chunk.get(..n).unwrap_or_default()),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(link(&e)),
            }
        }
    }

    fn wait_at_most(&mut self, timeout: Duration) -> Result<(), LinkError> {
        if self.timeout != Some(timeout) {
            self.timeout = None;
            self.stream.set_write_timeout(Some(timeout)).map_err(|_| LinkError::Closed)?;
            self.stream.set_read_timeout(Some(timeout)).map_err(|_| LinkError::Closed)?;
            self.timeout = Some(timeout);
        }
        Ok(())
    }
}

fn link(e: &std::io::Error) -> LinkError {
    match e.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => LinkError::TimedOut,
        _ => LinkError::Closed,
    }
}

/// A local port that the system gives to nobody else while this lives.
///
/// It is bound and does not listen, so that SUMO, which allows addresses to be used again, can
/// listen there. A port that was only looked up and let go was given to two that started at the
/// same time: each talked to the other's SUMO.
#[derive(Debug)]
pub struct PortClaim {
    _socket: Socket,
    /// The port.
    pub port: u16,
}

impl PortClaim {
    /// A port that is free now.
    ///
    /// # Errors
    /// [`SumoError::File`] if the system gives none.
    pub fn new() -> Result<Self, SumoError> {
        let any = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let claim = || {
            let socket = Socket::new(Domain::IPV4, Type::STREAM, None)?;
            socket.set_reuse_address(true)?;
            socket.bind(&any.into())?;
            let address = socket.local_addr()?.as_socket().ok_or(ErrorKind::AddrNotAvailable)?;
            Ok(Self { _socket: socket, port: address.port() })
        };
        claim().map_err(|e: std::io::Error| SumoError::File {
            path: "127.0.0.1:0".to_owned(),
            why: e.to_string(),
        })
    }
}
