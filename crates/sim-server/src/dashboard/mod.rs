//! The live dashboard: an HTTP and WebSocket server on the loopback interface with its page.
//!
//! The world's thread owns a [`Publisher`], which leaves the strip plots' columns and events in
//! [`Shared`] and hands what a frame is made of to an encoder's thread, which leaves the latest
//! frame there; neither waits for a viewer. Each viewer takes the latest frame when it
//! can (frames between are lost to it) and all columns since its last visit (none are lost).

mod access;
mod ahead;
mod api;
mod assets;
mod bus;
mod connections;
mod encoder;
mod events;
mod frame;
mod gate;
mod hub;
mod jobs;
mod library;
mod metrics;
mod new_session;
mod openapi;
mod playback;
mod problem;
mod publisher;
mod road_view;
mod run_report;
mod runs;
mod server;
mod sessions;
mod socket;
mod strip;

use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::Instant;

pub(crate) use access::{AccessArgs, is_this_computer};
pub(crate) use api::carry_out;
pub(crate) use hub::Hub;
pub(crate) use metrics::Metrics;
pub(crate) use publisher::Publisher;
pub(crate) use server::{Dashboard, bind};

use self::events::EventLog;
use self::metrics::SessionMetrics;
use self::strip::Strip;
use crate::session::Handle;

/// What a session's threads leave for its viewers.
pub(crate) struct Shared {
    /// The session's id.
    id: Arc<str>,
    /// The latest frame.
    frame: watch::Sender<Published>,
    /// The last frames.
    frames: Mutex<VecDeque<(u64, Arc<str>)>>,
    events: Mutex<EventLog>,
    /// Columns of the strip plots since the start.
    strip: Mutex<Strip>,
    /// The summary so far as JSON.
    summary: Mutex<Arc<str>>,
    /// What does not change during a run.
    setting: Mutex<Setting>,
    /// To the session.
    handle: Handle,
    metrics: SessionMetrics,
    /// Ends the session between two ticks.
    pub(crate) stop: Arc<AtomicBool>,
    /// When somebody asked for the session last (wall time).
    asked: Mutex<Instant>,
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

/// Frames that are kept, at most: ten seconds of them.
const MAX_FRAMES: usize = 200;

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
    pub(crate) fn new(
        id: &Arc<str>,
        setting: Setting,
        handle: Handle,
        metrics: &Arc<Metrics>,
        stop: Arc<AtomicBool>,
    ) -> Arc<Self> {
        Arc::new(Self {
            id: Arc::clone(id),
            frame: watch::Sender::default(),
            frames: Mutex::default(),
            events: Mutex::default(),
            strip: Mutex::default(),
            summary: Mutex::new(Arc::from("{}")),
            setting: Mutex::new(setting),
            handle,
            metrics: metrics.of_session(id),
            stop,
            asked: Mutex::new(Instant::now()),
        })
    }

    /// Somebody asks for the session.
    fn ask(&self) {
        *self.asked.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    /// How long nobody has asked for it, nor looked at it.
    pub(crate) fn idle(&self) -> Duration {
        if self.metrics.viewers.get() > 0 {
            self.ask();
        }
        self.asked.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }

    /// The session's id.
    pub(crate) fn id(&self) -> &str {
        &self.id
    }

    /// Another run begins: what is left of the former one goes.
    pub(crate) fn begin(&self, setting: Setting) {
        *self.setting.lock().unwrap_or_else(PoisonError::into_inner) = setting;
        *self.strip() = Strip::default();
        *self.summary() = Arc::from("{}");
    }

    /// Leaves a frame for the viewers.
    fn publish(&self, json: Arc<str>, is_last: bool) {
        let mut number = 0;
        self.frame.send_modify(|published| {
            number = published.number + 1;
            *published = Published { json: Arc::clone(&json), number, is_last };
        });
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        if frames.len() == MAX_FRAMES {
            frames.pop_front();
        }
        frames.push_back((number, json));
    }

    /// Frames from this number on that are still here, and the number of the next one.
    fn frames_since(&self, number: u64) -> (Vec<Arc<str>>, u64) {
        let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let wanted = frames.iter().filter(|(n, _)| *n >= number);
        let next = frames.back().map_or(0, |(n, _)| n + 1);
        (wanted.map(|(_, json)| Arc::clone(json)).collect(), next)
    }

    fn events(&self) -> MutexGuard<'_, EventLog> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner)
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
