//! A world behind a lock. The interpreter's lock is never held while the world's lock is waited for
//! or held, so that other Python threads go on while a world drives.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use planner::decider::{DeciderKind, LaneChoice};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sim::{EndReason, Overrides, RunReport, Status, TickTimes, WallClock};
use tractrix_core::{Neighbour, Plan, Recorder, Tick, Time};

use crate::decision::{Decision, word};
use crate::ego::Ego;
use crate::fault::Fault;
use crate::scenario::changed;
use crate::scene::{rows, vehicles};

/// Python looks for signals (Ctrl-C) at least this often, wall time.
const LOOK_UP: Duration = Duration::from_millis(50);

/// What the last tick left behind; the plan without its path and profile.
#[derive(Debug, Clone, Default)]
struct Latest {
    time: Time,
    plan: Option<Plan>,
    neighbours: Vec<Neighbour>,
}

impl Recorder for Latest {
    fn record(&mut self, tick: &Tick<'_>) {
        self.time = tick.now;
        let (path, speed, guard) = (Vec::new(), Vec::new(), tick.plan.guard.clone());
        self.plan = Some(Plan { path, speed, guard, ..*tick.plan });
        self.neighbours.clone_from(&tick.scene.neighbours);
    }
}

/// A world with what it showed last.
#[derive(Clone)]
struct Drive {
    world: sim::World,
    seed: u64,
    latest: Latest,
    times: TickTimes,
    wall: Duration,
    failure: Option<Fault>,
}

impl Drive {
    /// Drives up to `ticks` ticks, to the end, or until Python has to look up. The ticks left.
    #[expect(clippy::disallowed_methods, reason = "a shell measures its ticks")]
    fn advance(&mut self, mut ticks: u64) -> Result<u64, Fault> {
        if let Some(failure) = &self.failure {
            return Err(failure.clone());
        }
        let start = Instant::now();
        let mut began = start;
        while ticks > 0 && self.world.status() == Status::Running {
            let done = self.world.tick(&mut self.latest);
            let ended = Instant::now();
            self.times.add(ended - began);
            began = ended;
            if let Err(e) = done {
                self.wall += began - start;
                let failure = Fault::of_run(&e);
                self.failure = Some(failure.clone());
                return Err(failure);
            }
            ticks -= 1;
            if began - start > LOOK_UP {
                break;
            }
        }
        self.wall += began - start;
        Ok(if self.world.status() == Status::Running { ticks } else { 0 })
    }

    fn status(&self) -> Result<String, Fault> {
        match self.failure {
            Some(_) => word(&EndReason::Failed),
            None => word(&self.world.status()),
        }
    }

    fn summary(&self) -> Result<String, Fault> {
        let end = match self.failure {
            Some(_) => Some(EndReason::Failed),
            None => self.world.status().end(),
        };
        let wall = WallClock {
            missed_deadlines: 0,
            tick_time_us: self.times.tick_time_us(),
            pace: "max".to_owned(),
            wall_time_s: self.wall.as_secs_f64(),
        };
        let report = RunReport::new(crate::provenance(self.seed), &self.world, end, wall);
        serde_json::to_string(&report).map_err(|e| Fault::Work(e.to_string()))
    }
}

/// A run that `restore` goes back to.
#[pyclass(frozen, module = "tractrix._native")]
pub(crate) struct Snapshot(Drive);

/// The closed loop; none after `close()`.
#[pyclass(frozen, module = "tractrix._native")]
pub(crate) struct World(Mutex<Option<Drive>>);

impl World {
    /// Works on the world without the interpreter.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Drive) -> Result<T, Fault> + Send,
    ) -> Result<T, Fault> {
        py.detach(|| {
            let mut guard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            work(guard.as_mut().ok_or_else(Fault::closed)?)
        })
    }
}

