//! `/ws`: frames, the strip plots' new rows and events, to one viewer; its commands and answers.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::Uri;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::Instant;

use super::hub::Hub;
use super::strip::Strip;
use super::{Published, Shared, api, problem};
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};
use crate::session::{self, DEFAULT, Refused, Wish};

/// New rows of the strip plots are sent at most this often, in frames.
const FRAMES_PER_STRIP: u32 = 10;
/// A viewer that takes longer for one message is dropped.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// A viewer says a line at a time.
const MAX_INCOMING_BYTES: usize = 4_096;
/// Commands of one viewer under way, at most.
const MAX_COMMANDS: usize = 8;
/// Frames a second that a viewer may ask for.
const MIN_RATE_HZ: f64 = 0.1;
const MAX_RATE_HZ: f64 = 20.0;
/// Frames come every 50 ms: one that is due within half of that is due now.
const HALF_FRAME: Duration = Duration::from_millis(25);
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

pub(super) async fn upgrade(
    State(hub): State<Arc<Hub>>,
    uri: Uri,
    ws: WebSocketUpgrade,
) -> Response {
    let named = uri.query().and_then(|query| query.strip_prefix("session="));
    let id = named.unwrap_or(DEFAULT);
    let Some(shared) = hub.sessions.get(id) else { return problem::no_session(id) };
    shared.ask();
    let Ok(place) = Arc::clone(&hub.viewers).try_acquire_owned() else {
        return problem::too_many_viewers();
    };
    let ws = ws.max_message_size(MAX_INCOMING_BYTES).max_frame_size(MAX_INCOMING_BYTES);
    ws.on_upgrade(move |socket| async move {
        shared.metrics.viewers.inc();
        let (viewer, answered) = Viewer::new(socket, Arc::clone(&shared));
        viewer.serve(answered).await;
        shared.metrics.viewers.dec();
        drop(place);
    })
}

/// What a viewer gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
enum Channel {
    Frames,
    Strip,
    Events,
}

/// What a viewer says.
#[derive(Deserialize)]
#[serde(tag = "action", rename_all = "snake_case", deny_unknown_fields)]
enum Said {
    Subscribe {
        channel: Channel,
        /// Frames a second of wall time, 20 at most.
        rate_hz: Option<f64>,
    },
    Unsubscribe {
        channel: Channel,
    },
}

struct Viewer {
    socket: WebSocket,
    shared: Arc<Shared>,
    channels: BTreeSet<Channel>,
    /// Wall time between two frames.
    period: Duration,
    frame_due: Instant,
    rows_sent: usize,
    events_sent: u64,
    /// Number of the last frame that was sent, or was not to be sent.
    last_frame: Option<u64>,
    /// Answers to its commands.
    answers: mpsc::Sender<Value>,
    /// Places for commands under way.
    commands: Arc<Semaphore>,
}

impl Viewer {
    fn new(socket: WebSocket, shared: Arc<Shared>) -> (Self, mpsc::Receiver<Value>) {
        let (answers, answered) = mpsc::channel(MAX_COMMANDS);
        let viewer = Self {
            socket,
            shared,
            channels: [Channel::Frames, Channel::Strip, Channel::Events].into(),
            period: Duration::ZERO,
            frame_due: Instant::now(),
            rows_sent: 0,
            events_sent: 0,
            last_frame: None,
            answers,
            commands: Arc::new(Semaphore::new(MAX_COMMANDS)),
        };
        (viewer, answered)
    }

    /// Serves until the viewer leaves, is too slow, or the run's sender is gone.
    async fn serve(mut self, mut answered: mpsc::Receiver<Value>) {
        let mut frames = self.shared.frame.subscribe();
        frames.mark_changed();
        let mut count = 0_u32;
        let mut ping = tokio::time::interval(PING_PERIOD);
        let silence = tokio::time::sleep(SILENCE);
        tokio::pin!(silence);
        if !self.say(&self.hello()).await {
            return;
        }
        loop {
            let goes_on = tokio::select! {
                incoming = self.socket.recv() => {
                    silence.as_mut().reset(Instant::now() + SILENCE);
                    match incoming {
                        Some(Ok(Message::Text(text))) => self.hear(&text).await,
                        Some(Ok(Message::Close(_)) | Err(_)) | None => false,
                        Some(Ok(_)) => true,
                    }
                }
                () = &mut silence => false,
                _ = ping.tick() => self.send(Message::Ping(Bytes::new())).await,
                Some(answer) = answered.recv() => self.say(&answer).await,
                changed = frames.changed() => {
                    if changed.is_err() {
                        return;
                    }
                    let frame = frames.borrow_and_update().clone();
                    let due = count.is_multiple_of(FRAMES_PER_STRIP) || frame.is_last;
                    count = count.wrapping_add(1);
                    self.send_frame(&frame).await
                        && self.send_events().await
                        && (!due || self.send_rows().await)
                }
            };
            if !goes_on {
                return;
            }
        }
    }

    /// What there is.
    fn hello(&self) -> Value {
        json!({
            "schema": SCHEMA, "kind": "hello", "version": VERSION, "git_revision": GIT_REVISION,
            "session": self.shared.id(), "channels": ["frames", "strip", "events"],
            "subscribed": self.channels, "rate_hz": MAX_RATE_HZ,
        })
    }

