//! What the program prints: the only module that writes to stdout and stderr.

use std::io::{BufWriter, ErrorKind, StdoutLock, Write};
use std::path::Path;

use crate::failure::Failure;

/// One line of what went wrong, on stderr.
pub(crate) fn error_line(line: &str) {
    note(&format!("error: {line}"));
}

/// One line for a human, on stderr; stdout is for results. A terminal that is gone does not matter.
pub(crate) fn note(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// The result of a command, on stdout. A closed pipe is the reader's choice, not a failure.
///
/// # Errors
/// [`Failure::Work`] when stdout goes into a file on a full disk.
pub(crate) fn result(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    let written = writeln!(stdout, "{}", text.trim_end()).and_then(|()| stdout.flush());
    match written {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::writing(Path::new("standard output"), &e))
        }
        _ => Ok(()),
    }
}

/// Many lines of results, on stdout. A closed pipe is the reader's choice, not a failure.
pub(crate) struct Lines {
    stdout: BufWriter<StdoutLock<'static>>,
    nobody_reads: bool,
}

impl Lines {
    pub(crate) fn new() -> Self {
        Self { stdout: BufWriter::new(std::io::stdout().lock()), nobody_reads: false }
    }

    /// Whether the reader has closed the pipe.
    pub(crate) const fn nobody_reads(&self) -> bool {
        self.nobody_reads
    }

    /// Writes whole lines.
    ///
    /// # Errors
    /// [`Failure::Work`] when stdout goes into a file on a full disk.
    pub(crate) fn write(&mut self, lines: &str) -> Result<(), Failure> {
        let written = self.stdout.write_all(lines.as_bytes());
        self.check(written)
    }

    /// Writes what is still in memory.
    ///
    /// # Errors
    /// As [`Lines::write`].
    pub(crate) fn flush(&mut self) -> Result<(), Failure> {
        let written = self.stdout.flush();
        self.check(written)
    }

    fn check(&mut self, written: std::io::Result<()>) -> Result<(), Failure> {
        match written {
            Err(e) if e.kind() == ErrorKind::BrokenPipe => self.nobody_reads = true,
            Err(e) => return Err(Failure::writing(Path::new("standard output"), &e)),
            Ok(()) => {}
        }
        Ok(())
    }
}
