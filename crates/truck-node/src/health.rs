//! How the program is, for who connects to a loopback port: one JSON object a connection.

use std::io::Write;
use std::net::{SocketAddr, TcpListener};

use crate::failure::Failure;

/// Connections that are answered in one tick; the others wait.
const AT_ONCE: usize = 2;

/// The listener.
pub(crate) struct Health(TcpListener);

impl Health {
    /// Listens.
    ///
    /// # Errors
    /// [`Failure::Input`] names the address that cannot be listened on.
    #[expect(clippy::disallowed_methods, reason = "the shell owns its sockets")]
    pub(crate) fn bind(address: SocketAddr) -> Result<Self, Failure> {
        let fail = |e: std::io::Error| Failure::input(format!("--health {address}: {e}"));
        let listener = TcpListener::bind(address).map_err(fail)?;
        listener.set_nonblocking(true).map_err(fail)?;
        Ok(Self(listener))
    }

    /// Answers who has connected. The answer fits into the socket's buffer: nobody is waited for.
    pub(crate) fn serve(&self, mut state: impl FnMut() -> serde_json::Value) {
        for _ in 0..AT_ONCE {
            let Ok((mut stream, _)) = self.0.accept() else { return };
            if stream.set_nonblocking(true).is_ok() {
                let _ = writeln!(stream, "{}", state());
            }
        }
    }
}
