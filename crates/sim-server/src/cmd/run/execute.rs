//! The shell of a run: server, signals, threads.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use sim::Scenario;

use super::Args;
use crate::dashboard::{self, Dashboard, Hub, Metrics, Shared};
use crate::failure::Failure;
use crate::listeners::Listeners;
use crate::output;
use crate::run_folder::RunFolder;
use crate::session::{self, Begin, DEFAULT, Pace, Place, Registry, Runs, State};

/// Viewers get this long to take the last frame before the server goes.
const LAST_FRAME_TIME: Duration = Duration::from_millis(200);

/// Drives the scenario as the options say.
pub(super) fn execute(args: &Args, seed: u64, scenario: &Scenario) -> Result<(), Failure> {
    let access = args.access.read()?;
    let listener = if args.headless { None } else { Some(dashboard::bind(&access, args.port)?) };
    let place = match &args.out {
        Some(folder) => Place::Named(folder.clone()),
        None => Place::In("runs".into()),
    };
    let out = place.of_first(seed, scenario, args.overwrite)?;
    let world = session::first_world(scenario, seed, &out)?;
    let outside_bus = args.vehicle.contains(':').then_some(args.vehicle.as_str());
    let (handle, asked) = session::channel(scenario, seed, outside_bus);
    let stop = Arc::new(AtomicBool::new(false));
    let (sessions, metrics) = (Registry::new(1), Metrics::new());
    let claim = sessions.claim(Some(DEFAULT));
    let shared = listener.is_some().then_some(claim.as_ref()).flatten().map(|claim| {
        let (setting, stop) = (session::setting(&world), Arc::clone(&stop));
        let shared = Shared::new(claim.id(), setting, handle.clone(), &metrics, stop);
        claim.fill(&shared);
        shared
    });
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(Failure::work)?;
    runtime.spawn(crate::signals::raise(Arc::clone(&stop)));
    let listeners = Listeners::start(super::options::networks(args), &handle, runtime.handle())?;
    let usual = if args.headless { Pace::Max } else { Pace::REALTIME };
    let runs = Runs {
        place,
        vehicle: args.vehicle.clone(),
        pace: args.pace.unwrap_or(usual),
        stays: args.keep_open,
        listeners,
        shared,
        handle,
        stop,
    };
    let first = Begin { world, seed, state: State::Playing, out, waiting: None };
    let first = runs.prepare(first, asked)?;
    let hub = if let Some(listener) = listener {
        let address = listener.local_addr().map_err(Failure::work)?;
        output::note(&format!("dashboard: http://{address}  (Ctrl-C ends the run)"));
        let folder = match &args.out {
            Some(folder) => RunFolder::Named(folder.clone()),
            None => RunFolder::Of("runs".into()),
        };
        let hub = Hub::new(sessions, metrics, folder, None, access);
        runtime.spawn(Dashboard::new(listener, Arc::clone(&hub)).serve());
        Some(hub)
    } else {
        None
    };
    let ended = runs.drive_all(first);
    if !args.headless || args.foxglove.is_some() {
        runtime.block_on(async { tokio::time::sleep(LAST_FRAME_TIME).await });
    }
    drop(claim);
    if let Some(hub) = hub {
        runtime.block_on(hub.end());
    }
    runtime.shutdown_background();
    let (summary, json, folder) = ended?;
    super::report::report(args.json, &summary, &json, &folder)
}
