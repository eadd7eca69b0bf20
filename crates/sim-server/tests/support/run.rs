//! A run of `flat` with a dashboard on a free port.

use std::time::Duration;

use serde_json::Value;

use super::serving::Serving;
use super::{client, program};

/// A run under way.
pub struct Run {
    pub serving: Serving,
    pub folder: tempfile::TempDir,
}

impl Run {
    /// Begins it, with more options.
    pub fn start(options: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut command = program();
        command.args(["run", "flat", "--port", "0", "--keep-open", "--out"]);
        command.arg(folder.path().join("out")).args(options);
        Self { serving: Serving::start(&mut command), folder }
    }

    /// Status and body of a request.
    pub fn ask(&self, method: &str, path: &str, more_headers: &str, body: &[u8]) -> (u16, Value) {
        client::ask(&self.serving.address, method, path, more_headers, body)
    }

    /// The answer to a command.
    pub fn control(&self, body: &str) -> (u16, Value) {
        self.ask("POST", "/api/v1/control", "", body.as_bytes())
    }

    /// A command that acts.
    pub fn act(&self, body: &str) -> Value {
        let (status, answer) = self.control(body);
        assert_eq!(status, 200, "{body}: {answer}");
        answer
    }

    /// Waits until the program has ended, and reads a summary of its folder.
    pub fn end(mut self, summary: &str) -> Value {
        self.serving.wait();
        let text = std::fs::read(self.folder.path().join("out").join(summary)).unwrap();
        serde_json::from_slice(&text).unwrap()
    }

    /// The frame, once there is one.
    pub fn state(&self) -> Value {
        for _ in 0..600 {
            let (status, state) = self.ask("GET", "/api/v1/state", "", b"");
            if status == 200 {
                return state;
            }
            assert_eq!(state["type"], "urn:tractrix:no_tick_yet");
            std::thread::sleep(Duration::from_millis(100));
        }
        panic!("no frame")
    }
}
