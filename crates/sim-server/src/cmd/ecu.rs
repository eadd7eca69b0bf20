//! `ecu`: the virtual truck alone on a bus, for whoever drives it from there.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Parser;
use sim::{Overrides, Plant, Scenario, Status};
use tractrix_core::Time;

use crate::cli::positive;
use crate::failure::Failure;
use crate::output;
use crate::signals::on_stop;

/// Puts the virtual truck on a bus, in wall time, and lets it be driven from there.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// A scenario file, or the name of a built-in one (`scenario list`): road, truck, traffic.
    #[arg(default_value = "highway")]
    scenario: String,
    /// The bus: can:IFACE or socketcand:HOST:PORT/IFACE.
    #[arg(long, value_name = "BUS")]
    bus: String,
    /// Seed of the traffic.
    #[arg(long)]
    seed: Option<u64>,
    /// Ends after so much wall time.
    #[arg(long, value_name = "S", value_parser = positive)]
    duration: Option<f64>,
}

/// Runs the command.
#[expect(clippy::disallowed_methods, reason = "the shell owns the clock")]
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut scenario = Scenario::named(&args.scenario).map_err(Failure::input)?;
    Overrides::default().apply(&mut scenario).map_err(Failure::of_option)?;
    let seed = scenario.seed(args.seed).map_err(Failure::input)?;
    let open = j1939::bus::open(&args.bus);
    let bus = open.map_err(|e| Failure::Input(format!("--bus {e}")))?;
    let mut plant = Plant::on_bus(&scenario, seed, bus).map_err(Failure::input)?;
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    on_stop(move |_| asked.store(true, Ordering::Relaxed))?;
    output::note(&format!(
        "the truck of {} is on {}; it is held until it is driven (Ctrl-C ends)",
        scenario.name, args.bus
    ));
    let tick = Duration::from_secs_f64(scenario.run.tick_s);
    let limit = args.duration.map_or(Duration::MAX, Duration::from_secs_f64);
    let (start, mut ticks, mut late) = (Instant::now(), 0_u32, 0_u64);
    let mut status = Status::Running;
    while status == Status::Running && !stop.load(Ordering::Relaxed) && start.elapsed() < limit {
        let due = tick.saturating_mul(ticks);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let now = Time(i64::try_from(due.as_nanos()).unwrap_or(i64::MAX));
        let wall = i64::try_from(start.elapsed().as_nanos()).unwrap_or(i64::MAX);
        status = plant.tick(now, Time(wall)).map_err(Failure::work)?;
        ticks = ticks.saturating_add(1);
        late += u64::from(start.elapsed() > due.saturating_add(tick));
    }
    let (s, ecu) = (plant.summary(), plant.ecu());
    let driven = match ecu.let_go() {
        Some(since) => format!("driven from {:.1} s on", since.seconds()),
        None => "not driven".to_owned(),
    };
    output::result(&format!(
        "{:.1} s on the bus, {driven}: {:.2} km, {} collisions, {} demands refused, {late} of \
         {ticks} ticks late",
        start.elapsed().as_secs_f64(),
        s.distance_m * 1e-3,
        s.collisions,
        ecu.refused()
    ))
}
