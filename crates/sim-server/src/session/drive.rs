//! Driving a world: its thread's loop, with pacing, commands, recording and views.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use planner::OutsideDemand;
use planner::decider::DeciderKind;
use recording::Recording;
use sim::{EndReason, StackChange, Status, TickTime, TickTimes, World};
use tokio::sync::oneshot;
use tractrix_core::{Recorder, Step, Tick, Time};

use super::pace::Pacer;
use super::{Acted, Asked, Command, Controls, Handle, Next, Pace, Refused, RunState, State};
use crate::dashboard::Publisher;
use crate::failure::Failure;
use crate::progress::Progress;

/// A run about to start.
pub(crate) struct Job {
    pub(crate) world: World,
    pub(crate) state: State,
    pub(crate) pace: Pace,
    pub(crate) recording: Recording,
    pub(crate) publisher: Option<Publisher>,
    pub(crate) handle: Handle,
    pub(crate) asked: Receiver<Asked>,
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
    pub(crate) pace: Pace,
    pub(crate) tick_time_us: TickTime,
    pub(crate) missed_deadlines: u64,
    pub(crate) wall_time_s: f64,
    /// Where commands arrive.
    pub(crate) asked: Option<Receiver<Asked>>,
    /// What comes in its place, and who waits for it.
    pub(crate) next: Option<(Box<Next>, Reply)>,
    /// The session is to end too.
    pub(crate) quits: bool,
}

/// Who waits for an answer.
pub(crate) type Reply = oneshot::Sender<Result<Acted, Refused>>;

/// Viewers get a frame this often (wall time).
const FRAME_PERIOD: Duration = Duration::from_millis(50);

/// A time is reached when it is nearer than this, s.
const ROUNDING_S: f64 = 1e-6;

/// Who looks at a tick.
struct Views<'a> {
    publisher: Option<&'a mut Publisher>,
    handle: &'a Handle,
    /// A copy of the world drives: the tick is seen and does not count.
    is_copy: bool,
}

impl Recorder for Views<'_> {
    fn record(&mut self, tick: &Tick<'_>) {
        if let Some(publisher) = &mut self.publisher {
            publisher.show(tick);
            if !self.is_copy {
                publisher.count(tick);
            }
        }
        self.handle.note_bodies(tick);
    }
}

/// The consumers of a tick.
struct Sinks<'a> {
    recording: &'a mut Recording,
    views: Views<'a>,
}

impl Recorder for Sinks<'_> {
    fn record(&mut self, tick: &Tick<'_>) {
        self.recording.record(tick);
        self.views.record(tick);
    }

    fn step(&mut self, step: &Step<'_>) {
        self.recording.step(step);
    }
}

/// A run under way.
pub(crate) struct Drive {
    job: Job,
    start: Instant,
    pacer: Pacer,
    times: TickTimes,
    /// Ticks driven.
    tick: u64,
    /// Ticks to drive before the next pause.
    steps: u64,
    /// Who waits for that pause.
    waiting: Option<Reply>,
    /// The run stands still when this simulation time is reached, s.
    pause_at_s: Option<f64>,
    frame_due: Duration,
    next: Option<(Box<Next>, Reply)>,
    quits: bool,
}

impl Drive {
    #[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
    pub(crate) fn new(job: Job) -> Self {
        let tick_s = job.world.scenario().run.tick_s;
        Self {
            pacer: Pacer::new(job.pace, tick_s, Duration::ZERO),
            start: Instant::now(),
            times: TickTimes::new(),
            tick: 0,
            steps: 0,
            waiting: None,
            pause_at_s: None,
            frame_due: Duration::ZERO,
            next: None,
            quits: false,
            job,
        }
    }

