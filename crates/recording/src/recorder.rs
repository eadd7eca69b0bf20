//! The recorder of the main job: owned ticks over a bounded channel to the writer's thread.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use tractrix_core::{Plan, Recorder, Scene, Step, Tick, Time};

use crate::error::RecordingError;
use crate::file::McapFile;
use crate::inputs::{BUS_RECORD, BusTrace, DRIVER_KEY, StepNotes};
use crate::schedule::Schedule;
use crate::telemetry::Scenery;
use crate::topic::{TopicMessage, bus_name};
use crate::writer::{Note, Queued, Record, RunEnd, Writer};

/// What a recording says about its run.
pub struct RunHeader {
    /// Name and value: seed, version, revision, start of the run.
    pub metadata: BTreeMap<String, String>,
    /// What the run was made of, by file names: `stack.toml` with the stack's configuration always,
    /// and `scenario.toml`, `sheet.toml` or `road.xodr` where there is one.
    pub files: BTreeMap<&'static str, String>,
    /// What does not change during the run.
    pub scenery: Scenery,
    /// The bus that the truck is driven over.
    pub bus: Option<BusHeader>,
    /// Who hears the telemetry while it is written.
    pub listener: Option<Listener>,
}

/// Hears every message of [`messages`](crate::messages), and the frames of the bus
/// ([`BUS_FRAMES`](crate::BUS_FRAMES)), with its time and the bytes that the file gets, in the
/// writer's thread: a network's sink, which must not block.
pub type Listener = Box<dyn FnMut(Time, &TopicMessage) + Send>;

/// What a recording says about the bus that the truck is driven over.
pub struct BusHeader {
    /// How it is reached: `bus`, `can:can0`. The frames are on `/can/can0/frames`.
    pub vehicle: String,
    /// What the truck's driver is set up with (JSON).
    pub driver_json: String,
    /// What goes over it.
    pub trace: BusTrace,
}

/// What happens when the disk is slower than the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Backlog {
    /// The run waits: nothing is left out.
    Wait,
    /// The run never waits: what the queue has no room for is left out, and counted.
    Drop {
        /// The end of the recording may take so long, s.
        end_within_s: f64,
    },
}

/// Ticks and steps in flight to the writer.
const QUEUE: usize = 1024;
/// Once something was left out, so is the rest of a second: few gaps, and a writer that catches up.
const GAP: i64 = 1_000_000_000;

/// A recording under way.
pub struct Recording {
    queue: SyncSender<Queued>,
    end: SyncSender<RunEnd>,
    ended: Receiver<(Time, Result<(), RecordingError>)>,
    path: PathBuf,
    broken: bool,
    backlog: Backlog,
    dropped: u64,
    /// Notes that were left out since the last one that was not.
    gap_notes: u64,
    /// Until then everything is left out.
    gap_until: Time,
    schedule: Schedule,
    steps: StepNotes,
    trace: Option<BusTrace>,
}

impl Recording {
    /// Creates the file, writes what is known before the first tick, and starts the writer.
    ///
    /// # Errors
    /// [`RecordingError`] when the file cannot be created.
    pub fn create(
        path: &Path,
        header: RunHeader,
        backlog: Backlog,
    ) -> Result<Self, RecordingError> {
        Self::on(McapFile::create(path)?, path, header, backlog)
    }

