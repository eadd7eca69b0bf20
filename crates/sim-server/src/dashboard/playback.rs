//! A run that is over, seen again: its recorded inputs through the stack, a few times a second.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use recording::{Combination, Inputs};
use road::Road;
use serde::Serialize;
use tractrix_core::{Recorder, Tick, Time};

use super::ahead::{Lead, SpeedAhead};
use super::frame::{Ego, Frame, Here, Other, Planned, Refused, Snapshot};
use super::road_json;
use super::strip::{RowsDue, Strip, round};
use crate::failure::Failure;
use crate::provenance::Provenance;
use crate::replayed::{Again, Setup};
use crate::run_folder::FoundRun;

/// Simulated time between two frames, s; more in runs that are longer than an hour.
const PERIOD_S: f64 = 0.25;
/// Frames of a run, at most.
const MAX_FRAMES: usize = 14_400;

/// A run's frames.
pub(crate) struct Playback {
    provenance: Provenance,
    name: String,
    scenario: String,
    road: Arc<Road>,
    front_m: f64,
    /// What the page shows of the road and the truck.
    pub(super) setting: String,
    frames: Vec<(Snapshot, f64, SpeedAhead)>,
    /// Columns of the strip plots.
    pub(super) strip: Strip,
    /// Ticks whose command is another one than was recorded: another revision drove.
    pub(super) ticks_different: u64,
}

/// What a frame of a run that is over says about the run.
#[derive(Debug, Serialize)]
struct PlayedRun<'a> {
    scenario: &'a str,
    state: &'static str,
    external_decider: bool,
    distance_m: f64,
    set_speed_m_s: f64,
    last_refusal: Option<Refused>,
}

/// Keeps every so many ticks.
struct Keeper {
    period_s: f64,
    due_s: f64,
    frames: Vec<(Snapshot, f64, SpeedAhead)>,
    last: Option<Snapshot>,
    last_refusal: Option<Refused>,
    strip: Strip,
    rows: RowsDue,
}

impl Recorder for Keeper {
    fn record(&mut self, tick: &Tick<'_>) {
        if let Some(refusal) = tick.plan.refusal {
            let (reason, time_s) = (tick.plan.reason, tick.now.seconds());
            self.last_refusal = Some(Refused { refusal, reason, time_s });
        }
        if self.rows.take(tick) {
            self.strip.push(tick);
        }
        if tick.now.seconds() + 1e-9 < self.due_s {
            return;
        }
        self.due_s = tick.now.seconds() + self.period_s;
        self.last = Some(Snapshot {
            now: tick.now,
            ego: *tick.ego,
            plan: tick.plan.clone(),
            scene: tick.scene.clone(),
            last_refusal: self.last_refusal,
        });
    }
}

impl Playback {
    /// Drives a recording's inputs through the stack again.
    ///
    /// # Errors
    /// [`Failure::Input`]: the file cannot be read, or its road is not there any more.
    pub(crate) fn load(file: &Path, name: &str) -> Result<Self, Failure> {
        let mut inputs = Inputs::open(file, false)?;
        let about = inputs.about().clone();
        let mut again = Again::new(file, Setup::new(file, &about, &[], None)?);
        let seed = about.value("run", "seed").and_then(|seed| seed.parse().ok());
        let mut keeper = Keeper {
            period_s: PERIOD_S,
            due_s: 0.0,
            frames: Vec::new(),
            last: None,
            last_refusal: None,
            strip: Strip::default(),
            rows: RowsDue::default(),
        };
        let mut ticks_different = 0;
        // The end of a torn recording is where it was torn
        while let Ok(Some(mut step)) = inputs.next_step() {
            again.prepare(&mut step)?.drive(&mut keeper);
            let Some((stack, _)) = again.driven() else { continue };
            ticks_different += u64::from(stack.plan().command != step.command);
            if let Some(kept) = keeper.last.take() {
                let ahead = SpeedAhead::of(&kept.plan, stack.speed_plan(), kept.ego.s_m);
                keeper.frames.push((kept, step.set_speed_m_s, ahead));
                if keeper.frames.len() > MAX_FRAMES {
                    keeper.thin_out();
                }
            }
        }
        let Some((_, limits)) = again.driven() else {
            return Err(Failure::file(file, "nothing was driven"));
        };
        let combination = Combination::new(limits);
        let front_m = limits.geometry.front_m;
        let road = Arc::clone(again.whole_road());
        Ok(Self {
            provenance: Provenance::of_seed(seed.unwrap_or_default()),
            name: name.to_owned(),
            scenario: about.value("run", "scenario").unwrap_or_default().to_owned(),
            setting: road_json(&road, &combination),
            road,
            front_m,
            frames: keeper.frames,
            strip: keeper.strip,
            ticks_different,
        })
    }

