//! Who restarts the program when its loop hangs: systemd, and a hardware watchdog. Both are fed by
//! the loop alone.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::Path;
use std::time::Duration;

use crate::failure::Failure;

/// The hardware is fed this often; most of it bites after a minute.
const HARDWARE_PERIOD: Duration = Duration::from_secs(1);
/// What a hardware watchdog takes for "do not bite any more" (Linux, watchdog-api).
const MAGIC_CLOSE: &[u8] = b"V";

/// What is fed.
pub(crate) struct Watchdog {
    systemd: Option<UnixDatagram>,
    systemd_period: Duration,
    systemd_due: Duration,
    hardware: Option<File>,
    hardware_due: Duration,
}

impl Watchdog {
    /// Connects to systemd where the program is its service, and opens the hardware watchdog, which
    /// counts from here.
    ///
    /// # Errors
    /// [`Failure::Input`] names the file that cannot be opened.
    #[expect(clippy::disallowed_methods, reason = "systemd tells its services by the environment")]
    pub(crate) fn open(hardware: Option<&Path>) -> Result<Self, Failure> {
        let open = |path: &Path| {
            OpenOptions::new().write(true).open(path).map_err(|e| Failure::file(path, &e))
        };
        let microseconds = std::env::var("WATCHDOG_USEC").ok().and_then(|us| us.parse().ok());
        Ok(Self {
            systemd: std::env::var("NOTIFY_SOCKET").ok().and_then(|name| connect(&name)),
            systemd_period: microseconds.map_or(Duration::from_secs(1), |us: u64| {
                (Duration::from_micros(us) / 3).max(Duration::from_millis(10))
            }),
            systemd_due: Duration::ZERO,
            hardware: hardware.map(open).transpose()?,
            hardware_due: Duration::ZERO,
        })
    }

    /// Says that the program has started.
    pub(crate) fn ready(&self) {
        self.tell("READY=1");
    }

    /// Feeds what is hungry, and tells systemd how the program is.
    pub(crate) fn feed(&mut self, elapsed: Duration, status: impl FnOnce() -> String) {
        if self.systemd.is_some() && elapsed >= self.systemd_due {
            self.systemd_due = elapsed + self.systemd_period;
            self.tell(&format!("WATCHDOG=1\nSTATUS={}", status()));
        }
        if let Some(file) = &mut self.hardware
            && elapsed >= self.hardware_due
        {
            self.hardware_due = elapsed + HARDWARE_PERIOD;
            // One that cannot be written to bites: that is what it is for
            let _ = file.write_all(b"\0");
        }
    }

    /// The program ends in good order.
    pub(crate) fn end(&mut self) {
        // Closing a recording may take longer than a tick may
        self.tell("STOPPING=1\nWATCHDOG_USEC=60000000");
        if let Some(file) = &mut self.hardware {
            let _ = file.write_all(MAGIC_CLOSE);
        }
    }

    fn tell(&self, message: &str) {
        if let Some(socket) = &self.systemd {
            let _ = socket.send(message.as_bytes());
        }
    }
}

/// The socket that systemd names: a path, or with `@` an abstract one.
fn connect(name: &str) -> Option<UnixDatagram> {
    let socket = UnixDatagram::unbound().ok()?;
    socket.set_nonblocking(true).ok()?;
    let address = match name.strip_prefix('@') {
        Some(name) => SocketAddr::from_abstract_name(name),
        None => SocketAddr::from_pathname(name),
    };
    socket.connect_addr(&address.ok()?).ok()?;
    Some(socket)
}
