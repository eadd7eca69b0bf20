//! What happened in a session: decisions, refusals, the guard, what must not happen.

use std::collections::VecDeque;

use serde::Serialize;
use sim::Summary;
use tractrix_core::{GuardReason, LaneChangeReason, LaneChangeRefusal, Maneuver, Plan, Tick};

use super::strip::round;
use crate::session::{RunState, Settings};

/// Events that are kept, at most; the oldest go.
const MOST: usize = 1_000;

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Event {
    /// Events before it in the session.
    number: u64,
    /// Simulation time, s.
    time_s: f64,
    #[serde(flatten)]
    what: What,
}

/// What happened.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(super) enum What {
    /// Another run.
    RunBegan { run_id: String, seed: u64 },
    /// The run goes on, stands, or is over.
    State { state: RunState },
    /// Another manoeuvre.
    Maneuver { maneuver: Maneuver, reason: Option<LaneChangeReason> },
    /// A lane change that was wished and is not driven; one event as long as it lasts.
    Refusal { refusal: LaneChangeRefusal, reason: Option<LaneChangeReason> },
    /// The guard changes commands for these reasons; none: no more.
    Guard { reasons: Vec<GuardReason> },
    /// The stack is set otherwise, or something is broken or mended.
    Settings(Settings),
    /// A wheel went off the road.
    OffRoad { events: u32 },
    /// The truck touched something.
    Collision { collisions: u32 },
}

/// Events that are not in the log yet, with their times, s.
pub(super) type Found = Vec<(f64, What)>;

/// The latest events of a session.
#[derive(Debug, Default)]
pub(super) struct EventLog {
    events: VecDeque<Event>,
    next: u64,
}

impl EventLog {
    pub(super) fn add(&mut self, time_s: f64, what: What) {
        if self.events.len() == MOST {
            self.events.pop_front();
        }
        self.events.push_back(Event { number: self.next, time_s: round(time_s, 1e3), what });
        self.next += 1;
    }

    /// Events from this number on that are still here, and the number of the next one.
    pub(super) fn since(&self, number: u64) -> (Vec<Event>, u64) {
        let first = self.next - self.events.len() as u64;
        let skipped = usize::try_from(number.saturating_sub(first)).unwrap_or(usize::MAX);
        (self.events.iter().skip(skipped).cloned().collect(), self.next)
    }
}

/// Tells events from what stays as it is.
#[derive(Debug, Default)]
pub(super) struct Watcher {
    maneuver: Maneuver,
    refusal: Option<LaneChangeRefusal>,
    /// Ticks since the last refusal: the decider asks again a few times a second.
    quiet_ticks: u32,
    guard: Vec<GuardReason>,
    off_road: u32,
    collisions: u32,
    state: Option<RunState>,
    settings: Option<Settings>,
}

/// A wish that is refused again within so many ticks is the same one.
const SAME_WISH_TICKS: u32 = 200;

impl Watcher {
    /// What a tick brought.
    pub(super) fn tick(&mut self, tick: &Tick<'_>, found: &mut Found) {
        let (plan, time_s): (&Plan, f64) = (tick.plan, tick.now.seconds());
        if plan.maneuver != self.maneuver {
            self.maneuver = plan.maneuver;
            found.push((time_s, What::Maneuver { maneuver: plan.maneuver, reason: plan.reason }));
        }
        self.quiet_ticks = self.quiet_ticks.saturating_add(1);
        if let Some(refusal) = plan.refusal {
            if self.refusal != Some(refusal) || self.quiet_ticks > SAME_WISH_TICKS {
                found.push((time_s, What::Refusal { refusal, reason: plan.reason }));
            }
            (self.refusal, self.quiet_ticks) = (Some(refusal), 0);
        }
        if plan.guard != self.guard {
            self.guard.clone_from(&plan.guard);
            found.push((time_s, What::Guard { reasons: plan.guard.clone() }));
        }
    }

    /// What is counted, and the run's state.
    pub(super) fn run(
        &mut self,
        time_s: f64,
        state: RunState,
        summary: &Summary,
        found: &mut Found,
    ) {
        if summary.off_road_events != self.off_road {
            self.off_road = summary.off_road_events;
            found.push((time_s, What::OffRoad { events: self.off_road }));
        }
        if summary.collisions != self.collisions {
            self.collisions = summary.collisions;
            found.push((time_s, What::Collision { collisions: self.collisions }));
        }
        if self.state.replace(state) != Some(state) {
            found.push((time_s, What::State { state }));
        }
    }

    /// How the run is set; how it began is no event.
    pub(super) fn settings(&mut self, time_s: f64, now: Settings, found: &mut Found) {
        let was = self.settings.replace(now.clone());
        if was.is_some_and(|was| was != now) {
            found.push((time_s, What::Settings(now)));
        }
    }
}

#[cfg(test)]
mod tests {
    use tractrix_core::{EgoState, Scene, Time};

    use super::*;

    fn tick(watcher: &mut Watcher, log: &mut EventLog, at_s: f64, plan: &Plan) {
        let (ego, scene) = (EgoState::default(), Scene::default());
        let now = Time::from_seconds(at_s);
        let mut found = Found::new();
        watcher.tick(&Tick { now, ego: &ego, scene: &scene, plan }, &mut found);
        for (time_s, what) in found {
            log.add(time_s, what);
        }
    }

    #[test]
    fn what_stays_as_it_is_is_one_event() {
        let (mut watcher, mut log) = (Watcher::default(), EventLog::default());
        let calm = Plan::default();
        let refused = Plan { refusal: Some(LaneChangeRefusal::Occupied), ..Plan::default() };
        let guarded = Plan { guard: vec![GuardReason::Stale], ..Plan::default() };
        for i in 0..50 {
            tick(
                &mut watcher,
                &mut log,
                0.01 * f64::from(i),
                if i % 10 == 0 { &refused } else { &calm },
            );
        }
        assert_eq!(log.since(0).0.len(), 1, "the same wish, asked for five times");
        for i in 50..400 {
            tick(&mut watcher, &mut log, 0.01 * f64::from(i), &calm);
        }
        tick(&mut watcher, &mut log, 4.0, &refused);
        tick(&mut watcher, &mut log, 4.01, &guarded);
        tick(&mut watcher, &mut log, 4.02, &guarded);
        tick(&mut watcher, &mut log, 4.03, &calm);
        let (events, next) = log.since(1);
        assert_eq!((events.len(), next), (3, 4));
        assert_eq!(
            events[0].what,
            What::Refusal { refusal: LaneChangeRefusal::Occupied, reason: None }
        );
        assert_eq!(events[2].what, What::Guard { reasons: Vec::new() });
    }

    #[test]
    fn old_events_go_and_numbers_stay() {
        let mut log = EventLog::default();
        for i in 0..1500 {
            log.add(f64::from(i), What::OffRoad { events: i });
        }
        let (all, next) = log.since(0);
        assert_eq!((all.len(), all[0].number, next), (1000, 500, 1500));
        assert_eq!(log.since(1499).0.len(), 1);
        assert_eq!(log.since(u64::MAX).0, []);
    }
}
