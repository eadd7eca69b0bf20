//! Two steps of a stack, number by number.

use recording::GivenStep;
use serde::Serialize;
use tractrix_core::{
    Command, EgoState, Recorder, SafetySignal, Stamped, Step, Tick, VehicleFault, VehicleStatus,
};

/// Where a drive first was another.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Difference {
    /// Number of the tick, from 0.
    pub(crate) tick: u64,
    /// Its time, s.
    pub(crate) time_s: f64,
    /// What differs.
    pub(crate) field: String,
    pub(crate) recorded: String,
    pub(crate) replayed: String,
}

/// Compares every step with the recorded one.
#[derive(Debug, Default)]
pub(crate) struct Comparison {
    pub(crate) ticks: u64,
    pub(crate) differing: u64,
    pub(crate) first: Option<Difference>,
    expected: Option<GivenStep>,
    /// This tick is counted.
    noted: bool,
}

/// A value that is equal bit for bit or not at all.
#[derive(Debug, Clone, PartialEq)]
enum Exact {
    Number(u64),
    Word(String),
}

impl Exact {
    fn text(&self) -> String {
        match self {
            Self::Number(bits) => format!("{:?}", f64::from_bits(*bits)),
            Self::Word(word) => word.clone(),
        }
    }
}

fn number(value: f64) -> Exact {
    Exact::Number(value.to_bits())
}

fn word(value: impl std::fmt::Debug) -> Exact {
    Exact::Word(format!("{value:?}"))
}

type Fields = Vec<(String, Exact)>;

impl Comparison {
    /// The step that the next one is compared with.
    pub(crate) fn expect(&mut self, step: GivenStep) {
        self.expected = Some(step);
    }

    /// Notes what differs in the step that was compared last.
    pub(crate) fn note(&mut self, at: &GivenStep, field: &str, recorded: &str, replayed: &str) {
        self.differing += u64::from(!std::mem::replace(&mut self.noted, true));
        self.first.get_or_insert_with(|| Difference {
            tick: self.ticks.saturating_sub(1),
            time_s: at.now.seconds(),
            field: field.to_owned(),
            recorded: recorded.to_owned(),
            replayed: replayed.to_owned(),
        });
    }
}

impl Recorder for Comparison {
    fn record(&mut self, _tick: &Tick<'_>) {}

    fn step(&mut self, step: &Step<'_>) {
        let Some(expected) = self.expected.take() else { return };
        self.ticks += 1;
        self.noted = false;
        let same = step.ego.copied().map(bits) == expected.ego.map(bits)
            && *step.status == expected.status
            && command_bits(step.command) == command_bits(&expected.command);
        if same {
            return;
        }
        let recorded = fields(expected.ego.as_ref(), &expected.status, &expected.command);
        let replayed = fields(step.ego, step.status, step.command);
        let differs = |(a, b): &(&(String, Exact), &(String, Exact))| a != b;
        // None: only an age that is no number differs from itself
        if let Some((a, b)) = recorded.iter().zip(&replayed).find(differs) {
            self.note(&expected, &a.0, &a.1.text(), &b.1.text());
        }
    }
}

fn bits(ego: Stamped<EgoState>) -> (i64, Vec<u64>, u8, bool) {
    let numbers = ego.value.numbers().map(|(_, value)| value.to_bits()).to_vec();
    let p = &ego.value.powertrain;
    (ego.time.0, numbers, p.gear, p.shift_in_progress)
}

fn command_bits(c: &Command) -> ([u64; 4], tractrix_core::BrakeMode, tractrix_core::GearRequest) {
    (c.numbers().map(|(_, value)| value.to_bits()), c.brake_mode, c.gear)
}

/// All that is compared, in the order in which it came to be.
fn fields(ego: Option<&Stamped<EgoState>>, status: &VehicleStatus, command: &Command) -> Fields {
    let mut out = vec![("ego".to_owned(), word(ego.map(|_| "read").unwrap_or("not read")))];
    let mut put = |name: String, value: Exact| out.push((name, value));
    let at = ego.copied().unwrap_or_default();
    put("ego time_ns".to_owned(), word(at.time.0));
    for (name, value) in at.value.numbers() {
        put(format!("ego {name}"), number(value));
    }
    put("ego gear".to_owned(), word(at.value.powertrain.gear));
    put("ego shift_in_progress".to_owned(), word(at.value.powertrain.shift_in_progress));
    for fault in VehicleFault::ALL {
        put(format!("status {fault:?}, since"), word(status.since(fault).map(|t| t.0)));
    }
    for signal in SafetySignal::ALL {
        let age = status.age_s(signal).map(f64::to_bits);
        put(format!("status age of {signal:?}"), age.map_or(word("none"), Exact::Number));
    }
    for (name, value) in command.numbers() {
        put(format!("command {name}"), number(value));
    }
    put("command brake_mode".to_owned(), word(command.brake_mode));
    put("command gear".to_owned(), word(command.gear));
    out
}
