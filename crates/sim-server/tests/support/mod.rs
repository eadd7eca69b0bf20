//! Running the program and reading what it says.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "each test file uses its own part, and a helper that fails fails the test"
)]

pub mod client;
pub mod columns;
pub mod run;
pub mod serving;

use std::path::Path;
use std::process::{Command, Output};

/// The program.
pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_sim-server"))
}

/// Runs the program to its end.
pub fn server(arguments: &[&str]) -> Output {
    program().args(arguments).output().unwrap()
}

/// Runs the program, which must refuse: exit code 2, one line on stderr, nothing on stdout.
/// Returns the line.
pub fn refused(arguments: &[&str]) -> String {
    let output = server(arguments);
    let line = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
    assert_eq!(line.lines().count(), 1, "{arguments:?}: {line}");
    assert!(line.starts_with("error: "), "{line}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    line
}

/// A scenario file: the built-in `flat` with a few lines more (or a table of it replaced).
pub fn scenario_with(folder: &Path, lines: &str) -> String {
    let base = "schema = 1\nname = \"test\"\nroad = \"builtin:flat\"\n";
    let truck = "[truck]\nfile = \"sinotruk\"\npayload_kg = 30000.0\n";
    let text = if lines.starts_with('[') {
        format!("{base}{truck}{lines}")
    } else {
        format!("{base}{lines}{truck}")
    };
    let file = folder.join("scenario.toml");
    std::fs::write(&file, text).unwrap();
    file.display().to_string()
}
