//! Signals of the truck's maker: a DBC file of the user says where in which message they lie and in
//! what unit they are.
//!
//! A signal fills a column when the user says so, when it has the column's name, or when the
//! attribute `SPN` gives it the number that J1939-71 gives to what the column holds.

mod bits;
mod unit;

use std::collections::BTreeSet;
use std::path::Path;

use can_dbc::{AttributeValue, Message, MessageId, MultiplexIndicator, NumericValue, Signal};
use j1939::{Id, MessageTable};

use super::signals::{Candidate, Read, Silence, What};
use crate::{Channel, DiagnosisError};
use bits::Bits;

/// Longest DBC that is read, bytes: those of whole trucks have 2 MB.
const MOST_BYTES: u64 = 64 << 20;
/// Source address of a message that comes from anybody (the null address, J1939-81).
const ANYBODY: u8 = 0xFE;
/// Numbers of J1939-71 and the column that holds the same.
const NUMBERS: [(i64, Channel); 15] = [
    (84, Channel::SpeedMS),
    (91, Channel::AcceleratorPedalFrac),
    (108, Channel::BaroPressurePa),
    (110, Channel::CoolantTempDegc),
    (171, Channel::AmbientTempDegc),
    (183, Channel::FuelRateGS),
    (190, Channel::EngineSpeedRpm),
    (513, Channel::EngineTorquePercent),
    (517, Channel::GpsSpeedMS),
    (523, Channel::Gear),
    (580, Channel::GpsAltitudeM),
    (1807, Channel::SteeringWheelRad),
    (1808, Channel::YawRateRadS),
    (1809, Channel::AccelYMS2),
    (1810, Channel::AccelXMS2),
];

/// A signal that the user names for a column.
#[derive(Debug, Clone, PartialEq)]
pub struct Assigned {
    column: Channel,
    /// Message, if named, and signal.
    message: Option<String>,
    signal: String,
    /// The maker counts the other way round.
    is_reversed: bool,
}

impl core::str::FromStr for Assigned {
    type Err = String;

    /// `COLUMN=SIGNAL`, `COLUMN=MESSAGE.SIGNAL`; a `-` before the name turns the sign.
    fn from_str(text: &str) -> Result<Self, String> {
        let (column, signal) = text
            .split_once('=')
            .ok_or_else(|| format!("{text}: COLUMN=SIGNAL or COLUMN=MESSAGE.SIGNAL"))?;
        let column =
            Channel::of(column).filter(|c| !super::COMPUTED.contains(c)).ok_or_else(|| {
                let filled = Channel::all().filter(|c| !super::COMPUTED.contains(c));
                let names: Vec<&str> = filled.map(Channel::name).collect();
                format!("{column} is no column that a log fills; there are {}", names.join(", "))
            })?;
        let (signal, is_reversed) = match signal.strip_prefix('-') {
            Some(signal) => (signal, true),
            None => (signal, false),
        };
        let (message, signal) = match signal.split_once('.') {
            Some((message, signal)) => (Some(message.to_owned()), signal),
            None => (None, signal),
        };
        if signal.is_empty() {
            return Err(format!("{text}: no signal after the ="));
        }
        Ok(Self { column, message, signal: signal.to_owned(), is_reversed })
    }
}

/// Signals out of a DBC that fill columns.
#[derive(Debug, Clone)]
pub struct Dbc {
    named: Vec<Candidate>,
    by_number: Vec<Candidate>,
}

/// Where a signal lies and what it counts.
#[derive(Debug, Clone)]
pub(super) struct DbcSignal {
    bits: Bits,
    /// The switch and its value with which the signal is there.
    only_if: Option<(Bits, u64)>,
    /// Value of the DBC's unit from what the bits say.
    factor: f64,
    offset: f64,
    /// In the DBC's unit; none: any but all ones.
    range: Option<[f64; 2]>,
    /// The column's unit from the DBC's.
    to_column: unit::Conversion,
    plausible: (f64, f64),
}

impl DbcSignal {
    /// The value in the column's unit; none where the message has no number for it: all ones, out of
    /// the DBC's range or of what the column can hold.
    pub(super) fn value(&self, bytes: &[u8]) -> Option<f64> {
        if let Some((switch, value)) = self.only_if
            && switch.raw(bytes)? != value
        {
            return None;
        }
        let raw = self.bits.raw(bytes)?;
        if self.range.is_none() && self.bits.is_all_ones(raw) {
            return None;
        }
        let value = self.factor * self.bits.number(raw) + self.offset;
        if self.range.is_some_and(|[least, most]| !(least <= value && value <= most)) {
            return None;
        }
        let value = self.to_column.of(value);
        let (least, most) = self.plausible;
        (least <= value && value <= most).then_some(value)
    }
}