    fn on(
        mut file: McapFile,
        path: &Path,
        header: RunHeader,
        backlog: Backlog,
    ) -> Result<Self, RecordingError> {
        file.metadata("run", header.metadata)?;
        for (name, text) in &header.files {
            let kind = if name.ends_with(".toml") { "application/toml" } else { "application/xml" };
            file.attach(name, kind, text.as_bytes())?;
        }
        let schedule = Schedule::new(&header.scenery.road);
        let mut trace = None;
        if let Some(bus) = header.bus {
            let name = bus_name(&bus.vehicle).unwrap_or_default().to_owned();
            let values = [("vehicle", bus.vehicle), (DRIVER_KEY, bus.driver_json)];
            let values = values.map(|(key, value)| (key.to_owned(), value));
            file.metadata(BUS_RECORD, BTreeMap::from(values))?;
            trace = Some((bus.trace, name));
        }
        let name = trace.as_ref().map(|(_, name)| name.as_str());
        let writer = Writer::open(file, header.scenery, name, header.listener)?;
        let (queue, queued) = sync_channel(QUEUE);
        let (end, run_end) = sync_channel(1);
        let (done, ended) = sync_channel(1);
        #[expect(clippy::disallowed_methods, reason = "a recording owns its writer's thread")]
        std::thread::spawn(move || {
            // Nobody hears it who does not wait for the end
            let _ = done.send(writer.run(&queued, &run_end));
        });
        Ok(Self {
            queue,
            end,
            ended,
            path: path.to_owned(),
            broken: false,
            backlog,
            dropped: 0,
            gap_notes: 0,
            gap_until: Time::ZERO,
            schedule,
            steps: StepNotes::default(),
            trace: trace.map(|(trace, _)| trace),
        })
    }

    fn send(&mut self, now: Time, note: Note) {
        if self.broken {
            return;
        }
        let queued = Queued { gap_notes: self.gap_notes, note };
        if self.backlog == Backlog::Wait {
            self.broken = self.queue.send(queued).is_err();
            return;
        }
        let sent = match now < self.gap_until {
            true => Err(TrySendError::Full(queued)),
            false => self.queue.try_send(queued),
        };
        match sent {
            Ok(()) => self.gap_notes = 0,
            Err(TrySendError::Disconnected(_)) => self.broken = true,
            Err(TrySendError::Full(_)) => {
                if self.gap_notes == 0 {
                    self.gap_until = now.plus_nanos(GAP);
                }
                self.gap_notes += 1;
                self.dropped += 1;
                // What comes after the gap may not build on what is in it
                self.steps = StepNotes::default();
            }
        }
    }

    /// Notes a change of the stack in words: between the step before `now` and that of `now`.
    pub fn change(&mut self, now: Time, change_toml: String) {
        self.send(now, Note::Change(now, change_toml));
    }

    /// Whether the writer has given up; [`Self::finish`] says why.
    #[must_use]
    pub const fn is_broken(&self) -> bool {
        self.broken
    }

    /// Notes that were left out, because the disk was slower than the run; a tick makes up to three.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Waits until everything is written, attaches the summary and closes the file.
    ///
    /// # Errors
    /// [`Torn`] with the file and what went wrong, at whatever tick it did.
    pub fn finish(mut self, summary_json: &str) -> Result<(), Torn> {
        if let Some(trace) = self.trace.take() {
            self.send(self.gap_until, Note::Calls(trace.take_all()));
        }
        let end = RunEnd { gap_notes: self.gap_notes, summary_json: summary_json.to_owned() };
        // Room for one, and a writer that has given up has said why
        let _ = self.end.try_send(end);
        drop(self.queue);
        let ended = match self.backlog {
            Backlog::Wait => self.ended.recv().map_err(|_| RecordingError::Panicked),
            Backlog::Drop { end_within_s } => {
                let within = Duration::try_from_secs_f64(end_within_s).unwrap_or_default();
                self.ended.recv_timeout(within).map_err(|e| match e {
                    RecvTimeoutError::Timeout => RecordingError::Stuck { after_s: end_within_s },
                    RecvTimeoutError::Disconnected => RecordingError::Panicked,
                })
            }
        };
        let (kept, written) = match ended {
            Ok((kept, written)) => (kept, written),
            Err(why) => (Time::ZERO, Err(why)),
        };
        written.map_err(|why| Torn { why, path: self.path, kept_s: kept.seconds() })
    }
}

/// A recording without an end.
#[derive(Debug)]
pub struct Torn {
    /// What went wrong.
    pub why: RecordingError,
    /// The file.
    pub path: PathBuf,
    /// Time of the run up to which it is whole, s; 0 if that is not known.
    pub kept_s: f64,
}

