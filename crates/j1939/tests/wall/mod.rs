//! Our stack in wall time, and the tools that it talks to.
#![allow(unreachable_pub, dead_code, reason = "each test uses a part")]

use std::io::{BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use j1939::bus::Bus;
use j1939::{AddressClaim, Frame, TpEvent, Transport};
use tractrix_core::Time;

/// Nothing takes longer than this, however busy the machine is.
pub const PATIENCE: Duration = Duration::from_secs(90);

/// Our stack on a bus.
pub struct Node<B> {
    start: Instant,
    pub bus: B,
    pub transport: Transport<4, 20_000>,
    pub claim: AddressClaim,
}

/// What a node has seen.
pub enum Seen {
    Frame(Frame),
    Received {
        pgn: u32,
        sa: u8,
        bytes: Vec<u8>,
    },
    Sent,
    Failed(String),
    /// Nothing: time has passed.
    Tick,
}

impl<B: Bus> Node<B> {
    pub fn new(bus: B, claim: AddressClaim) -> Self {
        let mut transport = Transport::new(255);
        transport.set_address(claim.address());
        Self { start: Instant::now(), bus, transport, claim }
    }

    pub fn now(&self) -> Time {
        Time(self.start.elapsed().as_nanos() as i64)
    }

    /// Runs until `done` says so, or panics when nothing comes.
    pub fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self, Seen) -> bool) {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            let now = self.now();
            let mut seen = Vec::new();
            while let Some(heard) = self.bus.receive(now).unwrap() {
                self.transport.on_frame(heard.time, &heard.value);
                self.claim.on_frame(heard.time, &heard.value);
                seen.push(Seen::Frame(heard.value));
            }
            self.claim.poll(now, &mut self.bus).unwrap();
            self.transport.set_address(self.claim.address());
            self.transport.poll(now, &mut self.bus).unwrap();
            while let Some(event) = self.transport.event() {
                seen.push(match event {
                    TpEvent::Received(m) => {
                        Seen::Received { pgn: m.pgn, sa: m.sa, bytes: m.bytes.to_vec() }
                    }
                    TpEvent::Sent { .. } => Seen::Sent,
                    failed @ TpEvent::Failed { .. } => Seen::Failed(format!("{failed:?}")),
                });
            }
            seen.push(Seen::Tick);
            for seen in seen {
                if done(self, seen) {
                    return;
                }
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("waited in vain for {what}");
    }
}

/// A tool that ends with the test, at the latest when its input is closed, and what it prints.
pub struct Tool {
    child: Child,
    pub output: Receiver<u8>,
}

impl Tool {
    pub fn start(words: &[&str]) -> Self {
        let mut command = Command::new(words[0]);
        let mut child = command
            .args(&words[1..])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap_or_else(|e| panic!("{}: {e}", words[0]));
        let stdout = child.stdout.take().unwrap();
        let (sender, output) = channel();
        std::thread::spawn(move || {
            BufReader::new(stdout)
                .bytes()
                .map_while(Result::ok)
                .try_for_each(|byte| sender.send(byte))
        });
        Self { child, output }
    }
}

impl Drop for Tool {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