    /// First and last simulation time, s.
    pub(super) fn span_s(&self) -> [f64; 2] {
        let time_s = |frame: Option<&(Snapshot, f64, SpeedAhead)>| {
            frame.map_or(0.0, |(kept, ..)| kept.now.seconds())
        };
        [time_s(self.frames.first()), time_s(self.frames.last())]
    }

    /// Height, m, and grade, %, of the road at these stations.
    pub(super) fn profile_at(&self, stations_m: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let at = |&s_m: &f64| self.road.at(s_m, 0.0);
        stations_m.iter().map(at).map(|p| (p.z_m, p.grade_rad.tan() * 100.0)).unzip()
    }

    /// Frames of a stretch of time as JSON, so many at most.
    pub(super) fn frames(&self, from_s: f64, to_s: f64, most: usize) -> Vec<String> {
        let within = |now: Time| (from_s..=to_s).contains(&now.seconds());
        let wanted = self.frames.iter().filter(|(kept, ..)| within(kept.now));
        wanted.take(most).filter_map(|frame| self.frame(frame)).collect()
    }

    fn frame(&self, (kept, set_speed_m_s, ahead): &(Snapshot, f64, SpeedAhead)) -> Option<String> {
        let start_s_m = self.frames.first().map_or(0.0, |(first, ..)| first.ego.s_m);
        let frame = Frame {
            provenance: self.provenance,
            kind: "frame",
            run_id: &self.name,
            time_s: kept.now.seconds(),
            run: PlayedRun {
                scenario: &self.scenario,
                state: "recorded",
                external_decider: false,
                distance_m: round(kept.ego.s_m - start_s_m, 10.0),
                set_speed_m_s: *set_speed_m_s,
                last_refusal: kept.last_refusal,
            },
            ego: Ego::from(&kept.ego),
            road: Here::new(&self.road, &kept.ego, kept.plan.lane),
            plan: Planned::from(&kept.plan),
            lead: Lead::of(&kept.plan, &kept.ego, &kept.scene, self.front_m),
            speed_ahead: ahead,
            ghost: None,
            neighbours: kept.scene.neighbours.iter().map(Other::from).collect(),
        };
        serde_json::to_string(&frame).ok()
    }
}

impl Keeper {
    /// Every second frame goes, and only half as many come.
    fn thin_out(&mut self) {
        let mut is_kept = false;
        self.frames.retain(|_| {
            is_kept = !is_kept;
            is_kept
        });
        self.period_s *= 2.0;
    }
}

/// Runs that are looked at lately, two at most.
#[derive(Default)]
pub(super) struct Playbacks(Vec<(PathBuf, f64, Arc<Playback>)>);

impl Playbacks {
    /// A run's frames, if they are here and the run is still the same.
    pub(super) fn find(&self, run: &FoundRun) -> Option<Arc<Playback>> {
        let is_it = |kept: &&(PathBuf, f64, Arc<Playback>)| {
            kept.0 == run.folder && kept.1 == run.written_unix_s
        };
        self.0.iter().find(is_it).map(|kept| Arc::clone(&kept.2))
    }

    /// Keeps a run's frames; those that came first go.
    pub(super) fn keep(&mut self, run: &FoundRun, playback: Playback) -> Arc<Playback> {
        const MOST: usize = 2;
        let playback = Arc::new(playback);
        self.0.retain(|kept| kept.0 != run.folder);
        self.0.push((run.folder.clone(), run.written_unix_s, Arc::clone(&playback)));
        let surplus = self.0.len().saturating_sub(MOST);
        self.0.drain(..surplus);
        playback
    }
}
