//! A recorder that keeps everything in memory: for tests, notebooks and batch studies.

use tractrix_core::{Command, EgoState, Maneuver, Recorder, Tick, Time};

/// One kept tick.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryRecord {
    /// Time of the tick.
    pub time: Time,
    /// Ego state.
    pub ego: EgoState,
    /// Command.
    pub command: Command,
    /// Manoeuvre.
    pub maneuver: Maneuver,
    /// Speed that the controller follows, m/s.
    pub target_speed_m_s: f64,
    /// Lateral error, m.
    pub lateral_error_m: f64,
    /// Number of vehicles in the scene.
    pub neighbours: usize,
}

/// Keeps every `every`-th tick.
#[derive(Debug, Clone)]
pub struct MemoryRecorder {
    every: u32,
    seen: u32,
    /// The kept ticks in order of time.
    pub records: Vec<MemoryRecord>,
}

impl MemoryRecorder {
    /// Keeps every `every`-th tick, at least every one.
    #[must_use]
    pub fn every(every: u32) -> Self {
        Self { every: every.max(1), seen: 0, records: Vec::new() }
    }
}

impl Recorder for MemoryRecorder {
    fn record(&mut self, tick: &Tick<'_>) {
        if self.seen.is_multiple_of(self.every) {
            self.records.push(MemoryRecord {
                time: tick.now,
                ego: *tick.ego,
                command: tick.plan.command,
                maneuver: tick.plan.maneuver,
                target_speed_m_s: tick.plan.target_speed_m_s,
                lateral_error_m: tick.plan.lateral_error_m,
                neighbours: tick.scene.neighbours.len(),
            });
        }
        self.seen = self.seen.wrapping_add(1);
    }
}
