//! What the program prints: the only module that writes to stdout and stderr. Nobody who reads has
//! to: a closed pipe or a full disk does not stop a truck.

use std::io::Write;

/// One or more lines of the report, on stdout.
pub(crate) fn report(text: &str) {
    let mut stdout = std::io::stdout().lock();
    let _ = writeln!(stdout, "{}", text.trim_end()).and_then(|()| stdout.flush());
}

/// One line of what went wrong, on stderr.
pub(crate) fn note(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}
