//! What the protocol's crate complains of, on stderr: above all viewers that it refuses.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use log::{LevelFilter, Log, Metadata, Record};

use crate::output;

/// Complaints are said this often at most.
const PERIOD: Duration = Duration::from_secs(1);

/// When the last one was said.
struct Complaints(Mutex<Option<Instant>>);

static COMPLAINTS: Complaints = Complaints(Mutex::new(None));

/// From now on complaints are said.
pub(super) fn log() {
    // Another one stays where there is one already
    if log::set_logger(&COMPLAINTS).is_ok() {
        log::set_max_level(LevelFilter::Error);
    }
}

impl Log for Complaints {
    fn enabled(&self, about: &Metadata<'_>) -> bool {
        about.target().starts_with("foxglove")
    }

    fn log(&self, record: &Record<'_>) {
        if !self.enabled(record.metadata()) {
            return;
        }
        #[expect(clippy::disallowed_methods, reason = "complaints are limited in wall time")]
        let now = Instant::now();
        let Ok(mut last) = self.0.lock() else { return };
        if last.is_some_and(|last| now.saturating_duration_since(last) < PERIOD) {
            return;
        }
        *last = Some(now);
        let why = record.args().to_string();
        let hint = match why.contains("handshake failed") {
            true => " (a viewer must offer foxglove.sdk.v1; foxglove.websocket.v1 is too old)",
            false => "",
        };
        output::note(&format!("foxglove: {why}{hint}"));
    }

    fn flush(&self) {}
}
