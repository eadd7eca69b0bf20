//! The door to a session: commands in, answers out, and what can be seen without asking.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use sim::{Scenario, TrafficKind, World};
use tokio::sync::{oneshot, watch};
use tractrix_core::{EgoState, Neighbour, Time};

use super::{Command, Controls, Standing};
use crate::bus_board::BusBoard;

/// Commands under way, at most.
const QUEUE: usize = 64;

/// The states of a session (those of `simulation_interfaces/msg/SimulationState`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum State {
    /// At a run's start or behind its end.
    Stopped,
    /// Driving.
    Playing,
    /// Between two ticks.
    Paused,
    /// About to end.
    Quitting,
}

/// What a viewer is told about the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RunState {
    Running,
    Paused,
    Finished,
}

/// A command that has acted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Acted {
    /// Ticks driven in this run.
    pub(crate) tick: u64,
    /// Simulation time, s.
    pub(crate) time_s: f64,
    /// The state that it left.
    pub(crate) state: State,
}

/// Why a command did not act.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Refused {
    #[error("too many commands at once")]
    TooMany,
    #[error("the run has ended")]
    Ended,
    #[error("{action} is not possible while the session is {state:?}: {needs}")]
    WrongState { action: &'static str, state: State, needs: &'static str },
    #[error("the run decides on lane changes itself; set_decider can make it external")]
    NoExternalDecider,
    #[error("{0}")]
    NoBus(String),
    #[error("the truck behind {0} cannot be put back to where it was")]
    OutsideBus(String),
    #[error("SUMO drives the traffic: its run cannot be reset or kept, nor another one begun")]
    OneSumo,
    #[error("SUMO drives the traffic of another session: there is one at a time")]
    SecondSumo,
    #[error("nothing was kept under the name {0:?}")]
    NothingKept(String),
    #[error("{MAX_KEPT} worlds are kept already; one of their names can be used again")]
    TooManyKept,
    #[error("cut short: {left} ticks were not driven")]
    CutShort { left: u64 },
    #[error("{ticks} ticks away: a step is at most {}", super::command::MAX_TICKS)]
    TooFar { ticks: u64 },
    #[error("{0}")]
    Unusable(String),
}

/// Another world in place of the present one.
pub(crate) struct Next {
    /// The world, at its start.
    pub(crate) world: World,
    /// Its seed.
    pub(crate) seed: u64,
    /// Where it begins: playing, paused or stopped.
    pub(crate) state: State,
}

/// A command and who waits for its answer.
pub(crate) struct Asked {
    pub(crate) command: Command,
    pub(crate) reply: oneshot::Sender<Result<Acted, Refused>>,
    /// It is in the queue.
    pub(super) place: InQueue,
}

/// A place in the queue of commands, until it is dropped.
pub(super) struct InQueue(Arc<AtomicU32>);

impl InQueue {
    fn take(waiting: &Arc<AtomicU32>) -> Self {
        waiting.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(waiting))
    }
}

impl Drop for InQueue {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// What comes when a command has acted.
pub(crate) type Answer = oneshot::Receiver<Result<Acted, Refused>>;

/// Waits until a command has acted.
///
/// # Errors
/// [`Refused`].
pub(crate) async fn answer(answer: Answer) -> Result<Acted, Refused> {
    answer.await.unwrap_or(Err(Refused::Ended))
}

/// The bodies of the latest tick.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bodies {
    pub(crate) time: Time,
    /// None before the first tick.
    pub(crate) ego: Option<EgoState>,
    pub(crate) others: Vec<Neighbour>,
}

/// What a session leaves for others to see.
struct View {
    scenario: Arc<Scenario>,
    seed: u64,
    bodies: Bodies,
    /// The folder of the latest run.
    folder: Option<PathBuf>,
    /// It is being written.
    is_recording: bool,
    /// Worlds as they were, with their seeds.
    kept: BTreeMap<String, (World, u64)>,
}

/// Worlds that a session keeps, at most.
const MAX_KEPT: usize = 8;

/// The door to a session.
#[derive(Clone)]
pub(crate) struct Handle {
    queue: SyncSender<Asked>,
    view: Arc<Mutex<View>>,
    standing: watch::Sender<Standing>,
    /// The bus outside that the truck is reached over: it has no way back to a start.
    outside_bus: Option<Arc<str>>,
    bus: BusBoard,
    /// Commands that wait for the end of a tick.
    waiting: Arc<AtomicU32>,
}

/// A session's door, and where its commands arrive.
pub(crate) fn channel(
    scenario: &Scenario,
    seed: u64,
    outside_bus: Option<&str>,
) -> (Handle, Receiver<Asked>) {
    let (queue, asked) = sync_channel(QUEUE);
    let scenario = Arc::new(scenario.clone());
    let (bodies, kept) = (Bodies::default(), BTreeMap::new());
    let view = View { scenario, seed, bodies, folder: None, is_recording: false, kept };
    let standing = watch::Sender::new(Standing { state: State::Stopped, controls: None });
    let outside_bus = outside_bus.map(Arc::from);
    let (view, bus, waiting) = (Arc::new(Mutex::new(view)), BusBoard::default(), Arc::default());
    (Handle { queue, view, standing, outside_bus, bus, waiting }, asked)
}

impl Handle {
    /// Sends a command; the answer comes when it has acted.
    ///
    /// # Errors
    /// [`Refused`].
    pub(crate) async fn ask(&self, command: Command) -> Result<Acted, Refused> {
        answer(self.send(command)?).await
    }

