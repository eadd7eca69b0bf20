//! `process-replay RUN.mcap`: the recorded inputs through the stack again, every command compared.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use j1939::bus::Bus;
use j1939::steering::ExampleSteering;
use j1939::truck::BusTruck;
use planner::DriveError;
use recording::{BusCall, DriverWish, GivenStep, Inputs};
use serde::Serialize;
use tractrix_core::{Command, PoseSource, Time, Vehicle};

use crate::failure::Failure;
use crate::output;
use crate::progress::Stages;
use crate::provenance::Provenance;
use crate::replayed::{
    Again, Comparison, Difference, RecordedBus, RecordedPose, Setup, driver_setup,
};

/// Drives the stack again with what it was given in a recording, and compares every command bit for
/// bit. Exit code 1: something differs.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// The recording.
    pub(crate) file: PathBuf,
    /// What is driven: the stack from the truck's state (ego), or what reads and commands the truck
    /// over its bus and the stack, from the frames.
    #[arg(long, value_enum, default_value_t = From::Ego)]
    from: From,
    /// Changes a key of the stack's configuration (following.headway_s=1.5), as often as wanted.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The road, if it is no longer where it was.
    #[arg(long)]
    road: Option<String>,
    /// Prints one JSON object instead of a sentence.
    #[arg(long)]
    json: bool,
}

/// What is driven again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum From {
    /// The truck's driver on its bus and the stack.
    Frames,
    /// The stack.
    Ego,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    provenance: Provenance,
    from: From,
    ticks_compared: u64,
    ticks_different: u64,
    first_difference: Option<Difference>,
}

/// What drives the truck over its bus.
type Driver = BusTruck<RecordedBus, RecordedPose, ExampleSteering>;

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let stages = Stages::start();
    let compared = replay(args, &stages);
    stages.finish();
    let (provenance, Comparison { ticks, differing, first, .. }) = compared?;
    let different = first.as_ref().map(|d| {
        format!("; the first at tick {}, {} s: {}", d.tick, d.time_s, d.field)
            + &format!(" was {}, is {}", d.recorded, d.replayed)
    });
    if args.json {
        let report = Report {
            provenance,
            from: args.from,
            ticks_compared: ticks,
            ticks_different: differing,
            first_difference: first,
        };
        output::result(&serde_json::to_string(&report).map_err(Failure::work)?)?;
    } else {
        let more = different.as_deref().unwrap_or_default();
        output::result(&format!("{ticks} ticks compared, {differing} differences{more}"))?;
    }
    match different {
        Some(_) => Err(Failure::Work(format!("{}: the drive is another", args.file.display()))),
        None => Ok(()),
    }
}

fn replay(args: &Args, stages: &Stages) -> Result<(Provenance, Comparison), Failure> {
    let mut inputs = Inputs::open(&args.file, args.from == From::Frames)?;
    let about = inputs.about().clone();
    if let Some(time_s) = about.value("run", "continues_at_s") {
        let why = format!("it goes on from a snapshot at {time_s} s: its stack was not new then");
        return Err(Failure::file(&args.file, why));
    }
    let setup = Setup::new(&args.file, &about, &args.set, args.road.as_deref())?;
    let mut again = Again::new(&args.file, setup);
    let seed = about.value("run", "seed").and_then(|seed| seed.parse().ok());
    let mut comparison = Comparison::default();
    let mut driver: Option<Driver> = None;
    while let Some(mut step) = inputs.next_step()? {
        let (now, is_first) = (step.now, comparison.ticks == 0);
        let recorded = step.clone();
        let prepared = again.prepare(&mut step)?;
        if args.from == From::Frames && driver.is_none() {
            let (bus, pose) = (RecordedBus::default(), RecordedPose::of(&recorded));
            let setup = driver_setup(&args.file, &about)?;
            let new = setup.driver(bus, pose, prepared.limits.clone());
            driver = Some(new.map_err(Failure::input)?);
        }
        comparison.expect(recorded.clone());
        if let Some(driver) = &mut driver {
            if !read_bus(driver, &mut inputs, &recorded, is_first, args)? {
                output::note("the recording ends before the frames of its last steps");
                break;
            }
            let driven = prepared.drive_with(driver, &mut comparison);
            if let Err(DriveError::Command(why)) = driven {
                return Err(Failure::work(why));
            }
            if let Some(frame) = driver.bus().unheard_of.take() {
                let (id, data) = (frame.id, frame.data);
                let sent = format!("{id:08X}#{:016X}", u64::from_be_bytes(data));
                comparison.note(&recorded, "frame sent", "another or none", &sent);
            }
        } else {
            prepared.drive(&mut comparison);
        }
        if comparison.ticks.is_multiple_of(1000) {
            stages.show(&format!("{:.0} s compared", now.seconds()));
        }
    }
    if inputs.gap_notes() > 0 {
        output::note("compared up to the first gap: the recorder's disk was too slow there");
    }
    Ok((Provenance::of_seed(seed.unwrap_or_default()), comparison))
}

/// Gives the driver the reading of a step; those before the first one are made without a stack, as
/// they were. False: there are no more.
fn read_bus(
    driver: &mut Driver,
    inputs: &mut Inputs,
    step: &GivenStep,
    is_first: bool,
    args: &Args,
) -> Result<bool, Failure> {
    loop {
        let Some(call) = inputs.next_call()? else { return Ok(false) };
        let now = call.now;
        if now != step.now && (!is_first || now > step.now) {
            let at_s = step.now.seconds();
            return Err(Failure::file(&args.file, format!("the frames of {at_s} s are missing")));
        }
        begin(driver, call);
        *driver.pose_source() = RecordedPose::of(step);
        if now == step.now {
            return Ok(true);
        }
        if let Some(pose) = &mut driver.pose_source().0 {
            pose.time = now;
        }
        warm_up(driver, now)?;
    }
}

fn begin(driver: &mut Driver, call: BusCall) {
    match call.wish {
        DriverWish::None => {}
        DriverWish::Engage => driver.engage(),
        DriverWish::Disengage => driver.disengage(call.now),
        DriverWish::Stop => driver.stop(call.now),
    }
    driver.bus().begin(call);
}

/// A tick before the stack's first.
fn warm_up<B: Bus, P: PoseSource>(
    driver: &mut BusTruck<B, P, ExampleSteering>,
    now: Time,
) -> Result<(), Failure> {
    driver.ego(now).map_err(Failure::work)?;
    driver.command(now, &Command::default()).map_err(Failure::work)
}