/// What can be wrong with a DBC is said with the file's name.
struct File<'a> {
    path: &'a Path,
    messages: &'a [Message],
}

impl Dbc {
    /// Reads a file and finds the signals that fill columns.
    ///
    /// # Errors
    /// [`DiagnosisError::Io`], [`DiagnosisError::Dbc`]: a file that is no DBC, a signal that is not
    /// there or there twice, overlaps another, has an 11-bit identifier or a unit that is not one of
    /// the column's; no signal for any column.
    pub fn read(path: &Path, assigned: &[Assigned]) -> Result<Self, DiagnosisError> {
        let io =
            |e: std::io::Error| DiagnosisError::Io { path: path.to_owned(), why: e.to_string() };
        let bad = |why: String| DiagnosisError::Dbc { path: path.to_owned(), why };
        if std::fs::metadata(path).map_err(io)?.len() > MOST_BYTES {
            return Err(bad(format!("longer than {} MB", MOST_BYTES >> 20)));
        }
        let bytes = std::fs::read(path).map_err(io)?;
        // what is no UTF-8 is Latin-1, whose bytes are the first characters of Unicode
        let text = String::from_utf8(bytes)
            .unwrap_or_else(|e| e.into_bytes().into_iter().map(char::from).collect());
        let dbc = can_dbc::Dbc::try_from(text.as_str())
            .map_err(|e| bad(format!("no DBC: {}", first_line(&e.to_string()))))?;
        let file = File { path, messages: &dbc.messages };
        let mut found = Self { named: Vec::new(), by_number: Vec::new() };
        for wanted in assigned {
            let (message, signal) = file.one(wanted)?;
            found.named.push(file.candidate(wanted.column, message, signal, wanted.is_reversed)?);
        }
        for message in &dbc.messages {
            for signal in &message.signals {
                let taken = |c: Channel| assigned.iter().any(|a| a.column == c);
                let column = Channel::of(&signal.name).filter(|c| !super::COMPUTED.contains(c));
                if let Some(column) = column.filter(|c| !taken(*c)) {
                    found.named.push(file.candidate(column, message, signal, false)?);
                }
            }
        }
        let by_spn = dbc.attribute_values_signal.iter().filter(|a| a.name == "SPN");
        for attribute in by_spn {
            let number = number_of(&attribute.value);
            let column = NUMBERS.iter().find(|(spn, _)| Some(*spn) == number).map(|(_, c)| *c);
            let message = dbc.messages.iter().find(|m| m.id == attribute.message_id);
            let (Some(column), Some(message)) = (column, message) else { continue };
            let signal = message.signals.iter().find(|s| s.name == attribute.signal_name);
            let Some(signal) = signal else { continue };
            // of the standard's messages there is a table
            let known = matches!(message.id, MessageId::Extended(raw)
                if MessageTable::of(Id::from_raw(raw).pgn()).is_some());
            if !known {
                found.by_number.push(file.candidate(column, message, signal, false)?);
            }
        }
        if found.named.is_empty() && found.by_number.is_empty() {
            return Err(bad(
                "no signal of it fills a column: none was named (COLUMN=SIGNAL), none has a \
                 column's name, and none outside the standard's messages has the SPN of one"
                    .to_owned(),
            ));
        }
        Ok(found)
    }

    /// What fills columns before the standard's messages, and after them.
    pub(super) fn candidates(&self) -> (Vec<Candidate>, Vec<Candidate>) {
        (self.named.clone(), self.by_number.clone())
    }
}

fn number_of(value: &AttributeValue) -> Option<i64> {
    match value {
        AttributeValue::Uint(n) => i64::try_from(*n).ok(),
        AttributeValue::Int(n) => Some(*n),
        AttributeValue::Double(x) => (x.fract() == 0.0).then_some(*x as i64),
        AttributeValue::String(_) => None,
    }
}

/// The parser draws the place over several lines.
fn first_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

