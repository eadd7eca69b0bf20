//! The shell of a run: server, signals, threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use sim::{Scenario, TrafficKind, World};
use tokio::sync::Notify;

use super::Args;
use super::runs::{self, Begin, Runs};
use crate::dashboard::{self, Dashboard, Shared};
use crate::failure::Failure;
use crate::listeners::Listeners;
use crate::out_folder::OutFolder;
use crate::output;
use crate::session::{self, State};

/// Viewers get this long to take the last frame before the server goes.
const LAST_FRAME_TIME: Duration = Duration::from_millis(200);

/// Drives the scenario as the options say.
pub(super) fn execute(args: &Args, seed: u64, scenario: &Scenario) -> Result<(), Failure> {
    let listener = if args.headless { None } else { Some(dashboard::bind(args.port)?) };
    let folder = runs::out_folder(args, seed, scenario);
    let out = OutFolder::new(folder, args.overwrite, runs::RESULTS)?;
    let sumo = match scenario.traffic.source {
        TrafficKind::Sumo => out.begin("sumo")?,
        _ => out.path().join("sumo"),
    };
    let world = World::in_folder(scenario, seed, &sumo).map_err(Failure::input)?;
    let outside_bus = args.vehicle.contains(':').then_some(args.vehicle.as_str());
    let (handle, asked) = session::channel(scenario, seed, outside_bus);
    let shared = listener.is_some().then(|| Shared::new(runs::setting(&world), handle.clone()));
    let stop = Arc::new(AtomicBool::new(false));
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(Failure::work)?;
    let ending = Arc::new(Notify::new());
    runtime.spawn(raise_at_signal(Arc::clone(&stop), Arc::clone(&ending)));
    let listeners = Listeners::start(super::options::networks(args), &handle, runtime.handle())?;
    let runs = Runs { args, listeners, shared: shared.clone(), handle, stop };
    let first = Begin { world, seed, state: State::Playing, out, waiting: None };
    let first = runs.prepare(first, asked)?;
    if let (Some(listener), Some(shared)) = (listener, shared) {
        let address = listener.local_addr().map_err(Failure::work)?;
        output::note(&format!("dashboard: http://{address}  (Ctrl-C ends the run)"));
        runtime.spawn(Dashboard::new(listener, shared).serve());
    }
    let ended = runs.drive_all(first, &runtime, &ending);
    if !args.headless || args.foxglove.is_some() {
        runtime.block_on(async { tokio::time::sleep(LAST_FRAME_TIME).await });
    }
    runtime.shutdown_background();
    let (summary, json, folder) = ended?;
    super::report::report(args.json, &summary, &json, &folder)
}

/// A signal stops the run between two ticks, and ends the waiting of whoever waits for it.
async fn raise_at_signal(stop: Arc<AtomicBool>, ending: Arc<Notify>) {
    loop {
        crate::signals::stop_signal().await;
        stop.store(true, Ordering::Relaxed);
        ending.notify_one();
    }
}
