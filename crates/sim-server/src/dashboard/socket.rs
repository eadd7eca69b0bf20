//! `/ws`: frames at 20 Hz and the strip plots' new rows, to one viewer.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use serde::Serialize;

use super::strip::Strip;
use super::{Published, Shared, problem};
use crate::provenance::SCHEMA;

/// New rows of the strip plots are sent at most this often, in frames.
const FRAMES_PER_STRIP: u32 = 10;
/// A viewer that takes longer for one message is dropped.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// A viewer has nothing to say.
const MAX_INCOMING_BYTES: usize = 4_096;
/// A viewer is asked so often whether it is still there,
const PING_PERIOD: Duration = Duration::from_secs(10);
/// and has this time to answer.
const SILENCE: Duration = Duration::from_secs(30);

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
    let Ok(place) = Arc::clone(&shared.viewers).try_acquire_owned() else {
        return problem::too_many_viewers();
    };
    let ws = ws.max_message_size(MAX_INCOMING_BYTES).max_frame_size(MAX_INCOMING_BYTES);
    ws.on_upgrade(move |socket| async move {
        shared.metrics.viewers.inc();
        let viewer = Viewer { socket, shared: Arc::clone(&shared), rows_sent: 0, last_frame: None };
        viewer.serve().await;
        shared.metrics.viewers.dec();
        drop(place);
    })
}

struct Viewer {
    socket: WebSocket,
    shared: Arc<Shared>,
    rows_sent: usize,
    /// Number of the last frame that was sent.
    last_frame: Option<u64>,
}

impl Viewer {
    /// Serves until the viewer leaves, is too slow, or the run's sender is gone.
    async fn serve(mut self) {
        let mut frames = self.shared.frame.subscribe();
        frames.mark_changed();
        let mut count = 0_u32;
        let mut ping = tokio::time::interval(PING_PERIOD);
        let silence = tokio::time::sleep(SILENCE);
        tokio::pin!(silence);
        loop {
            tokio::select! {
                incoming = self.socket.recv() => {
                    if !matches!(incoming, Some(Ok(_))) {
                        return;
                    }
                    silence.as_mut().reset(tokio::time::Instant::now() + SILENCE);
                }
                () = &mut silence => return,
                _ = ping.tick() => {
                    if !self.send(Message::Ping(Bytes::new())).await {
                        return;
                    }
                }
                changed = frames.changed() => {
                    if changed.is_err() {
                        return;
                    }
                    let frame = frames.borrow_and_update().clone();
                    if !frame.json.is_empty() && !self.send_frame(&frame).await {
                        return;
                    }
                    let due = count.is_multiple_of(FRAMES_PER_STRIP);
                    count = count.wrapping_add(1);
                    if (due || frame.is_last) && !self.send_rows().await {
                        return;
                    }
                }
            }
        }
    }

    /// A frame, and before it how many the viewer was too slow for.
    async fn send_frame(&mut self, frame: &Published) -> bool {
        let lost = lost_since(self.last_frame.replace(frame.number), frame.number);
        if lost > 0 {
            self.shared.metrics.lost_frames.inc_by(lost);
            let told = serde_json::json!({ "schema": SCHEMA, "kind": "lost", "frames": lost });
            if !self.send(Message::Text(told.to_string().into())).await {
                return false;
            }
        }
        self.send(Message::Text((&*frame.json).into())).await
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
            Ok(text) => self.send(Message::Text(text.into())).await,
            Err(_) => false,
        }
    }

    async fn send(&mut self, message: Message) -> bool {
        matches!(tokio::time::timeout(SEND_TIMEOUT, self.socket.send(message)).await, Ok(Ok(())))
    }
}

/// Frames between the last one that was sent and this one.
fn lost_since(last: Option<u64>, number: u64) -> u64 {
    last.map_or(0, |last| number.saturating_sub(last + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_between_two_that_were_sent_are_lost() {
        assert_eq!(lost_since(None, 900), 0, "what came before a viewer was not meant for it");
        assert_eq!(lost_since(Some(900), 901), 0);
        assert_eq!(lost_since(Some(900), 900), 0, "the last frame once more");
        assert_eq!(lost_since(Some(900), 904), 3);
    }
}
