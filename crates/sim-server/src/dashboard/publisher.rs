//! The world's side of the dashboard.

use std::sync::Arc;
use std::time::Duration;

use planner::decider::DeciderKind;
use road::Road;
use sim::{Scenario, World};
use tractrix_core::Tick;

use super::Shared;
use super::ahead::SpeedAhead;
use super::encoder::{About, Encoder, Moment};
use super::events::{Found, Watcher, What};
use super::frame::{Refused, Snapshot};
use super::strip::RowsDue;
use crate::provenance::Provenance;
use crate::session::{Pace, RunState, Settings};

/// Keeps what viewers are to see of a tick, and hands it to the [`Encoder`] when a frame is due; lives
/// in the world's thread. A tick that brings no event and no row takes no lock that viewers share.
pub(crate) struct Publisher {
    shared: Arc<Shared>,
    encoder: Encoder,
    snapshot: Option<Snapshot>,
    watcher: Watcher,
    /// Events on their way to the log.
    found: Found,
    rows: RowsDue,
    /// Wall and simulated seconds of an earlier frame, for the factor.
    mark: (f64, f64),
    realtime_factor: f64,
}

/// The real-time factor is measured over this wall time, s.
const FACTOR_WINDOW_S: f64 = 0.5;

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
        let scenario = scenario.name.clone();
        let about = About { shared: Arc::clone(&shared), provenance, run_id, scenario, road };
        Self {
            shared,
            encoder: Encoder::start(about),
            snapshot: None,
            watcher: Watcher::default(),
            found: Found::new(),
            rows: RowsDue::default(),
            mark: (0.0, 0.0),
            realtime_factor: 0.0,
        }
    }

    /// Keeps what is to be seen of a tick.
    pub(crate) fn show(&mut self, tick: &Tick<'_>) {
        self.watcher.tick(tick, &mut self.found);
        tell(&mut self.found, &self.shared);
        let kept = self.snapshot.get_or_insert_default();
        kept.now = tick.now;
        kept.ego = *tick.ego;
        kept.plan.clone_from(tick.plan);
        kept.scene.clone_from(tick.scene);
        if let Some(refusal) = tick.plan.refusal {
            let (reason, time_s) = (tick.plan.reason, tick.now.seconds());
            kept.last_refusal = Some(Refused { refusal, reason, time_s });
        }
        if self.rows.take(tick) {
            self.shared.strip().push(tick);
        }
    }

    /// Counts what a tick adds to the figures.
    pub(crate) fn count(&self, tick: &Tick<'_>) {
        self.shared.metrics.guard_ticks.inc_by((!tick.plan.guard.is_empty()).into());
    }

    /// Publishes the last tick with the run's state.
    pub(crate) fn publish(&mut self, state: RunState, pace: Pace, wall: Duration, world: &World) {
        let Some(tick) = &self.snapshot else { return };
        let (wall_s, time_s) = (wall.as_secs_f64(), tick.now.seconds());
        if wall_s - self.mark.0 >= FACTOR_WINDOW_S {
            self.realtime_factor = (time_s - self.mark.1) / (wall_s - self.mark.0);
            self.mark = (wall_s, time_s);
        }
        self.shared.metrics.realtime_factor.set(self.realtime_factor);
        self.note_health(world);
        let (summary, settings) = (world.summary(), Settings::of(world));
        self.watcher.run(time_s, state, &summary, &mut self.found);
        self.watcher.settings(time_s, settings.clone(), &mut self.found);
        // Before the frame, which wakes the viewers: no other one may follow it
        tell(&mut self.found, &self.shared);
        let config = world.stack().config();
        self.encoder.hand_over(Box::new(Moment {
            tick: tick.clone(),
            state,
            pace,
            realtime_factor: self.realtime_factor,
            external_decider: config.decider == DeciderKind::External,
            set_speed_m_s: config.set_speed_m_s,
            off_road: world.is_off_road(),
            front_m: world.geometry().front_m,
            settings,
            summary,
            ghost: world.ghost(),
            speed_ahead: SpeedAhead::of(&tick.plan, world.stack().speed_plan(), tick.ego.s_m),
        }));
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

    /// Replaces the summary under way by the final one, behind the last frame.
    pub(crate) fn publish_summary(&mut self, summary_json: &str) {
        self.encoder.end();
        *self.shared.summary() = summary_json.into();
    }
}

/// Puts what was found into the log, which is left alone where nothing was.
fn tell(found: &mut Found, shared: &Shared) {
    if found.is_empty() {
        return;
    }
    let mut log = shared.events();
    for (time_s, what) in found.drain(..) {
        log.add(time_s, what);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::super::Metrics;
    use tractrix_core::Recorder;

    use super::*;
    use crate::session;

    impl Recorder for Publisher {
        fn record(&mut self, tick: &Tick<'_>) {
            self.show(tick);
        }
    }

    fn shared(scenario: &Scenario, world: &World) -> Arc<Shared> {
        let (handle, _) = session::channel(scenario, 1, None);
        let (id, stop) = ("s".into(), Arc::new(AtomicBool::new(false)));
        Shared::new(&id, session::setting(world), handle, &Metrics::new(), stop)
    }

    /// A viewer that woke up with the last frame missed the event that belonged to it. While the log
    /// is held here, an event that is told first holds its frame back too.
    #[test]
    fn an_event_is_told_before_its_frame_and_the_last_frame_is_seen() {
        let scenario = Scenario::builtin("flat").unwrap();
        let mut world = World::new(&scenario, 1).unwrap();
        let shared = shared(&scenario, &world);
        let (frames, run_id) = (shared.frame.subscribe(), "run".to_owned());
        let (provenance, road) = (Provenance::of_seed(1), Arc::clone(world.road()));
        let of = Arc::clone(&shared);
        let mut publisher = Publisher::new(of, provenance, run_id, &scenario, road);
        world.tick(&mut publisher).unwrap();
        std::thread::scope(|threads| {
            let log = shared.events();
            let publishing = threads.spawn(|| {
                publisher.publish(RunState::Finished, Pace::Max, Duration::ZERO, &world);
            });
            #[expect(clippy::disallowed_methods, reason = "the thread has to get so far")]
            std::thread::sleep(Duration::from_millis(300));
            assert!(!frames.has_changed().unwrap(), "a frame before its event");
            drop(log);
            publishing.join().unwrap();
        });
        publisher.publish_summary("the final one");
        assert!(frames.borrow().is_last);
        let events = serde_json::to_value(shared.events().since(0).0).unwrap();
        assert!(events.as_array().unwrap().iter().any(|event| event["state"] == "finished"));
        assert_eq!(&**shared.summary(), "the final one");
        assert_eq!(shared.frames_since(0).0.len(), 1);
    }
}
