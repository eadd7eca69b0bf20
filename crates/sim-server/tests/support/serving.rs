//! The program with its HTTP server, until the test ends.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

/// A program that serves.
pub struct Serving {
    process: Child,
    /// Host and port.
    pub address: String,
}

impl Serving {
    /// Starts a command that prints its address first.
    pub fn start(command: &mut Command) -> Self {
        let mut process = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stderr.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.split("http://").nth(1).unwrap_or_else(|| panic!("{line}"));
        let address = address.split_whitespace().next().unwrap().to_owned();
        Self { process, address }
    }

    /// Identifier of the process.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Waits until the program has ended; its exit code.
    pub fn wait(&mut self) -> Option<i32> {
        for _ in 0..1200 {
            if let Some(status) = self.process.try_wait().unwrap() {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("it does not end")
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Checks that an answer is a refusal with this status, code and words.
pub fn refusal(answer: &(u16, Value), status: u16, code: &str, words: &str) {
    let (got, body) = answer;
    let kind = format!("urn:tractrix:{code}");
    assert_eq!((*got, &body["type"], &body["schema"]), (status, &kind.into(), &1.into()), "{body}");
    assert_eq!(body["status"], status);
    assert!(body["detail"].as_str().unwrap().contains(words), "{body}");
}
