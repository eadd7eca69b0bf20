//! What all answers of the server come from.

use std::path::PathBuf;
use std::sync::Arc;

use axum::extract::{FromRequestParts, RawPathParams};
use axum::http::request::Parts;
use axum::response::Response;
use tokio::sync::{Mutex, Semaphore};

use super::access::Access;
use super::playback::Playbacks;
use super::{Metrics, Shared, problem};
use crate::jobs::Jobs;
use crate::run_folder::{FoundRun, RunFolder};
use crate::session::{DEFAULT, Registry};

/// Viewers at once, at most, of all sessions together.
pub(super) const MAX_VIEWERS: usize = 16;

/// The server's sessions, and what it may read and write.
pub(crate) struct Hub {
    pub(super) sessions: Arc<Registry>,
    pub(super) metrics: Arc<Metrics>,
    /// Places for viewers.
    pub(super) viewers: Arc<Semaphore>,
    /// What sessions have left, and where those that are asked for leave theirs.
    pub(super) runs: RunFolder,
    /// Files that scenarios from outside may name lie below.
    pub(super) assets: Option<PathBuf>,
    pub(super) access: Access,
    pub(super) jobs: Jobs,
    /// Runs that are seen again.
    pub(super) playbacks: Mutex<Playbacks>,
    /// Places for what reads a whole recording.
    pub(super) heavy: Semaphore,
}

/// Recordings that are read at once, at most.
const MAX_HEAVY: usize = 2;

impl Hub {
    /// A server of these sessions.
    pub(crate) fn new(
        sessions: Arc<Registry>,
        metrics: Arc<Metrics>,
        runs: RunFolder,
        assets: Option<PathBuf>,
        access: Access,
    ) -> Arc<Self> {
        let viewers = Arc::new(Semaphore::new(MAX_VIEWERS));
        Arc::new(Self {
            sessions,
            metrics,
            viewers,
            runs,
            assets,
            access,
            jobs: Jobs::new(),
            playbacks: Mutex::default(),
            heavy: Semaphore::new(MAX_HEAVY),
        })
    }

    /// Ends what would outlive the server.
    pub(crate) async fn end(&self) {
        self.jobs.end().await;
    }

    /// Whether a session is recording this run now.
    pub(super) fn is_recording(&self, run: &FoundRun) -> bool {
        self.sessions.all().iter().any(|session| {
            let (folder, recording) = session.handle.recording();
            recording && folder.is_some_and(|folder| folder == run.folder)
        })
    }
}

/// The session that a path names; a path without one means that of `run`.
pub(super) struct Of(pub(super) Arc<Shared>);

impl FromRequestParts<Arc<Hub>> for Of {
    type Rejection = Response;

    async fn from_request_parts(parts: &mut Parts, hub: &Arc<Hub>) -> Result<Self, Response> {
        let named = RawPathParams::from_request_parts(parts, hub).await.ok();
        let named = named.as_ref().and_then(|all| all.iter().find(|(key, _)| *key == "session"));
        let id = named.map_or(DEFAULT, |(_, id)| id);
        let session = hub.sessions.get(id).ok_or_else(|| problem::no_session(id))?;
        session.ask();
        Ok(Self(session))
    }
}
