//! The world's side of the dashboard.

use std::sync::Arc;
use std::time::Duration;

use planner::decider::DeciderKind;
use road::Road;
use serde::Serialize;
use sim::{Scenario, Summary};
use tractrix_core::{Recorder, Tick};

use super::Shared;
use super::frame::{Ego, Frame, Here, Other, Planned, Run, Snapshot};
use crate::driver::{Pace, RunState};
use crate::provenance::Provenance;

/// Turns ticks into frames; lives in the world's thread.
pub(crate) struct Publisher {
    shared: Arc<Shared>,
    provenance: Provenance,
    scenario: String,
    external_decider: bool,
    road: Arc<Road>,
    snapshot: Option<Snapshot>,
    /// Wall and simulated seconds of an earlier frame, for the factor.
    mark: (f64, f64),
    realtime_factor: f64,
}

/// The real-time factor is measured over this wall time, s.
const FACTOR_WINDOW_S: f64 = 0.5;

/// The summary under way as `/api/v1/summary` answers it.
#[derive(Serialize)]
struct SummarySoFar<'a> {
    #[serde(flatten)]
    provenance: Provenance,
    #[serde(flatten)]
    summary: &'a Summary,
}

impl Publisher {
    /// A publisher of one run.
    pub(crate) fn new(
        shared: Arc<Shared>,
        provenance: Provenance,
        scenario: &Scenario,
        road: Arc<Road>,
    ) -> Self {
        Self {
            shared,
            provenance,
            scenario: scenario.name.clone(),
            external_decider: scenario.stack.decider == DeciderKind::External,
            road,
            snapshot: None,
            mark: (0.0, 0.0),
            realtime_factor: 0.0,
        }
    }

    /// Publishes the last tick with the run's state.
    pub(crate) fn publish(
        &mut self,
        state: RunState,
        pace: Pace,
        wall: Duration,
        summary: &Summary,
    ) {
        let Some(tick) = &self.snapshot else { return };
        let (wall_s, time_s) = (wall.as_secs_f64(), tick.now.seconds());
        if wall_s - self.mark.0 >= FACTOR_WINDOW_S {
            self.realtime_factor = (time_s - self.mark.1) / (wall_s - self.mark.0);
            self.mark = (wall_s, time_s);
        }
        let frame = Frame {
            provenance: self.provenance,
            kind: "frame",
            time_s,
            run: Run::new(
                (&self.scenario, self.external_decider),
                state,
                pace,
                self.realtime_factor,
                summary,
            ),
            ego: Ego::from(&tick.ego),
            road: Here::new(&self.road, &tick.ego, tick.plan.lane),
            plan: Planned::from(&tick.plan),
            neighbours: tick.scene.neighbours.iter().map(Other::from).collect(),
        };
        let so_far = SummarySoFar { provenance: self.provenance, summary };
        if let (Ok(frame), Ok(so_far)) =
            (serde_json::to_string(&frame), serde_json::to_string(&so_far))
        {
            *self.shared.summary() = so_far.into();
            self.shared.frame.send_replace(frame.into());
        }
    }

    /// Replaces the summary under way by the final one.
    pub(crate) fn publish_summary(&self, summary_json: &str) {
        *self.shared.summary() = summary_json.into();
    }
}

impl Recorder for Publisher {
    fn record(&mut self, tick: &Tick<'_>) {
        let kept = self.snapshot.get_or_insert_default();
        kept.now = tick.now;
        kept.ego = *tick.ego;
        kept.plan.clone_from(tick.plan);
        kept.scene.clone_from(tick.scene);
        let mut strip = self.shared.strip();
        if strip.is_due(tick.ego.s_m) {
            strip.push(tick);
        }
    }
}
