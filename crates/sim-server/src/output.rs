//! What the program prints: the only module that writes to stdout and stderr.

use std::io::{ErrorKind, Write};
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