#[pymethods]
impl World {
    #[new]
    #[pyo3(signature = (name, json, *, seed, road, truck, payload_kg, traffic, mode, manifest,
        on_traffic_failure, decider, speed_planner, duration_s))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn new(
        py: Python<'_>,
        name: &str,
        json: Option<&str>,
        seed: Option<u64>,
        road: Option<&str>,
        truck: Option<&str>,
        payload_kg: Option<f64>,
        traffic: Option<&str>,
        mode: Option<&str>,
        manifest: Option<PathBuf>,
        on_traffic_failure: Option<&str>,
        decider: Option<&str>,
        speed_planner: Option<&str>,
        duration_s: Option<f64>,
    ) -> Result<Self, Fault> {
        let changes = Overrides {
            road,
            truck,
            payload_kg,
            duration_s,
            traffic,
            mode,
            manifest: manifest.as_deref(),
            on_traffic_failure,
            decider,
            speed_planner,
            ..Overrides::default()
        };
        py.detach(|| {
            let scenario = changed(name, json, &changes)?;
            let seed = scenario.seed(seed).map_err(|e| Fault::of_input(&e))?;
            let mut world = sim::World::new(&scenario, seed).map_err(|e| Fault::of_input(&e))?;
            world.attach_ghost().map_err(|e| Fault::of_input(&e))?;
            Ok(Self(Mutex::new(Some(Drive {
                world,
                seed,
                latest: Latest::default(),
                times: TickTimes::new(),
                wall: Duration::ZERO,
                failure: None,
            }))))
        })
    }

    /// Drives `ticks` ticks, or to the end.
    fn step(&self, py: Python<'_>, mut ticks: u64) -> PyResult<String> {
        while ticks > 0 {
            ticks = self.with(py, |drive| drive.advance(ticks))?;
            py.check_signals()?;
        }
        Ok(self.with(py, |drive| drive.status())?)
    }

    fn status(&self, py: Python<'_>) -> Result<String, Fault> {
        self.with(py, |drive| drive.status())
    }

    fn time_s(&self, py: Python<'_>) -> Result<f64, Fault> {
        self.with(py, |drive| Ok(drive.world.now().seconds()))
    }

    fn tick_s(&self, py: Python<'_>) -> Result<f64, Fault> {
        self.with(py, |drive| Ok(drive.world.scenario().run.tick_s))
    }

    fn seed(&self, py: Python<'_>) -> Result<u64, Fault> {
        self.with(py, |drive| Ok(drive.seed))
    }

    fn road_length_m(&self, py: Python<'_>) -> Result<f64, Fault> {
        self.with(py, |drive| Ok(drive.world.road().length_m()))
    }

    fn ego(&self, py: Python<'_>) -> Result<Ego, Fault> {
        self.with(py, |drive| Ok(Ego::new(drive.latest.time, drive.world.truck().state())))
    }

    fn decision(&self, py: Python<'_>) -> Result<Option<Decision>, Fault> {
        self.with(py, |drive| {
            let latest = &drive.latest;
            latest.plan.as_ref().map(|plan| Decision::new(latest.time, plan)).transpose()
        })
    }

    /// Rows of the other vehicles, as the stack saw them or, where sensors change that, as they are.
    fn scene<'py>(&self, py: Python<'py>, truth: bool) -> Result<Bound<'py, PyBytes>, Fault> {
        let rows = self.with(py, |drive| {
            let hidden = if truth { drive.world.traffic().truth() } else { None };
            Ok(rows(hidden.map_or(&drive.latest.neighbours, |scene| &scene.neighbours)))
        })?;
        Ok(PyBytes::new(py, &rows))
    }

    /// Puts vehicles on a road without traffic of its own.
    fn show(&self, py: Python<'_>, rows: &[u8]) -> Result<(), Fault> {
        let others = vehicles(rows)?;
        self.with(py, |drive| {
            let road = drive.world.road().clone();
            let shown = drive.world.traffic_mut().show(&others, &road);
            shown.map_err(|e| Fault::Value(e.to_string()))
        })
    }

    fn summary(&self, py: Python<'_>) -> Result<String, Fault> {
        self.with(py, |drive| drive.summary())
    }

    fn manifest(&self, py: Python<'_>) -> Result<String, Fault> {
        self.with(py, |drive| {
            let manifest = drive.world.traffic().manifest();
            manifest.to_toml().map_err(|e| Fault::Work(e.to_string()))
        })
    }

    fn scenario(&self, py: Python<'_>) -> Result<String, Fault> {
        self.with(py, |drive| {
            let scenario = drive.world.scenario();
            serde_json::to_string(scenario).map_err(|e| Fault::Work(e.to_string()))
        })
    }

    fn request_lane_change(&self, py: Python<'_>, to: &str) -> Result<(), Fault> {
        let choice = match to {
            "left" => LaneChoice::Left,
            "keep" => LaneChoice::Keep,
            "right" => LaneChoice::Right,
            _ => return Err(Fault::Value(format!("{to:?}: expected left, keep or right"))),
        };
        self.with(py, |drive| {
            if drive.world.scenario().stack.decider != DeciderKind::External {
                let why = "lane changes are asked for with the decider external";
                return Err(Fault::Value(why.to_owned()));
            }
            drive.world.stack_mut().request_lane_change(choice);
            Ok(())
        })
    }

    fn snapshot(&self, py: Python<'_>) -> Result<Snapshot, Fault> {
        self.with(py, |drive| {
            if drive.world.traffic_mut().sumo_mut().is_some() {
                let why = "a run in SUMO traffic cannot be copied: there is one SUMO";
                return Err(Fault::Work(why.to_owned()));
            }
            Ok(Snapshot(drive.clone()))
        })
    }

    fn restore(&self, py: Python<'_>, snapshot: &Snapshot) -> Result<(), Fault> {
        self.with(py, |drive| {
            drive.clone_from(&snapshot.0);
            Ok(())
        })
    }

    /// Ends the run and what belongs to it (SUMO); a second time it does nothing.
    fn close(&self, py: Python<'_>) {
        py.detach(|| drop(self.0.lock().unwrap_or_else(PoisonError::into_inner).take()));
    }

    fn closed(&self, py: Python<'_>) -> bool {
        py.detach(|| self.0.lock().unwrap_or_else(PoisonError::into_inner).is_none())
    }
}