impl Recorder for Recording {
    fn record(&mut self, tick: &Tick<'_>) {
        let due = self.schedule.due(tick.now);
        let p = tick.plan;
        let record = Record {
            now: tick.now,
            ego: *tick.ego,
            plan: Plan {
                path: if due.scene { p.path.clone() } else { Vec::new() },
                speed: Vec::new(),
                guard: p.guard.clone(),
                maneuver: p.maneuver,
                reason: p.reason,
                refusal: p.refusal,
                speed_status: p.speed_status,
                reference_speed_m_s: p.reference_speed_m_s,
                target_speed_m_s: p.target_speed_m_s,
                target_accel_m_s2: p.target_accel_m_s2,
                target_d_m: p.target_d_m,
                lateral_error_m: p.lateral_error_m,
                lane: p.lane,
                following: p.following,
                held_up: p.held_up,
                command: p.command,
            },
            scene: if due.scene { tick.scene.clone() } else { Scene::default() },
            due,
        };
        self.send(tick.now, Note::Tick(Box::new(record)));
    }

    fn step(&mut self, step: &Step<'_>) {
        let calls = self.trace.as_ref().map(BusTrace::take).filter(|calls| !calls.is_empty());
        if let Some(calls) = calls {
            self.send(step.now, Note::Calls(calls));
        }
        let note = self.steps.note(step).map(Box::new);
        self.send(step.now, Note::Step(step.now, note));
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Seek, SeekFrom, Write};
    use std::sync::{Arc, Condvar, Mutex};
    use std::time::Instant;

    use tractrix_core::{Command, EgoState, LaneChoice, Stamped, VehicleLimits, VehicleStatus};

    use super::*;
    use crate::file::Disk;
    use crate::{Combination, Inputs, Scenery};

    /// A disk that takes nothing while it hangs, and keeps what it took.
    #[derive(Clone, Default)]
    struct Hanging(Arc<(Mutex<State>, Condvar)>);

    /// Whether it hangs, and what it took.
    type State = (bool, Cursor<Vec<u8>>);

    impl Hanging {
        fn hang(&self, hangs: bool) {
            self.0.0.lock().unwrap().0 = hangs;
            self.0.1.notify_all();
        }

        fn when_it_goes<T>(&self, act: impl FnOnce(&mut Cursor<Vec<u8>>) -> T) -> T {
            let (state, changed) = (&self.0.0, &self.0.1);
            let mut state = changed.wait_while(state.lock().unwrap(), |state| state.0).unwrap();
            act(&mut state.1)
        }
    }

    impl Write for Hanging {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.when_it_goes(|file| file.write(bytes))
        }

