//! `/ws`: frames at 20 Hz and the strip plots' new rows, to one viewer.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use serde::Serialize;

use super::Shared;
use super::strip::Strip;
use crate::provenance::SCHEMA;

/// New rows of the strip plots are sent at most this often, in frames.
const FRAMES_PER_STRIP: u32 = 10;
/// A viewer that takes longer for one message is dropped.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// New rows of the strip plots.
#[derive(Serialize)]
struct StripRows {
    schema: u32,
    kind: &'static str,
    /// Row number of the first row.
    first: usize,
    #[serde(flatten)]
    rows: Strip,
}

pub(super) async fn upgrade(State(shared): State<Arc<Shared>>, ws: WebSocketUpgrade) -> Response {
    ws.on_upgrade(
        move |socket| async move { Viewer { socket, shared, rows_sent: 0 }.serve().await },
    )
}

struct Viewer {
    socket: WebSocket,
    shared: Arc<Shared>,
    rows_sent: usize,
}

impl Viewer {
    /// Serves until the viewer leaves, is too slow, or the run's sender is gone.
    async fn serve(mut self) {
        let mut frames = self.shared.frame.subscribe();
        frames.mark_changed();
        let mut count = 0_u32;
        loop {
            tokio::select! {
                incoming = self.socket.recv() => {
                    if !matches!(incoming, Some(Ok(_))) {
                        return;
                    }
                }
                changed = frames.changed() => {
                    if changed.is_err() {
                        return;
                    }
                    let frame = frames.borrow_and_update().clone();
                    if !frame.is_empty() && !self.send(&frame).await {
                        return;
                    }
                    let due = count.is_multiple_of(FRAMES_PER_STRIP);
                    count = count.wrapping_add(1);
                    if (due || frame.contains("\"state\":\"finished\"")) && !self.send_rows().await {
                        return;
                    }
                }
            }
        }
    }

    async fn send_rows(&mut self) -> bool {
        let first = self.rows_sent;
        let rows = {
            let strip = self.shared.strip();
            if strip.len() <= first {
                return true;
            }
            strip.rows_from(first)
        };
        self.rows_sent += rows.len();
        let message = StripRows { schema: SCHEMA, kind: "strip", first, rows };
        match serde_json::to_string(&message) {
            Ok(text) => self.send(&text).await,
            Err(_) => false,
        }
    }

    async fn send(&mut self, text: &str) -> bool {
        let message = Message::Text(text.into());
        matches!(tokio::time::timeout(SEND_TIMEOUT, self.socket.send(message)).await, Ok(Ok(())))
    }
}
