//! A session that a running server is asked for.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use sim::Scenario;

use super::{Begin, Claim, Pace, Place, Runs, State, channel, first_world, setting};
use crate::dashboard::{Metrics, Shared};
use crate::failure::Failure;
use crate::listeners::Listeners;
use crate::output;

/// What a session is to be.
pub(crate) struct Wanted {
    pub(crate) scenario: Scenario,
    pub(crate) seed: u64,
    pub(crate) state: State,
    pub(crate) pace: Pace,
    /// `direct` or `bus`.
    pub(crate) vehicle: String,
}

/// Builds the world, and starts the session's thread. The session is there until somebody ends it.
///
/// # Errors
/// [`Failure::Input`]: the world cannot be built; [`Failure::Work`]: nothing can be recorded.
pub(crate) fn start(
    wanted: &Wanted,
    runs: &Path,
    claim: Claim,
    metrics: &Arc<Metrics>,
) -> Result<Arc<Shared>, Failure> {
    let Wanted { scenario, seed, state, pace, vehicle } = wanted;
    let place = Place::In(runs.to_owned());
    let out = place.of_first(*seed, scenario, false)?;
    let world = first_world(scenario, *seed, &out)?;
    let (handle, asked) = channel(scenario, *seed, None);
    let stop = Arc::new(AtomicBool::new(false));
    let shared =
        Shared::new(claim.id(), setting(&world), handle.clone(), metrics, Arc::clone(&stop));
    let runs = Runs {
        place,
        vehicle: vehicle.clone(),
        pace: *pace,
        stays: true,
        listeners: Listeners::default(),
        shared: Some(Arc::clone(&shared)),
        handle,
        stop,
    };
    let first = Begin { world, seed: *seed, state: *state, out, waiting: None };
    let first = runs.prepare(first, asked)?;
    claim.fill(&shared);
    #[expect(clippy::disallowed_methods, reason = "the shell owns the session's thread")]
    std::thread::spawn(move || {
        if let Err(failure) = runs.drive_all(first) {
            output::error_line(&format!("session {}: {}", claim.id(), failure.line()));
        }
        drop(claim);
    });
    Ok(shared)
}