        fn flush(&mut self) -> std::io::Result<()> {
            self.when_it_goes(|_| Ok(()))
        }
    }

    impl Seek for Hanging {
        fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
            self.when_it_goes(|file| file.seek(to))
        }
    }

    impl Disk for Hanging {
        fn sync(&mut self) -> std::io::Result<()> {
            self.flush()
        }
    }

    const TICK: i64 = 10_000_000;

    fn recording(disk: &Hanging, end_within_s: f64, listener: Option<Listener>) -> Recording {
        let limits = VehicleLimits::from_sheet("sheet", &crate::tests::sheet()).unwrap();
        let header = RunHeader {
            metadata: BTreeMap::new(),
            files: BTreeMap::new(),
            scenery: Scenery {
                road: Arc::new(road::builtin::flat(1_000.0)),
                combination: Combination::new(&limits),
                geodesy: None,
            },
            bus: None,
            listener,
        };
        let file = McapFile::on(Path::new("disk"), Box::new(disk.clone())).unwrap();
        Recording::on(file, Path::new("disk"), header, Backlog::Drop { end_within_s }).unwrap()
    }

    /// Steps and ticks of a drive, from one tick to another.
    fn drive(recording: &mut Recording, ticks: std::ops::Range<i64>) {
        let limits = VehicleLimits::from_sheet("sheet", &crate::tests::sheet()).unwrap();
        let (ego, scene, plan) = (EgoState::default(), Scene::default(), Plan::default());
        for k in ticks {
            let now = Time(k * TICK);
            recording.step(&Step {
                now,
                ego: Some(&Stamped { time: now, value: ego }),
                status: &VehicleStatus::default(),
                scene: Some(&scene),
                limits: &limits,
                limit_cap_m_s: None,
                set_speed_m_s: 20.0,
                wish: LaneChoice::Keep,
                command: &Command::default(),
            });
            recording.record(&Tick { now, ego: &ego, scene: &scene, plan: &plan });
        }
    }

    /// Steps of a file from its beginning up to a gap, and what is left out there.
    fn steps_before_a_gap(disk: &Hanging) -> (i64, u64) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        std::fs::write(&path, disk.when_it_goes(|file| file.get_ref().clone())).unwrap();
        let mut inputs = Inputs::open(&path, false).unwrap();
        let mut steps = 0;
        while let Some(step) = inputs.next_step().unwrap() {
            assert_eq!(step.now, Time(steps * TICK));
            steps += 1;
        }
        (steps, inputs.gap_notes())
    }

    /// 60 s of a drive while the disk hangs from its first second on: nothing waits, what has no
    /// room is counted, and what comes after the disk has woken up is whole.
    #[test]
    fn a_disk_that_hangs_holds_nothing_up_and_the_gap_is_in_the_file() {
        let disk = Hanging::default();
        let mut recording = recording(&disk, 60.0, None);
        drive(&mut recording, 0..100);
        disk.hang(true);
        #[expect(clippy::disallowed_methods, reason = "it must not take as long as the disk")]
        let began = Instant::now();
        drive(&mut recording, 100..6_000);
        // 11,800 notes; a blocked send would wait for as long as the disk hangs
        assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
        let dropped = recording.dropped();
        assert!((9_000..11_800).contains(&dropped), "{dropped}");
        assert!(!recording.is_broken());
        disk.hang(false);
        while recording.gap_notes > 0 {
            let next = recording.gap_until.0 / TICK;
            drive(&mut recording, next..next + 100);
        }
        let dropped = recording.dropped();
        recording.finish("{\"end\": true}").unwrap();
        let (steps, gap_notes) = steps_before_a_gap(&disk);
        assert!(steps >= 100 && gap_notes > 0 && gap_notes <= dropped, "{steps} {gap_notes}");
        let text = disk.when_it_goes(|file| String::from_utf8_lossy(file.get_ref()).into_owned());
        assert!(text.contains("{\"end\": true}"), "the end is in the file");
    }

    /// Viewers of a run see what the file holds, byte for byte, and the file alone holds the inputs.
    #[test]
    fn a_listener_hears_every_message_with_the_bytes_of_the_file() {
        let (heard, hears) = std::sync::mpsc::channel();
        let disk = Hanging::default();
        let listener =
            move |now, message: &TopicMessage| heard.send((now, message.clone())).unwrap();
        let mut recording = recording(&disk, 60.0, Some(Box::new(listener)));
        drive(&mut recording, 0..100);
        recording.finish("{}").unwrap();
        let heard: Vec<(Time, TopicMessage)> = hears.into_iter().collect();
        assert_eq!(heard[0].1.topic.name, "/tf_static");
        assert_eq!(heard.iter().filter(|(_, m)| m.topic.name == "/clock").count(), 100);
        assert!(heard.iter().all(|(_, m)| !m.topic.name.starts_with("/stack/")));
        let file = disk.when_it_goes(|file| file.get_ref().clone());
        let mut heard = heard.iter();
        for message in mcap::MessageStream::new(&file).unwrap() {
            let message = message.unwrap();
            if !message.channel.topic.starts_with("/stack/") {
                let (now, live) = heard.next().unwrap();
                assert_eq!(now.0.unsigned_abs(), message.log_time);
                assert_eq!(live.topic.name, message.channel.topic);
                assert_eq!(live.cdr, *message.data);
            }
        }
        assert!(heard.next().is_none());
    }

    #[test]
    fn a_disk_that_never_wakes_up_does_not_keep_who_ends_waiting() {
        let disk = Hanging::default();
        let mut recording = recording(&disk, 0.2, None);
        drive(&mut recording, 0..100);
        disk.hang(true);
        drive(&mut recording, 100..200);
        let torn = recording.finish("{}").unwrap_err();
        assert!(matches!(torn.why, RecordingError::Stuck { .. }), "{}", torn.why);
        disk.hang(false);
    }
}