    /// A wish of the viewer, or a command to the session with an `id` of the viewer's own. A command
    /// is answered when it has acted; telemetry goes on until then.
    async fn hear(&mut self, text: &str) -> bool {
        let mut said: Value = serde_json::from_str(text).unwrap_or_default();
        let id = said.as_object_mut().and_then(|keys| keys.remove("id")).unwrap_or_default();
        let is_wish = matches!(said["action"].as_str(), Some("subscribe" | "unsubscribe"));
        if is_wish {
            let done = serde_json::from_value(said).map_err(|e| e.to_string());
            let answer = match done.and_then(|said| self.subscribe(&said)) {
                Ok(()) => json!({ "kind": "ack", "id": id, "subscribed": self.channels }),
                Err(why) => api::with(
                    json!({ "kind": "refused", "id": id }),
                    &problem::wrong_body_details(&why),
                ),
            };
            return self.say(&api::with(json!({ "schema": SCHEMA }), &answer)).await;
        }
        let refused = |id: &Value, why: &Value| {
            api::with(json!({ "schema": SCHEMA, "kind": "refused", "id": id }), why)
        };
        let wish = match Wish::from_json(said.to_string().as_bytes()) {
            Ok(wish) => wish,
            Err(why) => return self.say(&refused(&id, &problem::no_command_details(&why))).await,
        };
        let Ok(place) = Arc::clone(&self.commands).try_acquire_owned() else {
            return self.say(&refused(&id, &problem::refused_details(&Refused::TooMany))).await;
        };
        // Sent before the next one is read: commands act in the order in which they were said
        let handle = &self.shared.handle;
        let sent = api::command_of(handle, wish).await.and_then(|command| handle.send(command));
        let answers = self.answers.clone();
        tokio::spawn(async move {
            let acted = match sent {
                Ok(sent) => tokio::time::timeout(api::LONGEST_WAIT, session::answer(sent)).await,
                Err(why) => Ok(Err(why)),
            };
            let answer = match acted {
                Ok(Ok(acted)) => {
                    api::with(json!({ "schema": SCHEMA, "kind": "ack", "id": id }), &acted)
                }
                Ok(Err(why)) => refused(&id, &problem::refused_details(&why)),
                Err(_) => refused(&id, &problem::no_answer_details()),
            };
            // The viewer may have left
            let _ = answers.send(answer).await;
            drop(place);
        });
        true
    }

    fn subscribe(&mut self, said: &Said) -> Result<(), String> {
        match *said {
            Said::Subscribe { channel, rate_hz } => {
                if let Some(rate_hz) = rate_hz {
                    if channel != Channel::Frames || !(MIN_RATE_HZ..=MAX_RATE_HZ).contains(&rate_hz)
                    {
                        return Err(format!(
                            "rate_hz = {rate_hz}: expected {MIN_RATE_HZ} to {MAX_RATE_HZ}, for frames"
                        ));
                    }
                    self.period = Duration::from_secs_f64(1.0 / rate_hz);
                    self.frame_due = Instant::now();
                }
                self.channels.insert(channel);
            }
            Said::Unsubscribe { channel } => {
                self.channels.remove(&channel);
            }
        }
        Ok(())
    }

    /// A frame, and before it how many the viewer was too slow for.
    async fn send_frame(&mut self, frame: &Published) -> bool {
        let now = Instant::now();
        let is_due = now + HALF_FRAME >= self.frame_due || frame.is_last;
        let lost = lost_since(self.last_frame.replace(frame.number), frame.number);
        if frame.json.is_empty() || !is_due || !self.channels.contains(&Channel::Frames) {
            return true;
        }
        self.frame_due = (self.frame_due + self.period).max(now);
        if lost > 0 && self.period.is_zero() {
            self.shared.metrics.lost_frames.inc_by(lost);
            let told = json!({ "schema": SCHEMA, "kind": "lost", "frames": lost });
            if !self.say(&told).await {
                return false;
            }
        }
        self.send(Message::Text((&*frame.json).into())).await
    }

    async fn send_events(&mut self) -> bool {
        let (events, next) = self.shared.events().since(self.events_sent);
        self.events_sent = next;
        if events.is_empty() || !self.channels.contains(&Channel::Events) {
            return true;
        }
        self.say(&json!({ "schema": SCHEMA, "kind": "events", "events": events })).await
    }

    async fn send_rows(&mut self) -> bool {
        if !self.channels.contains(&Channel::Strip) {
            return true;
        }
        let first = {
            let strip = self.shared.strip();
            // Another run begins at its first row
            if strip.len() < self.rows_sent { 0 } else { self.rows_sent }
        };
        let rows = self.shared.strip().rows_from(first);
        if rows.len() == 0 {
            return true;
        }
        self.rows_sent = first + rows.len();
        let message = StripRows { schema: SCHEMA, kind: "strip", first, rows };
        match serde_json::to_string(&message) {
            Ok(text) => self.send(Message::Text(text.into())).await,
            Err(_) => false,
        }
    }

    async fn say(&mut self, what: &Value) -> bool {
        self.send(Message::Text(what.to_string().into())).await
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
