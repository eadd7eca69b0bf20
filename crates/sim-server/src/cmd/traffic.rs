//! `traffic`: traffic alone, measured against recordings; calibration of the drivers; the
//! fundamental diagram.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Parser, ValueEnum};
use road::Road;
use serde::Serialize;
use sim::{Overrides, Scenario, Traffic, TrafficKind};
use tractrix_core::{EgoState, Geometry, Time, TrafficSource, VehicleClass};
use traffic_client::Mode;
use traffic_client::calibrate::{
    Effort, Lesson, RejectionSampling, calibrate, drive_bounded, drives_as_counted,
};
use traffic_client::native::{Boundary, TrafficConfig};
use traffic_client::replay::{Frame, Recording, Row, to_parquet};
use traffic_client::stats::{Observer, Samples};

use crate::cli::positive;
use crate::failure::Failure;
use crate::out_folder::{Out, OutFolder};
use crate::output;
use crate::progress::Stages;

mod diagram;
mod measured;
mod plots;
mod report;

use self::measured::Measured;
use self::report::Report;

/// Drives traffic without a truck; writes trajectories.parquet, statistics.json, statistics.html.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// A scenario file, or the name of a built-in one; its truck is left out.
    #[arg(long, default_value = "highway")]
    scenario: String,
    /// Simulated time that is observed, at most a day [default: 300, or the length of the
    /// recording]. Ctrl-C writes what there is by then.
    #[arg(long, value_name = "S", value_parser = duration)]
    duration: Option<f64>,
    #[command(flatten)]
    out: Out,
    /// Recordings to compare with: files, or folders of them.
    #[arg(long, value_name = "MEASURED", num_args = 1..)]
    compare: Vec<PathBuf>,
    /// Calibrates the drivers to these recordings first; writes calibrated.toml.
    #[arg(long, value_name = "MEASURED", num_args = 1..)]
    calibrate: Vec<PathBuf>,
    /// Generations of the calibration's search.
    #[arg(long, default_value_t = 25, requires = "calibrate")]
    generations: usize,
    /// Lanes of the recorded road.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=12))]
    lanes: u8,
    /// Carriageway of recordings with two.
    #[arg(long, value_enum, default_value_t = Direction::Forward)]
    carriageway: Direction,
    /// The other vehicles: native, sumo, replay:FILE or none.
    #[arg(long, value_name = "SOURCE")]
    traffic: Option<String>,
    /// pure, re (with --manifest) or rep; inter is pure here, as there is no truck.
    #[arg(long)]
    mode: Option<String>,
    /// traffic.manifest.toml of the run that mode re repeats; its seed is taken too.
    #[arg(long, value_name = "FILE")]
    manifest: Option<PathBuf>,
    /// Another road; recording:LANES lays one under the recording of replay:FILE.
    #[arg(long)]
    road: Option<String>,
    /// Draws flow over density for the native engine and, where it is installed, SUMO.
    #[arg(long)]
    diagram: bool,
    /// Seed of everything that is drawn at random [default: the manifest's or the scenario's, else 1].
    #[arg(long)]
    seed: Option<u64>,
    /// Prints statistics.json on stdout instead of a sentence.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Direction {
    /// Towards growing x.
    Forward,
    /// Towards falling x.
    Backward,
}

/// Between two looks at the traffic, and two rows of a trajectory, s.
const LOOK_S: f64 = 0.5;
/// What the seeds of a search differ by from those of a run.
const SEARCH_SEED: u64 = 0x5eed_0000;
/// Time that is observed where nobody says otherwise, s.
const DURATION_S: f64 = 300.0;

/// Longest time that is observed, s.
const LONGEST_S: f64 = 86_400.0;
/// Most rows of the trajectories: 2.4 GB of memory with what the statistics keep of them.
const MOST_ROWS: usize = 10_000_000;
/// What is written.
const RESULTS: &[&str] = &[
    "trajectories.parquet",
    "statistics.json",
    "statistics.html",
    "traffic.manifest.toml",
    "calibrated.toml",
    "diagram.json",
    "diagram.html",
    "sumo",
];

