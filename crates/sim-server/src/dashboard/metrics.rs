//! What a monitoring system may ask: counts and times of each session since it began.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

/// Of which session a figure is.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Of {
    session: String,
}

/// The figures, and the registry that writes them in the OpenMetrics text format.
pub(crate) struct Metrics {
    registry: Registry,
    figures: Figures,
    pub(super) sessions: Gauge,
}

/// A figure of each session.
#[derive(Clone)]
struct Figures {
    ticks: Family<Of, Counter>,
    tick_time_s: Family<Of, Histogram>,
    missed_deadlines: Family<Of, Counter>,
    guard_ticks: Family<Of, Counter>,
    realtime_factor: Family<Of, Gauge<f64, AtomicU64>>,
    viewers: Family<Of, Gauge>,
    lost_frames: Family<Of, Counter>,
    waiting_commands: Family<Of, Gauge>,
    truck_faults: Family<Of, Gauge>,
    bus_errors: Family<Of, Gauge>,
}

/// The figures of one session. They go with it.
pub(crate) struct SessionMetrics {
    all: Arc<Metrics>,
    of: Of,
    ticks: Counter,
    tick_time_s: Histogram,
    missed_deadlines: Counter,
    pub(super) guard_ticks: Counter,
    pub(super) realtime_factor: Gauge<f64, AtomicU64>,
    pub(super) viewers: Gauge,
    pub(super) lost_frames: Counter,
    pub(super) waiting_commands: Gauge,
    pub(super) truck_faults: Gauge,
    pub(super) bus_errors: Gauge,
}

impl Metrics {
    pub(crate) fn new() -> Arc<Self> {
        let mut registry = Registry::with_prefix("tractrix");
        // From 10 us to 0.33 s: a tick of 10 ms lies in the middle
        let buckets = || Histogram::new(exponential_buckets(1e-5, 2.0, 16));
        let figures = Figures {
            ticks: Family::default(),
            tick_time_s: Family::new_with_constructor(buckets),
            missed_deadlines: Family::default(),
            guard_ticks: Family::default(),
            realtime_factor: Family::default(),
            viewers: Family::default(),
            lost_frames: Family::default(),
            waiting_commands: Family::default(),
            truck_faults: Family::default(),
            bus_errors: Family::default(),
        };
        let f = figures.clone();
        registry.register("ticks", "Ticks driven", f.ticks);
        let help = "Work of a tick, wall time";
        registry.register_with_unit("tick_time", help, Unit::Seconds, f.tick_time_s);
        let help = "Ticks whose work ended after the next one was due";
        registry.register("missed_deadlines", help, f.missed_deadlines);
        registry.register("guard_ticks", "Ticks in which the guard acted", f.guard_ticks);
        let help = "Simulated seconds per second, lately";
        registry.register("realtime_factor", help, f.realtime_factor);
        registry.register("viewers", "Viewers of /ws", f.viewers);
        let help = "Frames that viewers were too slow for";
        registry.register("lost_frames", help, f.lost_frames);
        let help = "Commands that wait for the end of a tick";
        registry.register("waiting_commands", help, f.waiting_commands);
        let help = "What the stack finds wrong with the truck or its bus now";
        registry.register("truck_faults", help, f.truck_faults);
        let help = "Readings and sendings of the bus that failed in this run";
        registry.register("bus_errors", help, f.bus_errors);
        let sessions = Gauge::default();
        registry.register("sessions", "Sessions", sessions.clone());
        Arc::new(Self { registry, figures, sessions })
    }

    /// The figures of a session that begins.
    pub(super) fn of_session(self: &Arc<Self>, id: &str) -> SessionMetrics {
        let of = Of { session: id.to_owned() };
        let f = &self.figures;
        SessionMetrics {
            ticks: f.ticks.get_or_create_owned(&of),
            tick_time_s: f.tick_time_s.get_or_create_owned(&of),
            missed_deadlines: f.missed_deadlines.get_or_create_owned(&of),
            guard_ticks: f.guard_ticks.get_or_create_owned(&of),
            realtime_factor: f.realtime_factor.get_or_create_owned(&of),
            viewers: f.viewers.get_or_create_owned(&of),
            lost_frames: f.lost_frames.get_or_create_owned(&of),
            waiting_commands: f.waiting_commands.get_or_create_owned(&of),
            truck_faults: f.truck_faults.get_or_create_owned(&of),
            bus_errors: f.bus_errors.get_or_create_owned(&of),
            all: Arc::clone(self),
            of,
        }
    }

    /// All of them as text.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail
        let _ = encode(&mut text, &self.registry);
        text
    }
}

impl SessionMetrics {
    /// A tick has been driven.
    pub(super) fn note_tick(&self, work: Duration, missed_deadline: bool) {
        self.ticks.inc();
        self.tick_time_s.observe(work.as_secs_f64());
        self.missed_deadlines.inc_by(missed_deadline.into());
    }
}

impl Drop for SessionMetrics {
    fn drop(&mut self) {
        let f = &self.all.figures;
        f.ticks.remove(&self.of);
        f.tick_time_s.remove(&self.of);
        f.missed_deadlines.remove(&self.of);
        f.guard_ticks.remove(&self.of);
        f.realtime_factor.remove(&self.of);
        f.viewers.remove(&self.of);
        f.lost_frames.remove(&self.of);
        f.waiting_commands.remove(&self.of);
        f.truck_faults.remove(&self.of);
        f.bus_errors.remove(&self.of);
    }
}
