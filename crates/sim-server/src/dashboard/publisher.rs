//! The world's side of the dashboard.

use std::sync::Arc;
use std::time::Duration;

use planner::decider::DeciderKind;
use road::Road;
use serde::Serialize;
use sim::{GhostReport, Scenario, Summary, World};
use tractrix_core::{Recorder, Tick};

use super::Shared;
use super::ahead::{Lead, SpeedAhead};
use super::events::{Watcher, What};
use super::frame::{Ego, Frame, GhostHere, Here, Other, Planned, Refused, Run, Snapshot};
use super::settings::Settings;
use super::strip::round;
use crate::provenance::Provenance;
use crate::session::{Pace, RunState};

/// Turns ticks into frames; lives in the world's thread.
pub(crate) struct Publisher {
    shared: Arc<Shared>,
    provenance: Provenance,
    run_id: String,
    scenario: String,
    road: Arc<Road>,
    snapshot: Option<Snapshot>,
    watcher: Watcher,
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
    saving_frac: Option<f64>,
    ghost: Option<GhostReport>,
}

impl Publisher {
    /// A publisher of one run.
    pub(crate) fn new(
        shared: Arc<Shared>,
        provenance: Provenance,
        run_id: String,
        scenario: &Scenario,
        road: Arc<Road>,
    ) -> Self {
        let seed = provenance.seed();
        shared.events().add(0.0, What::RunBegan { run_id: run_id.clone(), seed });
        Self {
            shared,
            provenance,
            run_id,
            scenario: scenario.name.clone(),
            road,
            snapshot: None,
            watcher: Watcher::default(),
            mark: (0.0, 0.0),
            realtime_factor: 0.0,
        }
    }

    /// Publishes the last tick with the run's state.
    pub(crate) fn publish(&mut self, state: RunState, pace: Pace, wall: Duration, world: &World) {
        let Some(tick) = &self.snapshot else { return };
        let (wall_s, time_s) = (wall.as_secs_f64(), tick.now.seconds());
        if wall_s - self.mark.0 >= FACTOR_WINDOW_S {
            self.realtime_factor = (time_s - self.mark.1) / (wall_s - self.mark.0);
            self.mark = (wall_s, time_s);
        }
        self.note_health(world);
        let (summary, ghost, settings) = (world.summary(), world.ghost(), Settings::of(world));
        let frame = Frame {
            provenance: self.provenance,
            kind: "frame",
            run_id: &self.run_id,
            time_s,
            run: Run {
                scenario: &self.scenario,
                state,
                external_decider: world.stack().config().decider == DeciderKind::External,
                settings: settings.clone(),
                pace,
                realtime_factor: round(self.realtime_factor, 100.0),
                distance_m: round(summary.distance_m, 10.0),
                mean_speed_m_s: round(summary.mean_speed_m_s, 1e3),
                lane_changes: summary.lane_changes,
                collisions: summary.collisions,
                guard_activations: summary.guard_activations,
                off_road: world.is_off_road(),
                off_road_events: summary.off_road_events,
                off_road_time_s: round(summary.off_road_time_s, 100.0),
                max_lateral_error_m: round(summary.max_lateral_error_m, 1e4),
                min_time_to_collision_s: summary.min_time_to_collision_s.map(|t| round(t, 100.0)),
                set_speed_m_s: round(world.stack().config().set_speed_m_s, 1e2),
                last_refusal: tick.last_refusal,
            },
            ego: Ego::from(&tick.ego),
            road: Here::new(&self.road, &tick.ego, tick.plan.lane),
            plan: Planned::from(&tick.plan),
            lead: Lead::of(&tick.plan, &tick.ego, &tick.scene, world.geometry().front_m),
            speed_ahead: SpeedAhead::of(&tick.plan, world.stack().speed_plan(), tick.ego.s_m),
            ghost: ghost.map(|report| GhostHere::new(&self.road, report)),
            neighbours: tick.scene.neighbours.iter().map(Other::from).collect(),
        };
        let so_far = SummarySoFar {
            provenance: self.provenance,
            summary: &summary,
            saving_frac: ghost.and_then(|ghost| ghost.saving_frac),
            ghost,
        };
        if let (Ok(frame), Ok(so_far)) =
            (serde_json::to_string(&frame), serde_json::to_string(&so_far))
        {
            *self.shared.summary() = so_far.into();
            self.shared.metrics.realtime_factor.set(self.realtime_factor);
            let events = &mut self.shared.events();
            self.watcher.run(time_s, state, &summary, events);
            self.watcher.settings(time_s, settings, events);
            self.shared.publish(frame.into(), state == RunState::Finished);
        }
    }

    /// What is not in order about truck, bus and commands.
    fn note_health(&self, world: &World) {
        let (handle, metrics) = (&self.shared.handle, &self.shared.metrics);
        let status = world.vehicle_status();
        let faults = i64::try_from(status.faults().count()).unwrap_or(i64::MAX);
        metrics.truck_faults.set(faults);
        metrics.waiting_commands.set(handle.waiting().into());
        let errors = handle.bus().note(world.bus(), status);
        metrics.bus_errors.set(i64::try_from(errors).unwrap_or(i64::MAX));
    }

    /// Notes how long a tick's work took.
    pub(crate) fn note_tick(&self, work: Duration, missed_deadline: bool) {
        self.shared.metrics.note_tick(work, missed_deadline);
    }

    /// Replaces the summary under way by the final one.
    pub(crate) fn publish_summary(&self, summary_json: &str) {
        *self.shared.summary() = summary_json.into();
    }
}

impl Recorder for Publisher {
    fn record(&mut self, tick: &Tick<'_>) {
        self.shared.metrics.guard_ticks.inc_by((!tick.plan.guard.is_empty()).into());
        self.watcher.tick(tick, &mut self.shared.events());
        let kept = self.snapshot.get_or_insert_default();
        kept.now = tick.now;
        kept.ego = *tick.ego;
        kept.plan.clone_from(tick.plan);
        kept.scene.clone_from(tick.scene);
        if let Some(refusal) = tick.plan.refusal {
            let (reason, time_s) = (tick.plan.reason, tick.now.seconds());
            kept.last_refusal = Some(Refused { refusal, reason, time_s });
        }
        let mut strip = self.shared.strip();
        if strip.is_due(tick) {
            strip.push(tick);
        }
    }
}