impl File<'_> {
    fn bad(&self, why: String) -> DiagnosisError {
        DiagnosisError::Dbc { path: self.path.to_owned(), why }
    }

    /// The one signal that a name means.
    fn one(&self, wanted: &Assigned) -> Result<(&Message, &Signal), DiagnosisError> {
        let mut found = Vec::new();
        for message in self.messages {
            if wanted.message.as_ref().is_none_or(|name| *name == message.name) {
                let signals = message.signals.iter().filter(|s| s.name == wanted.signal);
                found.extend(signals.map(|s| (message, s)));
            }
        }
        let name = match &wanted.message {
            Some(message) => format!("{message}.{}", wanted.signal),
            None => wanted.signal.clone(),
        };
        let column = wanted.column.name();
        match found[..] {
            [one] => Ok(one),
            [] => Err(self.bad(format!("{column}: no signal {name}"))),
            _ => {
                let messages: Vec<&str> = found.iter().map(|(m, _)| m.name.as_str()).collect();
                let messages = messages.join(", ");
                Err(self
                    .bad(format!("{column}: {name} is in {messages}; say which as MESSAGE.SIGNAL")))
            }
        }
    }

    /// A signal as a source of a column.
    fn candidate(
        &self,
        column: Channel,
        message: &Message,
        signal: &Signal,
        is_reversed: bool,
    ) -> Result<Candidate, DiagnosisError> {
        let name = format!("{}.{}", message.name, signal.name);
        let MessageId::Extended(raw) = message.id else {
            let why = "its message has an 11-bit identifier, J1939's have 29 bits";
            return Err(self.bad(format!("{name}: {why}")));
        };
        self.overlap(message)?;
        let to_column = unit::conversion(column, &signal.unit).map_err(|known| {
            let unit = &signal.unit;
            self.bad(format!("{name}: unit {unit:?} is none of {}: {known}", column.name()))
        })?;
        let to_column = if is_reversed { to_column.reversed() } else { to_column };
        let bits = |s: &Signal| {
            Bits::of(s).ok_or_else(|| {
                self.bad(format!("{}.{}: {} bits are no number", message.name, s.name, s.size))
            })
        };
        let only_if = match signal.multiplexer_indicator {
            MultiplexIndicator::MultiplexedSignal(value) => {
                let is_switch =
                    |s: &&Signal| s.multiplexer_indicator == MultiplexIndicator::Multiplexor;
                let switch = message.signals.iter().find(is_switch);
                let switch = switch.ok_or_else(|| self.bad(format!("{name}: no switch for it")))?;
                Some((bits(switch)?, value))
            }
            MultiplexIndicator::MultiplexorAndMultiplexedSignal(_) => {
                return Err(self.bad(format!("{name}: a switch behind a switch is not read")));
            }
            MultiplexIndicator::Plain | MultiplexIndicator::Multiplexor => None,
        };
        if !(signal.factor.is_finite() && signal.factor != 0.0 && signal.offset.is_finite()) {
            return Err(self.bad(format!("{name}: factor {}", signal.factor)));
        }
        let [least, most] = [&signal.min, &signal.max].map(number);
        let id = Id::from_raw(raw);
        Ok(Candidate {
            what: What::Column(column),
            pgn: id.pgn(),
            signal: name.into(),
            only: if id.sa() == ANYBODY { Vec::new() } else { vec![id.sa()] },
            silence: Silence::Unknown,
            is_volume: to_column.is_volume,
            read: Read::Dbc(Box::new(DbcSignal {
                bits: bits(signal)?,
                only_if,
                factor: signal.factor,
                offset: signal.offset,
                range: (least < most).then_some([least, most]),
                plausible: to_column.plausible(column),
                to_column,
            })),
        })
    }

    /// Refuses a message of which two signals share a bit at the same time.
    fn overlap(&self, message: &Message) -> Result<(), DiagnosisError> {
        let places = |s: &Signal| -> BTreeSet<u64> {
            Bits::of(s).map(|b| b.places().collect()).unwrap_or_default()
        };
        let signals = &message.signals;
        for (k, a) in signals.iter().enumerate() {
            let at = places(a);
            for b in signals.iter().skip(k + 1) {
                use MultiplexIndicator::MultiplexedSignal as When;
                let apart = matches!(
                    (a.multiplexer_indicator, b.multiplexer_indicator),
                    (When(x), When(y)) if x != y
                );
                if let Some(bit) = places(b).intersection(&at).next().filter(|_| !apart) {
                    let (m, a, b) = (&message.name, &a.name, &b.name);
                    return Err(self.bad(format!("{m}: {a} and {b} overlap at bit {bit}")));
                }
            }
        }
        Ok(())
    }
}

fn number(value: &NumericValue) -> f64 {
    match value {
        NumericValue::Uint(n) => *n as f64,
        NumericValue::Int(n) => *n as f64,
        NumericValue::Double(x) => *x,
    }
}