    /// Sends a command now, before those that are sent later.
    ///
    /// # Errors
    /// [`Refused`]: it is not taken.
    pub(crate) fn send(&self, command: Command) -> Result<Answer, Refused> {
        let (reply, answer) = oneshot::channel();
        let place = InQueue::take(&self.waiting);
        self.queue.try_send(Asked { command, reply, place }).map_err(|e| match e {
            TrySendError::Full(_) => Refused::TooMany,
            TrySendError::Disconnected(_) => Refused::Ended,
        })?;
        Ok(answer)
    }

    /// The command that puts the present scenario back to its start, with the same seed or another
    /// one, in the state in which it is or another one. The world is built here, by who asks: that
    /// takes its time, and one that cannot be built changes nothing.
    ///
    /// # Errors
    /// [`Refused`].
    pub(crate) fn reset(
        &self,
        seed: Option<u64>,
        state: Option<State>,
    ) -> Result<Command, Refused> {
        let (scenario, same, now) = {
            let view = self.view();
            (Arc::clone(&view.scenario), view.seed, self.state())
        };
        self.begin(&scenario, seed.unwrap_or(same), state.unwrap_or(now))
    }

    /// The command that goes on from where the world was kept, with a recording of its own.
    ///
    /// # Errors
    /// [`Refused::NothingKept`].
    pub(crate) fn restore(&self, name: &str) -> Result<Command, Refused> {
        let view = self.view();
        let kept = view.kept.get(name).ok_or_else(|| Refused::NothingKept(name.to_owned()))?;
        let (world, seed) = kept.clone();
        Ok(Command::Begin(Box::new(Next { world, seed, state: self.state() })))
    }

    /// Keeps a world.
    pub(super) fn keep(&self, name: String, world: &World) -> Result<(), Refused> {
        if let Some(bus) = &self.outside_bus {
            return Err(Refused::OutsideBus(bus.to_string()));
        }
        if world.scenario().traffic.source == TrafficKind::Sumo {
            return Err(Refused::OneSumo);
        }
        let mut view = self.view();
        if view.kept.len() >= MAX_KEPT && !view.kept.contains_key(&name) {
            return Err(Refused::TooManyKept);
        }
        let seed = view.seed;
        view.kept.insert(name, (world.clone(), seed));
        Ok(())
    }

    /// The command that begins another scenario. As [`Self::reset`].
    ///
    /// # Errors
    /// [`Refused`].
    pub(crate) fn begin(
        &self,
        scenario: &Scenario,
        seed: u64,
        state: State,
    ) -> Result<Command, Refused> {
        if let Some(bus) = &self.outside_bus {
            return Err(Refused::OutsideBus(bus.to_string()));
        }
        let is_sumo = |scenario: &Scenario| scenario.traffic.source == TrafficKind::Sumo;
        if is_sumo(scenario) || is_sumo(&self.scenario()) {
            return Err(Refused::OneSumo);
        }
        let world = World::new(scenario, seed).map_err(|e| Refused::Unusable(e.to_string()))?;
        Ok(Command::Begin(Box::new(Next { world, seed, state })))
    }

    /// Commands that wait for the end of a tick.
    pub(crate) fn waiting(&self) -> u32 {
        self.waiting.load(Ordering::Relaxed)
    }

    /// What is on the bus.
    pub(crate) const fn bus(&self) -> &BusBoard {
        &self.bus
    }

    /// The state now.
    pub(crate) fn state(&self) -> State {
        self.standing.borrow().state
    }

    /// The scenario that is driven.
    pub(crate) fn scenario(&self) -> Arc<Scenario> {
        Arc::clone(&self.view().scenario)
    }

    /// The seed of the run.
    pub(crate) fn seed(&self) -> u64 {
        self.view().seed
    }

    /// The bodies of the latest tick.
    pub(crate) fn bodies(&self) -> Bodies {
        self.view().bodies.clone()
    }

    /// State and settings now; it tells when they change.
    pub(crate) fn standing(&self) -> watch::Receiver<Standing> {
        self.standing.subscribe()
    }

    pub(crate) fn note_state(&self, state: State) {
        self.standing.send_if_modified(|now| std::mem::replace(&mut now.state, state) != state);
    }

    pub(super) fn note_controls(&self, controls: Controls) {
        self.standing.send_if_modified(|now| {
            let is_new = now.controls.as_ref() != Some(&controls);
            now.controls = Some(controls);
            is_new
        });
    }

    /// The folder of the latest run, and whether it is still being written.
    pub(crate) fn recording(&self) -> (Option<PathBuf>, bool) {
        let view = self.view();
        (view.folder.clone(), view.is_recording)
    }

    /// A run is whole on the disk.
    pub(super) fn note_written(&self) {
        self.view().is_recording = false;
    }

    pub(super) fn note_world(&self, world: &World, seed: u64, folder: &Path) {
        let mut view = self.view();
        view.folder = Some(folder.to_owned());
        view.is_recording = true;
        view.scenario = Arc::new(world.scenario().clone());
        view.seed = seed;
        view.bodies = Bodies::default();
    }

    pub(super) fn note_bodies(&self, tick: &tractrix_core::Tick<'_>) {
        let bodies = &mut self.view().bodies;
        bodies.time = tick.now;
        bodies.ego = Some(*tick.ego);
        bodies.others.clone_from(&tick.scene.neighbours);
    }

    fn view(&self) -> MutexGuard<'_, View> {
        self.view.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