    /// Drives the world to its end, until it is stopped or replaced, or until it or the recording
    /// fails.
    pub(crate) fn run(mut self) -> Ended {
        // A world that goes on from where it was kept has its ghost
        let begins = self.job.world.now() == Time::default();
        let mut failure =
            if begins { self.job.world.attach_ghost().map_err(Failure::work).err() } else { None };
        self.enter(self.job.state);
        if failure.is_none() {
            self.show_start();
        }
        let reason = loop {
            if failure.is_some() {
                break EndReason::Failed;
            }
            while let Ok(asked) = self.job.asked.try_recv() {
                self.act(asked);
            }
            if self.is_over() {
                break EndReason::Interrupted;
            }
            let wait = if self.stands() {
                FRAME_PERIOD
            } else {
                self.pacer.wait(self.start.elapsed()).min(FRAME_PERIOD)
            };
            if !wait.is_zero() {
                if let Ok(asked) = self.job.asked.recv_timeout(wait) {
                    self.act(asked);
                }
                if self.job.state != State::Playing {
                    self.publish_if_due(RunState::Paused);
                }
                continue;
            }
            match self.drive_tick() {
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
            let state = match self.job.state {
                State::Playing => RunState::Running,
                State::Stopped | State::Paused | State::Quitting => RunState::Paused,
            };
            self.publish_if_due(state);
        };
        self.enter(if self.quits { State::Quitting } else { State::Stopped });
        self.answer_waiting();
        self.frame_due = Duration::ZERO;
        self.publish_if_due(RunState::Finished);
        self.job.progress.finish();
        Ended {
            pace: self.pacer.pace(),
            tick_time_us: self.times.tick_time_us(),
            missed_deadlines: self.pacer.missed_deadlines(),
            wall_time_s: self.start.elapsed().as_secs_f64(),
            world: self.job.world,
            recording: self.job.recording,
            publisher: self.job.publisher,
            reason,
            failure,
            asked: Some(self.job.asked),
            next: self.next,
            quits: self.quits,
        }
    }

    /// A run that stands at its start is seen as its first tick will find it: in a copy.
    fn show_start(&mut self) {
        if self.tick > 0 || !self.stands() {
            return;
        }
        let mut copy = self.job.world.clone();
        let Job { publisher, handle, .. } = &mut self.job;
        let mut views = Views { publisher: publisher.as_mut(), handle, is_copy: true };
        if copy.tick(&mut views).is_ok() {
            self.publish_if_due(RunState::Paused);
        }
    }

    fn is_over(&self) -> bool {
        self.quits || self.next.is_some() || self.job.stop.load(Ordering::Relaxed)
    }

    fn stands(&self) -> bool {
        self.job.state != State::Playing && self.steps == 0
    }

    fn drive_tick(&mut self) -> Result<Status, Failure> {
        let began = self.start.elapsed();
        let Job { world, recording, publisher, handle, .. } = &mut self.job;
        let views = Views { publisher: publisher.as_mut(), handle, is_copy: false };
        let status = world.tick(&mut Sinks { recording, views });
        let ended = self.start.elapsed();
        self.times.add(ended - began);
        let missed = self.pacer.tick_ended(ended);
        if let Some(publisher) = &self.job.publisher {
            publisher.note_tick(ended - began, missed);
        }
        self.tick += 1;
        self.steps = self.steps.saturating_sub(1);
        if self.steps == 0 {
            self.answer_waiting();
        }
        let now_s = self.job.world.now().seconds();
        if self.job.state == State::Playing
            && self.pause_at_s.is_some_and(|at_s| now_s + ROUNDING_S >= at_s)
        {
            self.pause_at_s = None;
            self.pause();
        }
        if self.job.recording.is_broken() {
            return Err(Failure::Work("the recording cannot go on".to_owned()));
        }
        status.map_err(Failure::work)
    }

    /// What a command that has acted is answered with.
    fn acted(&self) -> Acted {
        let time_s = self.job.world.now().seconds();
        Acted { tick: self.tick, time_s, state: self.job.state }
    }

    /// Who waits for the end of a step hears that it is driven, or how much of it is not.
    fn answer_waiting(&mut self) {
        if let Some(reply) = self.waiting.take() {
            let left = self.steps;
            let _ = reply.send(match left {
                0 => Ok(self.acted()),
                left => Err(Refused::CutShort { left }),
            });
        }
    }

    fn enter(&mut self, state: State) {
        self.job.state = state;
        self.job.handle.note_state(state);
    }

    /// Ends a step in its middle; who waits for its end is answered.
    fn end_step(&mut self) {
        self.answer_waiting();
        self.steps = 0;
    }

    fn pause(&mut self) {
        self.end_step();
        self.enter(State::Paused);
        self.show_start();
    }

    fn act(&mut self, Asked { command, reply, place }: Asked) {
        drop(place);
        if self.is_over() {
            let _ = reply.send(Err(Refused::Ended));
            return;
        }
        let now = self.start.elapsed();
        let done = match command {
            Command::Play => {
                self.end_step();
                self.enter(State::Playing);
                self.pacer.restart(self.pacer.pace(), now);
                Ok(())
            }
            Command::Pause => {
                self.pause();
                Ok(())
            }
            Command::Step { ticks, wait } => return self.step("step", ticks.into(), wait, reply),
            Command::StepUntil { time_s, wait } => {
                let left_s = time_s - self.job.world.now().seconds();
                let ticks = (left_s / self.job.world.scenario().run.tick_s - 1e-6).ceil();
                // A time that has passed is reached already
                return self.step("step_until", ticks.max(0.0) as u64, wait, reply);
            }
            Command::PauseAt(time_s) => {
                self.pause_at_s = Some(time_s);
                Ok(())
            }
            Command::Snapshot(name) => self.job.handle.keep(name, &self.job.world),
            Command::Pace(pace) => {
                self.pacer.restart(pace, now);
                Ok(())
            }
            Command::LaneChange { to } => self.wish(to),
            Command::SetSpeed(speed_m_s) => {
                self.job.world.stack_mut().set_speed(speed_m_s);
                Ok(())
            }
            Command::Change(change) => self.change(&change),
            Command::External { accel_m_s2, road_wheel_rad } => {
                let time = self.job.world.now();
                let demand = OutsideDemand { time, accel_m_s2, road_wheel_rad };
                self.change(&StackChange::Outside { demand: Some(demand) })
            }
            Command::Release => self.change(&StackChange::Outside { demand: None }),
            Command::Fault(fault, is_on) => {
                let set = self.job.world.set_fault(fault, is_on);
                set.map_err(|e| Refused::NoBus(e.to_string()))
            }
            Command::Quit => {
                self.quits = true;
                self.enter(State::Quitting);
                Ok(())
            }
            Command::Begin(next) => {
                self.next = Some((next, reply));
                return;
            }
        };
        self.note_controls();
        let _ = reply.send(done.map(|()| self.acted()));
    }

    fn note_controls(&self) {
        self.job.handle.note_controls(Controls::of(&self.job.world, self.pacer.pace()));
    }

    fn step(&mut self, action: &'static str, ticks: u64, wait: bool, reply: Reply) {
        if self.job.state != State::Paused || self.steps > 0 {
            let (state, needs) = (self.job.state, "pause it first, and let a step end");
            let _ = reply.send(Err(Refused::WrongState { action, state, needs }));
            return;
        }
        if ticks > super::command::MAX_TICKS.into() {
            let _ = reply.send(Err(Refused::TooFar { ticks }));
            return;
        }
        self.steps = ticks;
        self.pacer.restart(self.pacer.pace(), self.start.elapsed());
        if wait && ticks > 0 {
            self.waiting = Some(reply);
        } else {
            let _ = reply.send(Ok(self.acted()));
        }
    }

    /// Changes the stack, and notes it in the recording.
    fn change(&mut self, change: &StackChange) -> Result<(), Refused> {
        let unusable = |e: sim::SimError| Refused::Unusable(e.to_string());
        let words = change.to_toml().map_err(unusable)?;
        self.job.world.change(change).map_err(unusable)?;
        self.job.recording.change(self.job.world.now(), words);
        Ok(())
    }

    fn wish(&mut self, to: planner::decider::LaneChoice) -> Result<(), Refused> {
        if self.job.world.stack().config().decider != DeciderKind::External {
            return Err(Refused::NoExternalDecider);
        }
        self.job.world.stack_mut().request_lane_change(to);
        Ok(())
    }

    fn publish_if_due(&mut self, state: RunState) {
        let now = self.start.elapsed();
        if now < self.frame_due {
            return;
        }
        self.frame_due = now + FRAME_PERIOD;
        self.job.progress.show(&self.job.world);
        if let Some(publisher) = &mut self.job.publisher {
            publisher.publish(state, self.pacer.pace(), now, &self.job.world);
        }
    }
}

#[cfg(test)]
mod tests {
    use sim::Scenario;
    use tractrix_core::GuardReason;

