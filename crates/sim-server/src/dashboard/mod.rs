//! The live dashboard: an HTTP and WebSocket server on the loopback interface with its page.
//!
//! The world's thread owns a [`Publisher`], which leaves the latest frame and the strip plots'
//! columns in [`Shared`]; it never waits for a viewer. Each viewer takes the latest frame when it
//! can (frames between are lost to it) and all columns since its last visit (none are lost).

mod ahead;
mod api;
mod assets;
mod connections;
mod frame;
mod gate;
mod metrics;
mod openapi;
mod problem;
mod publisher;
mod road_view;
mod server;
mod sessions;
mod socket;
mod strip;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{Semaphore, watch};

#[cfg(feature = "foxglove")]
pub(crate) use api::carry_out;
pub(crate) use publisher::Publisher;
pub(crate) use server::{Dashboard, bind};

use self::metrics::Metrics;
use self::strip::Strip;
use crate::session::Handle;

/// What the world's thread leaves for the viewers.
pub(crate) struct Shared {
    /// The latest frame.
    frame: watch::Sender<Published>,
    /// Columns of the strip plots since the start.
    strip: Mutex<Strip>,
    /// The summary so far as JSON.
    summary: Mutex<Arc<str>>,
    /// What does not change during a run.
    setting: Mutex<Setting>,
    /// To the session.
    handle: Handle,
    metrics: Metrics,
    /// Places for viewers.
    viewers: Arc<Semaphore>,
}

/// A frame, and what a viewer must know about it without reading it.
#[derive(Clone, Default)]
struct Published {
    /// As JSON; empty before the first tick.
    json: Arc<str>,
    /// Frames before it.
    number: u64,
    /// It is the last one of its run.
    is_last: bool,
}

/// Viewers at once, at most.
const MAX_VIEWERS: usize = 16;

/// What does not change during a run.
#[derive(Clone)]
pub(crate) struct Setting {
    /// The road as JSON.
    pub(crate) road: Arc<str>,
    /// The report of the diagnosis that the truck comes from, as a page.
    pub(crate) report: Option<Arc<str>>,
}

impl Shared {
    /// Nothing published yet.
    pub(crate) fn new(setting: Setting, handle: Handle) -> Arc<Self> {
        Arc::new(Self {
            frame: watch::Sender::default(),
            strip: Mutex::default(),
            summary: Mutex::new(Arc::from("{}")),
            setting: Mutex::new(setting),
            handle,
            metrics: Metrics::new(),
            viewers: Arc::new(Semaphore::new(MAX_VIEWERS)),
        })
    }

    /// Another run begins: what is left of the former one goes.
    pub(crate) fn begin(&self, setting: Setting) {
        *self.setting.lock().unwrap_or_else(PoisonError::into_inner) = setting;
        *self.strip() = Strip::default();
        *self.summary() = Arc::from("{}");
    }

    fn setting(&self) -> Setting {
        self.setting.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn strip(&self) -> MutexGuard<'_, Strip> {
        self.strip.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn summary(&self) -> MutexGuard<'_, Arc<str>> {
        self.summary.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

pub(crate) use road_view::road_json;
