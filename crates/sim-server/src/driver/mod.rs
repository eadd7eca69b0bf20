//! Driving a world: its thread's loop, with pacing, controls, recording and views.

mod control;
mod pace;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use recording::Recording;
use serde::Serialize;
use sim::{EndReason, Status, TickTime, TickTimes, World};
use tractrix_core::{Recorder, Step, Tick};

pub(crate) use control::{Control, ControlSender, channel};
pub(crate) use pace::Pace;

use self::pace::Pacer;
use crate::dashboard::Publisher;
use crate::failure::Failure;
use crate::progress::Progress;

/// What a viewer is told about the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum RunState {
    Running,
    Paused,
    Finished,
}

/// A run about to start.
pub(crate) struct Job {
    pub(crate) world: World,
    pub(crate) pace: Pace,
    pub(crate) recording: Recording,
    pub(crate) publisher: Option<Publisher>,
    pub(crate) controls: Receiver<Control>,
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) progress: Progress,
}

/// A run that has ended.
pub(crate) struct Ended {
    pub(crate) world: World,
    pub(crate) recording: Recording,
    pub(crate) publisher: Option<Publisher>,
    pub(crate) reason: EndReason,
    /// What failed, when something did.
    pub(crate) failure: Option<Failure>,
    pub(crate) tick_time_us: TickTime,
    pub(crate) missed_deadlines: u64,
    pub(crate) wall_time_s: f64,
}

/// Viewers get a frame this often (wall time).
const FRAME_PERIOD: Duration = Duration::from_millis(50);

/// The two consumers of a tick.
struct Sinks<'a> {
    recording: &'a mut Recording,
    publisher: Option<&'a mut Publisher>,
}

impl Recorder for Sinks<'_> {
    fn record(&mut self, tick: &Tick<'_>) {
        self.recording.record(tick);
        if let Some(publisher) = &mut self.publisher {
            publisher.record(tick);
        }
    }

    fn step(&mut self, step: &Step<'_>) {
        self.recording.step(step);
    }
}

/// Drives a world to its end, until `stop`, or until the world or the recording fails.
pub(crate) fn drive(mut job: Job) -> Ended {
    let attached = job.world.attach_ghost().map_err(Failure::work);
    Drive::new(job).run(attached.err())
}

struct Drive {
    job: Job,
    start: Instant,
    pacer: Pacer,
    times: TickTimes,
    paused: bool,
    steps: u32,
    frame_due: Duration,
}

impl Drive {
    #[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
    fn new(job: Job) -> Self {
        let tick_s = job.world.scenario().run.tick_s;
        Self {
            pacer: Pacer::new(job.pace, tick_s, Duration::ZERO),
            start: Instant::now(),
            times: TickTimes::new(),
            paused: false,
            steps: 0,
            frame_due: Duration::ZERO,
            job,
        }
    }

    fn run(mut self, mut failure: Option<Failure>) -> Ended {
        let reason = loop {
            if failure.is_some() {
                break EndReason::Failed;
            }
            while let Ok(control) = self.job.controls.try_recv() {
                self.apply(control);
            }
            if self.job.stop.load(Ordering::Relaxed) {
                break EndReason::Interrupted;
            }
            let wait = if self.paused && self.steps == 0 {
                FRAME_PERIOD
            } else {
                self.pacer.wait(self.start.elapsed()).min(FRAME_PERIOD)
            };
            if !wait.is_zero() {
                if let Ok(control) = self.job.controls.recv_timeout(wait) {
                    self.apply(control);
                }
                if self.paused {
                    self.publish_if_due(RunState::Running);
                }
                continue;
            }
            match self.tick() {
                Ok(status) => {
                    if let Some(end) = status.end() {
                        break end;
                    }
                }
                Err(why) => {
                    failure = Some(why);
                    break EndReason::Failed;
                }
            }
            self.publish_if_due(RunState::Running);
        };
        self.frame_due = Duration::ZERO;
        self.publish_if_due(RunState::Finished);
        self.job.progress.finish();
        Ended {
            tick_time_us: self.times.tick_time_us(),
            missed_deadlines: self.pacer.missed_deadlines(),
            wall_time_s: self.start.elapsed().as_secs_f64(),
            world: self.job.world,
            recording: self.job.recording,
            publisher: self.job.publisher,
            reason,
            failure,
        }
    }

    fn tick(&mut self) -> Result<Status, Failure> {
        let began = self.start.elapsed();
        let mut sinks =
            Sinks { recording: &mut self.job.recording, publisher: self.job.publisher.as_mut() };
        let status = self.job.world.tick(&mut sinks);
        let ended = self.start.elapsed();
        self.times.add(ended - began);
        self.pacer.tick_ended(ended);
        self.steps = self.steps.saturating_sub(1);
        if self.job.recording.is_broken() {
            return Err(Failure::Work("the recording cannot go on".to_owned()));
        }
        status.map_err(Failure::work)
    }

    fn apply(&mut self, control: Control) {
        let now = self.start.elapsed();
        match control {
            Control::Play => {
                self.paused = false;
                self.steps = 0;
                self.pacer.restart(self.pacer.pace(), now);
            }
            Control::Pause => {
                self.paused = true;
                self.steps = 0;
            }
            Control::Step { ticks } => {
                self.paused = true;
                self.steps = self.steps.saturating_add(ticks);
                self.pacer.restart(self.pacer.pace(), now);
            }
            Control::Pace(pace) => self.pacer.restart(pace, now),
            Control::LaneChange { to } => self.job.world.stack_mut().request_lane_change(to),
        }
    }

    fn publish_if_due(&mut self, state: RunState) {
        let now = self.start.elapsed();
        if now < self.frame_due {
            return;
        }
        self.frame_due = now + FRAME_PERIOD;
        let state = match state {
            RunState::Running if self.paused => RunState::Paused,
            other => other,
        };
        self.job.progress.show(&self.job.world);
        if let Some(publisher) = &mut self.job.publisher {
            publisher.publish(state, self.pacer.pace(), now, &self.job.world);
        }
    }
}