fn duration(text: &str) -> Result<f64, String> {
    match positive(text)? {
        s if s <= LONGEST_S => Ok(s),
        _ => Err(format!("at most {LONGEST_S} s, a day")),
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let out = args.out.folder(RESULTS)?;
    let mut scenario = Scenario::named(&args.scenario).map_err(Failure::input)?;
    let changes = Overrides {
        road: args.road.as_deref(),
        traffic: args.traffic.as_deref(),
        mode: args.mode.as_deref(),
        manifest: args.manifest.as_deref(),
        ..Overrides::default()
    };
    changes.apply(&mut scenario).map_err(Failure::of_option)?;
    if scenario.traffic.mode() == Mode::Inter {
        scenario.traffic.mode = Some(Mode::Pure);
    }
    scenario.run.seed = scenario.seed(args.seed).map_err(Failure::input)?;
    // Read before anything is written: what cannot be used is refused at once.
    let read = |paths: &[PathBuf]| Measured::read(paths, args.lanes.into(), args.carriageway);
    let measured = read(&args.compare)?;
    let learned = read(&args.calibrate)?;
    let mut drivers = scenario.traffic.demand(scenario.run.seed);
    if !args.calibrate.is_empty() {
        (scenario, drivers) = calibrated(args, &out, scenario, &learned)?;
    }
    let seed = scenario.run.seed;
    if args.diagram {
        diagram::draw(&scenario, seed, &out)?;
    }
    let stop = out.stop_in_good_order();
    let driven = drive(args, &out, &scenario, seed, &stop)?;
    let bounded = match driven.end {
        End::Interrupted => Vec::new(),
        _ => bounded(&scenario, &drivers, &measured)?,
    };
    let report = Report::new(&scenario, seed, &driven, &measured, &bounded, &args.calibrate);
    let json = serde_json::to_string_pretty(&report).map_err(Failure::work)?;
    out.write("statistics.json", &json)?;
    let picture = plots::page(&report.sentence(), &driven.samples, &measured);
    out.write("statistics.html", picture)?;
    out.keep();
    output::result(if args.json { json } else { report.sentence() }.as_str())
}

/// Drives of bounded traffic per recording.
const BOUNDED_DRIVES: u64 = 4;

/// Drivers between the measured start, arrivals and end of each recording.
fn bounded(
    scenario: &Scenario,
    drivers: &TrafficConfig,
    measured: &Measured,
) -> Result<Vec<Samples>, Failure> {
    if scenario.traffic.source != TrafficKind::Native {
        return Ok(Vec::new());
    }
    let drive = |recording, road| {
        let boundary = Arc::new(Boundary::of(road, recording)?);
        drive_bounded(road, drivers, &boundary, BOUNDED_DRIVES)
    };
    let pairs = measured.recordings.iter().zip(&measured.roads);
    pairs.map(|(recording, road)| drive(recording, road).map_err(Failure::input)).collect()
}

/// Traffic that was driven and looked at.
pub(crate) struct Driven {
    pub(crate) end: End,
    pub(crate) samples: traffic_client::stats::Samples,
    pub(crate) lanes_m: f64,
    pub(crate) engine: String,
    pub(crate) mode: Mode,
    pub(crate) arrivals: Option<sim::Arrivals>,
}

/// Why the traffic was not looked at any longer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum End {
    TimeOver,
    /// Ctrl-C, SIGTERM or SIGHUP.
    Interrupted,
    /// The trajectories have as many rows as they may.
    RowLimit,
}

/// Drives the traffic of a scenario, and writes where everybody was.
fn drive(
    args: &Args,
    out: &OutFolder,
    scenario: &Scenario,
    seed: u64,
    stop: &AtomicBool,
) -> Result<Driven, Failure> {
    let road = Arc::new(scenario.load_road().map_err(Failure::input)?);
    let mut scenario = scenario.clone();
    scenario.traffic.native.scene_radius_m = road.length_m().max(1.0);
    scenario.traffic.replay.scene_radius_m = road.length_m().max(1.0);
    let geometry = Geometry::default();
    let sumo = (scenario.traffic.source == TrafficKind::Sumo).then(|| out.begin("sumo"));
    let sumo = sumo.transpose()?;
    let mut traffic =
        Traffic::new(&scenario, seed, &road, geometry, sumo.as_deref()).map_err(Failure::input)?;
    let recorded_s = match scenario.traffic.source {
        TrafficKind::Replay => {
            Some(sim::recording_of(&scenario).map_err(Failure::input)?.duration_s() - LOOK_S)
        }
        _ => None,
    };
    let duration_s = args.duration.or(recorded_s).unwrap_or(DURATION_S);
    let ego = in_the_middle(&road);
    let (mut observer, mut rows) = (Observer::default(), Vec::new());
    let mut end = End::TimeOver;
    let stages = Stages::start();
    for k in 0..=(duration_s / LOOK_S) as i64 {
        if stop.load(Ordering::Relaxed) {
            end = End::Interrupted;
            break;
        }
        let now = Time::from_seconds(k as f64 * LOOK_S);
        let scene = traffic.advance(now, &ego).map_err(Failure::work)?;
        let mut scene = scene.clone();
        scene.neighbours.retain(|n| n.class != VehicleClass::Barrier);
        if rows.len() + scene.neighbours.len() > MOST_ROWS {
            output::note(&format!(
                "traffic: ended at {} s, trajectories have {MOST_ROWS} rows at most",
                now.seconds()
            ));
            end = End::RowLimit;
            break;
        }
        observer.look(&scene, &road);
        if k % 20 == 0 {
            stages.show(&format!("driving traffic: {:.0} of {duration_s:.0} s", now.seconds()));
        }
        rows.extend(scene.neighbours.iter().map(|n| Row {
            id: n.id,
            time_s: now.seconds(),
            x_m: n.x_m,
            y_m: n.y_m,
            yaw_rad: Some(n.yaw_rad),
            speed_m_s: Some(n.speed_m_s),
            length_m: Some(n.length_m()),
            width_m: Some(n.width_m),
            class: Some(n.class),
        }));
    }
    stages.finish();
    if !rows.is_empty() {
        let recording = Recording::from_rows("trajectories", Frame::Map, rows, LOOK_S)
            .map_err(Failure::work)?;
        let bytes = to_parquet(&recording).map_err(Failure::work)?;
        out.write("trajectories.parquet", bytes)?;
    }
    let manifest = traffic.manifest();
    let text = manifest.to_toml().map_err(Failure::work)?;
    out.write("traffic.manifest.toml", text)?;
    Ok(Driven {
        end,
        samples: observer.samples,
        lanes_m: traffic_client::calibrate::lanes_m(&road),
        engine: manifest.engine,
        mode: traffic.mode(),
        arrivals: traffic.arrivals(),
    })
}

