//! One control unit: its address, long messages, requests, trouble codes.

use j1939::bus::{Bus, BusError};
use j1939::dm::{DM1, Dtc, Lamps};
use j1939::{
    Acknowledgment, AddressClaim, Answer, Frame, GLOBAL_ADDRESS, J1939Error, Request, Slot,
    Transport,
};
use tractrix_core::Time;

use super::Unit;

/// DM1 is sent this often, ns (SAE J1939-73, 5.7.1).
const DM1_PERIOD: i64 = 1_000_000_000;
/// A trouble code stays active for so long after its last occurrence, ns.
const ACTIVE_FOR: i64 = 2_000_000_000;
/// Trouble codes of one unit; more are not told.
const CODES: usize = 8;
/// Default priority of DM1 and of what is sent on request.
const PRIORITY: u8 = 6;
/// Packets that a sender to this unit is cleared for at once.
const WINDOW: u8 = 16;

/// A control unit of the virtual truck.
#[derive(Debug, Clone)]
pub(super) struct ControlUnit {
    pub(super) unit: Unit,
    claim: AddressClaim,
    transport: Transport<3, 128>,
    codes: Vec<(Dtc, Time)>,
    dm1_due: Time,
    /// It says nothing any more and does nothing it is asked.
    pub(super) is_silent: bool,
}

impl ControlUnit {
    pub(super) fn new(unit: Unit, start: Time) -> Self {
        Self {
            unit,
            claim: AddressClaim::new(unit.name(), unit.address(), 0),
            transport: Transport::new(WINDOW),
            codes: Vec::new(),
            dm1_due: start.plus_nanos(DM1_PERIOD),
            is_silent: false,
        }
    }

    /// Its address, once that is claimed.
    pub(super) fn address(&self) -> Option<u8> {
        self.claim.address().filter(|_| !self.is_silent)
    }

    /// Takes a frame; a request that it must answer comes back.
    pub(super) fn hear(&mut self, now: Time, frame: &Frame) -> Option<Request> {
        if self.is_silent {
            return None;
        }
        self.claim.on_frame(now, frame);
        self.transport.on_frame(now, frame);
        // Messages to a unit have no reader here: what counts is that they are acknowledged
        while self.transport.event().is_some() {}
        let address = self.address()?;
        Request::of(frame).filter(|r| r.da == address || r.da == GLOBAL_ADDRESS)
    }

    /// Notes a fault: its code is active for a while.
    pub(super) fn note(&mut self, now: Time, spn: u32, fmi: u8) {
        let known = |(code, _): &&mut (Dtc, Time)| (code.spn, code.fmi) == (spn, fmi);
        if let Some((code, last)) = self.codes.iter_mut().find(known) {
            let is_new = now.0.saturating_sub(last.0) > ACTIVE_FOR;
            let again = code.occurrences.map(|n| n.saturating_add(u8::from(is_new)).min(126));
            (code.occurrences, *last) = (again, now);
        } else if self.codes.len() < CODES {
            let code = Dtc { spn, fmi, occurrences: Some(1), old_order: false };
            self.codes.push((code, now));
        }
    }

    /// Its active trouble codes.
    pub(super) fn active(&self, now: Time) -> Vec<Dtc> {
        let is_active = |last: &Time| now.0.saturating_sub(last.0) <= ACTIVE_FOR;
        self.codes.iter().filter(|(_, last)| is_active(last)).map(|(code, _)| *code).collect()
    }

    /// Sends a message of any length to `da`. What is under way already is not sent twice.
    pub(super) fn send_long(
        &mut self,
        now: Time,
        priority: u8,
        pgn: u32,
        da: u8,
        bytes: &[u8],
    ) -> Result<(), J1939Error> {
        match self.transport.send(now, priority, pgn, da, bytes) {
            Err(J1939Error::TransportBusy { .. } | J1939Error::NoAddress) => Ok(()),
            result => result,
        }
    }

    /// Answers a request with a message, or says to who asked it alone that there is none.
    pub(super) fn answer(
        &mut self,
        now: Time,
        request: Request,
        message: Option<&[u8]>,
        bus: &mut impl Bus,
    ) -> Result<(), EcuError> {
        let Some(sa) = self.address() else { return Ok(()) };
        let everybody = request.da == GLOBAL_ADDRESS;
        if let Some(bytes) = message {
            // What fits into a frame goes to everybody, as it does by itself
            let da = if everybody || bytes.len() <= 8 { GLOBAL_ADDRESS } else { request.sa };
            return Ok(self.send_long(now, PRIORITY, request.pgn, da, bytes)?);
        }
        if everybody {
            return Ok(());
        }
        let refusal = Acknowledgment {
            answer: Answer::Negative,
            group_function: 0xFF,
            address: request.sa,
            pgn: request.pgn,
        };
        put(now, &refusal.frame(sa), bus)
    }

    /// Sends what is due: claims, packets, trouble codes.
    pub(super) fn poll(&mut self, now: Time, bus: &mut impl Bus) -> Result<(), EcuError> {
        if self.is_silent {
            return Ok(());
        }
        self.claim.poll(now, bus)?;
        self.transport.set_address(self.claim.address());
        if now >= self.dm1_due && self.address().is_some() {
            self.dm1_due = now.plus_nanos(DM1_PERIOD);
            let codes = self.active(now);
            let mut lamps = Lamps::default();
            for lamp in [&mut lamps.malfunction, &mut lamps.red_stop, &mut lamps.protect] {
                lamp.on = Slot::Value(0);
            }
            lamps.amber_warning.on = Slot::Value(u8::from(!codes.is_empty()));
            let mut buffer = [0; 2 + 4 * CODES];
            let bytes = j1939::dm::write(DM1, &lamps, &codes, &mut buffer)?;
            self.send_long(now, PRIORITY, DM1, GLOBAL_ADDRESS, bytes)?;
        }
        Ok(self.transport.poll(now, bus)?)
    }
}

/// Sends a frame; one that the bus has no room for is lost, the next period brings a newer one.
pub(super) fn put(now: Time, frame: &Frame, bus: &mut impl Bus) -> Result<(), EcuError> {
    match bus.send(now, frame) {
        Err(BusError::Full(_)) => Ok(()),
        result => Ok(result?),
    }
}

/// Why a control unit could not go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EcuError {
    /// The bus failed.
    #[error("the virtual truck's bus: {0}")]
    Bus(#[from] BusError),
    /// A message cannot be said on the bus.
    #[error("the virtual truck: {0}")]
    Message(#[from] J1939Error),
}
