//! What the program prints: the only module that writes to stdout and stderr.

use std::io::Write;

/// One line of what went wrong, on stderr.
#[expect(clippy::disallowed_macros, reason = "the shell prints")]
pub(crate) fn error_line(line: &str) {
    eprintln!("error: {line}");
}

/// One line for a human, on stderr; stdout is for results.
#[expect(clippy::disallowed_macros, reason = "the shell prints")]
pub(crate) fn note(line: &str) {
    eprintln!("{line}");
}

/// The result of a command, on stdout. A closed pipe is the reader's choice, not a failure.
pub(crate) fn result(text: &str) {
    let mut stdout = std::io::stdout().lock();
    let _ = writeln!(stdout, "{}", text.trim_end());
}