    use super::*;
    use crate::dashboard::{Metrics, Shared};
    use crate::provenance::Provenance;
    use crate::session;

    /// What a view is told of a tick in which the guard acts.
    struct Guarded<'a>(Views<'a>);

    impl Recorder for Guarded<'_> {
        fn record(&mut self, tick: &Tick<'_>) {
            let mut plan = tick.plan.clone();
            plan.guard = vec![GuardReason::Stale];
            self.0.record(&Tick { plan: &plan, ..*tick });
        }
    }

    /// A run that stands at its start shows its first tick out of a copy of the world; driven, the
    /// tick came once more, and what the guard did in it was counted twice.
    #[test]
    fn a_tick_that_is_only_shown_does_not_count() {
        let scenario = Scenario::builtin("flat").unwrap();
        let mut world = World::new(&scenario, 1).unwrap();
        let (handle, _) = session::channel(&scenario, 1, None);
        let (metrics, stop) = (Metrics::new(), Arc::new(AtomicBool::new(false)));
        let setting = session::setting(&world);
        let shared = Shared::new(&"s".into(), setting, handle.clone(), &metrics, stop);
        let (run, road) = ("run".to_owned(), Arc::clone(world.road()));
        let provenance = Provenance::of_seed(1);
        let mut publisher = Publisher::new(Arc::clone(&shared), provenance, run, &scenario, road);
        let counted = || {
            let text = metrics.text();
            let line = text.lines().find(|line| line.starts_with("tractrix_guard_ticks_total{"));
            line.and_then(|line| line.rsplit(' ').next().map(str::to_owned)).unwrap()
        };
        for (is_copy, count) in [(true, "0"), (false, "1"), (true, "1")] {
            let publisher = Some(&mut publisher);
            let views = Views { publisher, handle: &handle, is_copy };
            world.tick(&mut Guarded(views)).unwrap();
            assert_eq!(counted(), count);
        }
    }
}
