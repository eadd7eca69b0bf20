//! A satellite receiver at a serial device, in a named pipe or behind TCP, read in a thread of its
//! own: a device that is silent holds nobody up.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use planner::localise::Nmea;
use tractrix_core::{Fix, Stamped};

use crate::clock::Clock;
use crate::failure::Failure;

/// Fixes that wait for the loop; more are dropped.
const WAITING: usize = 64;
/// A line that is longer is none.
const LONGEST: usize = 256;
/// How long a server may take to accept.
const PATIENCE: Duration = Duration::from_secs(5);
/// Between two attempts to open a receiver that has gone.
const PAUSE: Duration = Duration::from_secs(1);

/// Fixes as they come in.
pub(crate) struct Fixes(Receiver<Stamped<Fix>>);

impl Fixes {
    /// Opens `HOST:PORT`, or a file.
    ///
    /// # Errors
    /// [`Failure::Input`] names the source that cannot be opened.
    pub(crate) fn open(source: &str, clock: Clock) -> Result<Self, Failure> {
        // A pipe can be opened once somebody writes: that is waited for in the thread
        if is_pipe(source) {
            return Ok(Self::read(None, source, clock));
        }
        let first =
            open(source).map_err(|e| Failure::input(format!("--pose nmea:{source}: {e}")))?;
        Ok(Self::read(Some(first), source, clock))
    }

    #[expect(clippy::disallowed_methods, reason = "the shell waits for a receiver in a thread")]
    fn read(mut input: Option<Box<dyn Read + Send>>, source: &str, clock: Clock) -> Self {
        let (sender, receiver) = sync_channel(WAITING);
        let source = source.to_owned();
        let again = !Path::new(&source).is_file();
        std::thread::spawn(move || {
            loop {
                let opened = input.take().map_or_else(|| open(&source), Ok);
                let wanted = opened.map_or(true, |from| listen(from, &sender, clock));
                if !wanted || !again {
                    break;
                }
                std::thread::sleep(PAUSE);
            }
        });
        Self(receiver)
    }

    /// The next fix that has come in.
    pub(crate) fn next(&self) -> Option<Stamped<Fix>> {
        self.0.try_recv().ok()
    }
}

fn is_pipe(source: &str) -> bool {
    use std::os::unix::fs::FileTypeExt;
    std::fs::metadata(source).is_ok_and(|m| m.file_type().is_fifo())
}

fn open(source: &str) -> std::io::Result<Box<dyn Read + Send>> {
    if Path::new(source).exists() || !source.contains(':') {
        return Ok(Box::new(File::open(source)?));
    }
    let mut failed = ErrorKind::NotFound.into();
    for address in source.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => return Ok(Box::new(stream)),
            Err(error) => failed = error,
        }
    }
    Err(failed)
}

/// Reads until the source ends; whether anybody still wants fixes.
fn listen(mut from: impl Read, to: &SyncSender<Stamped<Fix>>, clock: Clock) -> bool {
    let (mut nmea, mut line, mut bytes) = (Nmea::default(), Vec::new(), [0; 512]);
    loop {
        let got = match from.read(&mut bytes) {
            Ok(0) => return true,
            Ok(got) => got,
            Err(e) if e.kind() == ErrorKind::Interrupted => continue,
            Err(_) => return true,
        };
        for byte in bytes.iter().take(got) {
            match byte {
                b'\n' => {
                    let fix = nmea.sentence(&line);
                    line.clear();
                    if let Ok(Some(value)) = fix {
                        let sent = to.try_send(Stamped { time: clock.now(), value });
                        if matches!(sent, Err(TrySendError::Disconnected(_))) {
                            return false;
                        }
                    }
                }
                byte if line.len() < LONGEST => line.push(*byte),
                _ => {}
            }
        }
    }
}
