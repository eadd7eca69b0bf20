//! A node in wall time: its clock, its address, its long messages.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use j1939::bus::Bus;
use j1939::{
    Acknowledgment, AddressClaim, Answer, ClaimState, Frame, GLOBAL_ADDRESS, J1939Error, Request,
    TpEvent, Transport,
};
use tractrix_core::{Stamped, Time};

use crate::failure::Failure;

/// Between two looks at the bus.
const PAUSE: Duration = Duration::from_millis(1);
/// An address is claimed within this, or somebody has it, s.
const CLAIM_S: f64 = 3.0;
/// An answer begins within this (SAE J1939-21, 5.12.3), s.
const ANSWER_S: f64 = 1.5;
/// A long answer is over within this, s.
const LONG_S: f64 = 30.0;
/// Frames that are taken before the node does anything else.
const AT_ONCE: usize = 10_000;

/// An answer to a request.
pub(super) enum Heard<'a> {
    /// The group that was asked for.
    Message {
        /// Who sent it.
        sa: u8,
        /// Its content.
        bytes: &'a [u8],
    },
    /// An acknowledgment.
    Refused {
        /// Who sent it.
        sa: u8,
        /// What it says.
        answer: Answer,
    },
}

/// A node on a bus.
pub(super) struct Station<B> {
    start: Instant,
    /// Time since 1970 at the start: logs have that.
    epoch: Duration,
    bus: B,
    claim: AddressClaim,
    transport: Box<Transport<4, 1785>>,
}

impl<B: Bus> Station<B> {
    #[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
    pub(super) fn new(bus: B, claim: AddressClaim) -> Self {
        let epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let transport = Box::new(Transport::new(u8::MAX));
        Self { start: Instant::now(), epoch, bus, claim, transport }
    }

    /// Time since the start, s.
    pub(super) fn elapsed_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn now(&self) -> Time {
        let nanos = (self.epoch + self.start.elapsed()).as_nanos();
        Time(i64::try_from(nanos).unwrap_or(i64::MAX))
    }

    /// Waits a moment and takes what has come.
    #[expect(clippy::disallowed_methods, reason = "the shell waits")]
    pub(super) fn listen(&mut self) -> Result<Vec<Stamped<Frame>>, Failure> {
        std::thread::sleep(PAUSE);
        let mut frames = Vec::new();
        while frames.len() < AT_ONCE
            && let Some(heard) = self.bus.receive(self.now()).map_err(Failure::input)?
        {
            frames.push(heard);
        }
        Ok(frames)
    }

    /// One round of the node.
    pub(super) fn step(&mut self, mut on: impl FnMut(&Frame)) -> Result<(), Failure> {
        for heard in self.listen()? {
            self.claim.on_frame(heard.time, &heard.value);
            self.transport.on_frame(heard.time, &heard.value);
            on(&heard.value);
        }
        let now = self.now();
        self.claim.poll(now, &mut self.bus).map_err(Failure::input)?;
        self.transport.set_address(self.claim.address());
        self.transport.poll(now, &mut self.bus).map_err(Failure::input)
    }

    /// Waits for the address.
    pub(super) fn claimed(&mut self) -> Result<u8, Failure> {
        let until_s = self.elapsed_s() + CLAIM_S;
        loop {
            if let Some(address) = self.claim.address() {
                return Ok(address);
            }
            if self.claim.state() == ClaimState::Lost {
                return Err(Failure::input("the address is another's, with a smaller NAME"));
            }
            if self.elapsed_s() > until_s {
                return Err(Failure::Work("the claim could not be sent".to_owned()));
            }
            self.step(|_| {})?;
        }
    }

    /// Sends a message and waits for its end.
    pub(super) fn send(
        &mut self,
        priority: u8,
        pgn: u32,
        da: u8,
        bytes: &[u8],
    ) -> Result<(), Failure> {
        self.transport.send(self.now(), priority, pgn, da, bytes).map_err(input)?;
        let until_s = self.elapsed_s() + LONG_S;
        while self.elapsed_s() < until_s {
            self.step(|_| {})?;
            while let Some(event) = self.transport.event() {
                match event {
                    // the last packet is with the bus, not yet on it
                    TpEvent::Sent { .. } => return self.step(|_| {}),
                    TpEvent::Failed { reason, by_peer, .. } => {
                        let who = if by_peer { "the receiver" } else { "this node" };
                        let why = format!("PGN {pgn} to {da:#04X}: {who} gave up: {reason}");
                        return Err(Failure::Work(why));
                    }
                    TpEvent::Received(_) => {}
                }
            }
        }
        Err(Failure::Work(format!("PGN {pgn} to {da:#04X} did not end")))
    }

    /// Asks for a group and hands over every answer until there can be no more.
    pub(super) fn ask(
        &mut self,
        pgn: u32,
        da: u8,
        mut on: impl FnMut(Heard<'_>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let sa = self.claimed()?;
        let request = Request { pgn, da, sa }.frame().map_err(input)?;
        self.bus.send(self.now(), &request).map_err(Failure::input)?;
        let start_s = self.elapsed_s();
        let asked = |from: u8| da == GLOBAL_ADDRESS || from == da;
        loop {
            let mut answers = 0;
            let mut frames = Vec::new();
            self.step(|frame| frames.push(*frame))?;
            for frame in frames.iter().filter(|f| asked(f.id().sa())) {
                let from = frame.id().sa();
                let refused = Acknowledgment::of(frame).filter(|a| a.pgn == pgn && a.address == sa);
                if let Some(refused) = refused {
                    on(Heard::Refused { sa: from, answer: refused.answer })?;
                    answers += 1;
                } else if frame.id().pgn() == pgn {
                    on(Heard::Message { sa: from, bytes: frame.bytes() })?;
                    answers += 1;
                }
            }
            while let Some(event) = self.transport.event() {
                if let TpEvent::Received(message) = event
                    && message.pgn == pgn
                    && asked(message.sa)
                {
                    on(Heard::Message { sa: message.sa, bytes: message.bytes })?;
                    answers += 1;
                }
            }
            let elapsed_s = self.elapsed_s() - start_s;
            let answered = answers > 0 && da != GLOBAL_ADDRESS;
            let quiet = elapsed_s > ANSWER_S && self.transport.sessions() == 0;
            if answered || quiet || elapsed_s > LONG_S {
                return Ok(());
            }
        }
    }
}

fn input(error: J1939Error) -> Failure {
    Failure::input(error)
}
