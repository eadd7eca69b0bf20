//! What a monitoring system may ask: counts and times of the session since the program started.

use std::sync::atomic::AtomicU64;
use std::time::Duration;

use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

/// The counters, and the registry that writes them in the OpenMetrics text format.
pub(crate) struct Metrics {
    registry: Registry,
    ticks: Counter,
    tick_time_s: Histogram,
    missed_deadlines: Counter,
    pub(super) guard_ticks: Counter,
    pub(super) realtime_factor: Gauge<f64, AtomicU64>,
    pub(super) viewers: Gauge,
    pub(super) lost_frames: Counter,
}

impl Metrics {
    pub(super) fn new() -> Self {
        let mut registry = Registry::with_prefix("tractrix");
        // From 10 us to 0.33 s: a tick of 10 ms lies in the middle
        let tick_time_s = Histogram::new(exponential_buckets(1e-5, 2.0, 16));
        let ticks = Counter::default();
        registry.register("ticks", "Ticks driven", ticks.clone());
        let help = "Work of a tick, wall time";
        registry.register_with_unit("tick_time", help, Unit::Seconds, tick_time_s.clone());
        let missed_deadlines = Counter::default();
        let help = "Ticks whose work ended after the next one was due";
        registry.register("missed_deadlines", help, missed_deadlines.clone());
        let guard_ticks = Counter::default();
        registry.register("guard_ticks", "Ticks in which the guard acted", guard_ticks.clone());
        let realtime_factor = Gauge::default();
        let help = "Simulated seconds per second, lately";
        registry.register("realtime_factor", help, realtime_factor.clone());
        let viewers = Gauge::default();
        registry.register("viewers", "Viewers of /ws", viewers.clone());
        let lost_frames = Counter::default();
        let help = "Frames that viewers were too slow for";
        registry.register("lost_frames", help, lost_frames.clone());
        Self {
            registry,
            ticks,
            tick_time_s,
            missed_deadlines,
            guard_ticks,
            realtime_factor,
            viewers,
            lost_frames,
        }
    }

    /// A tick has been driven.
    pub(crate) fn note_tick(&self, work: Duration, missed_deadline: bool) {
        self.ticks.inc();
        self.tick_time_s.observe(work.as_secs_f64());
        self.missed_deadlines.inc_by(missed_deadline.into());
    }

    /// All of them as text.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail
        let _ = encode(&mut text, &self.registry);
        text
    }
}
