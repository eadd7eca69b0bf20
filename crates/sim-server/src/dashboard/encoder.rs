//! Frames as JSON, in a thread of their own: what viewers cost is not the world's thread's.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use road::Road;
use serde::Serialize;
use sim::{GhostReport, Summary};

use super::Shared;
use super::ahead::{Lead, SpeedAhead};
use super::frame::{Ego, Frame, GhostHere, Here, Other, Planned, Run, Snapshot};
use super::strip::round;
use crate::provenance::Provenance;
use crate::session::{Pace, RunState, Settings};

/// What a frame is made of, as the world's thread leaves it.
pub(super) struct Moment {
    pub(super) tick: Snapshot,
    pub(super) state: RunState,
    pub(super) pace: Pace,
    pub(super) realtime_factor: f64,
    pub(super) external_decider: bool,
    pub(super) set_speed_m_s: f64,
    pub(super) off_road: bool,
    /// From the reference point to the front bumper, m.
    pub(super) front_m: f64,
    pub(super) settings: Settings,
    pub(super) summary: Summary,
    pub(super) ghost: Option<GhostReport>,
    pub(super) speed_ahead: SpeedAhead,
}

/// What does not change during a run.
pub(super) struct About {
    pub(super) shared: Arc<Shared>,
    pub(super) provenance: Provenance,
    pub(super) run_id: String,
    pub(super) scenario: String,
    pub(super) road: Arc<Road>,
}

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

/// The thread and its way in: the latest moment alone waits, so that the world never does.
pub(super) struct Encoder {
    latest: Arc<Mutex<Option<Box<Moment>>>>,
    /// Says that there is one.
    bell: Option<SyncSender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Encoder {
    /// Starts the thread.
    pub(super) fn start(about: About) -> Self {
        let latest = Arc::new(Mutex::new(None));
        let (bell, rung) = sync_channel(1);
        #[expect(clippy::disallowed_methods, reason = "the shell owns the viewers' threads")]
        let thread = std::thread::spawn({
            let latest = Arc::clone(&latest);
            move || encode_all(&about, &latest, &rung)
        });
        Self { latest, bell: Some(bell), thread: Some(thread) }
    }

    /// Hands a moment over; one that was not taken yet goes.
    pub(super) fn hand_over(&self, moment: Box<Moment>) {
        let before = lock(&self.latest).replace(moment);
        drop(before);
        if let Some(bell) = &self.bell {
            // One that rings already is enough, and a thread that is gone hears nothing
            let _ = bell.try_send(());
        }
    }

    /// Waits until what was handed over is seen.
    pub(super) fn end(&mut self) {
        drop(self.bell.take());
        if let Some(thread) = self.thread.take() {
            // A panic there has been said, and takes no run with it
            let _ = thread.join();
        }
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        self.end();
    }
}

fn lock(latest: &Mutex<Option<Box<Moment>>>) -> MutexGuard<'_, Option<Box<Moment>>> {
    latest.lock().unwrap_or_else(PoisonError::into_inner)
}

fn encode_all(about: &About, latest: &Mutex<Option<Box<Moment>>>, rung: &Receiver<()>) {
    while rung.recv().is_ok() {
        let moment = lock(latest).take();
        if let Some(moment) = moment {
            encode(about, &moment);
        }
    }
}

/// Makes the frame and the summary so far, and leaves them to the viewers.
fn encode(about: &About, moment: &Moment) {
    let Moment { tick, summary, ghost, .. } = moment;
    let (provenance, road, ghost) = (about.provenance, &about.road, *ghost);
    let frame = Frame {
        provenance,
        kind: "frame",
        run_id: &about.run_id,
        time_s: tick.now.seconds(),
        run: Run {
            scenario: &about.scenario,
            state: moment.state,
            external_decider: moment.external_decider,
            settings: moment.settings.clone(),
            pace: moment.pace,
            realtime_factor: round(moment.realtime_factor, 100.0),
            distance_m: round(summary.distance_m, 10.0),
            mean_speed_m_s: round(summary.mean_speed_m_s, 1e3),
            lane_changes: summary.lane_changes,
            collisions: summary.collisions,
            guard_activations: summary.guard_activations,
            off_road: moment.off_road,
            off_road_events: summary.off_road_events,
            off_road_time_s: round(summary.off_road_time_s, 100.0),
            max_lateral_error_m: round(summary.max_lateral_error_m, 1e4),
            min_time_to_collision_s: summary.min_time_to_collision_s.map(|t| round(t, 100.0)),
            set_speed_m_s: round(moment.set_speed_m_s, 1e2),
            last_refusal: tick.last_refusal,
        },
        ego: Ego::from(&tick.ego),
        road: Here::new(road, &tick.ego, tick.plan.lane),
        plan: Planned::from(&tick.plan),
        lead: Lead::of(&tick.plan, &tick.ego, &tick.scene, moment.front_m),
        speed_ahead: &moment.speed_ahead,
        ghost: ghost.map(|report| GhostHere::new(road, report)),
        neighbours: tick.scene.neighbours.iter().map(Other::from).collect(),
    };
    let so_far = SummarySoFar {
        provenance,
        summary,
        saving_frac: ghost.and_then(|ghost| ghost.saving_frac),
        ghost,
    };
    if let (Ok(frame), Ok(so_far)) = (serde_json::to_string(&frame), serde_json::to_string(&so_far))
    {
        *about.shared.summary() = so_far.into();
        about.shared.publish(frame.into(), moment.state == RunState::Finished);
    }
}