/// Somebody to look from, who is not there.
fn in_the_middle(road: &Road) -> EgoState {
    let s_m = 0.5 * road.length_m();
    let at = road.at(s_m, 0.0);
    EgoState { s_m, x_m: at.x_m, y_m: at.y_m, yaw_rad: at.heading_rad, ..EgoState::default() }
}

/// The scenario with free traffic like that of the recordings, on the road, with the boundary and
/// with a seed that flows as counted in the first one, and the drivers of bounded traffic; both also
/// written, as `calibrated.toml` and `calibrated-drivers.toml`.
fn calibrated(
    args: &Args,
    out: &OutFolder,
    scenario: Scenario,
    learned: &Measured,
) -> Result<(Scenario, TrafficConfig), Failure> {
    let seed = scenario.run.seed;
    let effort = Effort { generations: args.generations, seed, ..Effort::default() };
    // Judged later with traffic that was not driven in the search.
    let base = scenario.traffic.demand(seed ^ SEARCH_SEED);
    let lessons: Vec<Lesson<'_>> = learned
        .recordings
        .iter()
        .zip(&learned.roads)
        .zip(&learned.each)
        .map(|((recording, road), samples)| Lesson { recording, road, samples })
        .collect();
    let (Some(first), Some(file)) = (lessons.first(), learned.files.first()) else {
        return Err(Failure::Input("--calibrate: no recording".to_owned()));
    };
    let stages = Stages::start();
    stages.show("calibrating the drivers");
    let found = calibrate(&lessons, &base, effort).map_err(Failure::input)?;
    let free = found.free_traffic(first).map_err(Failure::input)?;
    stages.show("looking for seeds that flow as counted");
    let own_seed = TrafficConfig { seed, ..free.clone() };
    let driven = drives_as_counted(first, &own_seed, effort.trial_s, RejectionSampling::default());
    let seeds: Vec<u64> = driven.map_err(Failure::input)?.iter().map(|(seed, _)| *seed).collect();
    stages.finish();
    let drivers = TrafficConfig { seed, ..found.config.clone() };
    let mut scenario = scenario;
    let mut of_drivers = scenario.clone();
    of_drivers.name = format!("{}-calibrated-drivers", scenario.name);
    of_drivers.traffic.native = drivers.clone();
    of_drivers.traffic.family = None;
    let text = toml::to_string(&of_drivers).map_err(Failure::work)?;
    out.write("calibrated-drivers.toml", text)?;
    scenario.name = format!("{}-calibrated", scenario.name);
    scenario.description = format!(
        "Native drivers calibrated to {} recordings: weighted distance {:.3} in bounded and {:.3} in \
         free traffic after {} trials. These seeds flow as counted in the first: {}.",
        learned.recordings.len(),
        found.distance,
        found.free_distance,
        found.trials,
        seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
    );
    scenario.run.seed = seeds.first().copied().unwrap_or(seed);
    scenario.road = format!("recording:{}", args.lanes);
    scenario.ego.s_m = scenario.ego.s_m.min(0.5 * first.road.length_m());
    let traffic = &mut scenario.traffic;
    (traffic.source, traffic.family, traffic.mode) = (TrafficKind::Native, None, None);
    let absolute = std::fs::canonicalize(file).map_err(|e| Failure::file(file, e))?;
    traffic.replay.file = Some(absolute.display().to_string());
    traffic.replay.carriageway = args.carriageway.into();
    traffic.native = TrafficConfig { seed: scenario.run.seed, ..free };
    let text = toml::to_string(&scenario).map_err(Failure::work)?;
    out.write("calibrated.toml", text)?;
    scenario.traffic.mode = Some(Mode::Pure);
    Ok((scenario, drivers))
}
