//! What viewers may ask: each command of the API as a service, and two as published messages. They
//! go through the door that all others use.

use std::sync::Arc;
use std::time::Duration;

use foxglove::Schema;
use foxglove::websocket::service::{Service, ServiceSchema};
use foxglove::websocket::{ChannelView, Client, ClientChannel, ServerListener, Status};
use serde_json::{Map, Value, json};
use tokio::runtime;

use super::channels::Channels;
use crate::dashboard::carry_out;
use crate::provenance::SCHEMA;
use crate::session::{Handle, Wish};

/// Services with the properties of their requests, JSON schema.
const SERVICES: [(&str, &str); 9] = [
    ("play", "{}"),
    ("pause", "{}"),
    ("stop", "{}"),
    ("step", r#"{"ticks": {"type": "integer", "minimum": 1, "default": 10}}"#),
    ("step_until", r#"{"time_s": {"type": "number", "minimum": 0}}"#),
    ("reset", r#"{"seed": {"type": "integer", "minimum": 0}}"#),
    ("pace", r#"{"pace": {"type": ["string", "number"], "default": "realtime"}}"#),
    ("set_speed", r#"{"speed_m_s": {"type": "number", "minimum": 0, "maximum": 40}}"#),
    ("lane_change", r#"{"to": {"type": "string", "enum": ["left", "right", "keep"]}}"#),
];
/// Properties of the answer.
const ACTED: &str = r#"{"type": "object", "properties": {"schema": {"type": "integer"},
    "tick": {"type": "integer"}, "time_s": {"type": "number"}, "state": {"type": "string"}}}"#;
/// Published messages that are commands: topic, action, and the key that `data` is the value of.
const TOPICS: [(&str, &str, &str); 2] = [
    ("/command/set_speed", "set_speed", "speed_m_s"),
    ("/command/lane_change", "lane_change", "to"),
];
/// Longest request, bytes.
const MAX_REQUEST: usize = 4096;
/// A million ticks at the speed of a slow machine.
const LONGEST_WAIT: Duration = Duration::from_secs(600);

/// The services of a session, named as the actions of `POST /api/v1/control`.
pub(super) fn services(session: &Handle) -> Vec<Service> {
    let service = |(action, properties): (&'static str, &str)| {
        let request = format!(r#"{{"type": "object", "properties": {properties}}}"#).into_bytes();
        let schema = ServiceSchema::new(format!("tractrix/{action}"))
            .with_request("json", Schema::new(format!("tractrix/{action}"), "jsonschema", request))
            .with_response("json", Schema::new("tractrix/acted", "jsonschema", ACTED.as_bytes()));
        let session = session.clone();
        Service::builder(format!("/{action}"), schema).async_handler_fn(move |request| {
            let session = session.clone();
            async move { answer(session, action, request.payload()).await }
        })
    };
    SERVICES.into_iter().map(service).collect()
}

/// Carries out a request; an empty one is one without keys. A step is answered when it is driven.
async fn answer(session: Handle, action: &str, request: &[u8]) -> Result<String, String> {
    let mut keys = match request {
        [] => Map::new(),
        text if text.len() > MAX_REQUEST => return Err(format!("more than {MAX_REQUEST} bytes")),
        text => serde_json::from_slice(text).map_err(|_| "not a JSON object".to_owned())?,
    };
    if action.starts_with("step") {
        keys.entry("wait").or_insert(Value::Bool(true));
    }
    ask(session, action, keys).await
}

/// Carries out a command of the API with these keys.
///
/// # Errors
/// The words of the API.
pub(super) async fn ask(
    session: Handle,
    action: &str,
    mut keys: Map<String, Value>,
) -> Result<String, String> {
    keys.insert("action".to_owned(), action.into());
    let wish = Wish::from_json(Value::Object(keys).to_string().as_bytes());
    let wish = wish.map_err(|e| e.to_string())?;
    let acted = tokio::time::timeout(LONGEST_WAIT, carry_out(session, wish)).await;
    let acted = acted.map_err(|_| "no answer in 10 minutes".to_owned())?;
    let acted = acted.map_err(|e| e.to_string())?;
    Ok(json!({
        "schema": SCHEMA, "tick": acted.tick, "time_s": acted.time_s, "state": acted.state,
    })
    .to_string())
}

/// Hears what viewers subscribe and publish.
pub(super) struct Commands {
    session: Handle,
    channels: Arc<Channels>,
    runtime: runtime::Handle,
}

impl Commands {
    pub(super) const fn new(
        session: Handle,
        channels: Arc<Channels>,
        runtime: runtime::Handle,
    ) -> Self {
        Self { session, channels, runtime }
    }
}

impl ServerListener for Commands {
    fn on_subscribe(&self, viewer: Client, channel: ChannelView<'_>) {
        self.channels.welcome(&viewer, channel.topic());
    }

    fn on_client_advertise(&self, viewer: Client, channel: &ClientChannel) {
        if let Err(why) = command_of(channel) {
            viewer.send_status(Status::warning(why));
        }
    }

    fn on_message_data(&self, viewer: Client, channel: &ClientChannel, payload: &[u8]) {
        let message = match payload.len() {
            ..=MAX_REQUEST => serde_json::from_slice::<Map<String, Value>>(payload).ok(),
            _ => None,
        };
        let data = message.and_then(|mut message| message.remove("data"));
        let Ok((action, key)) = command_of(channel) else { return };
        let Some(data) = data else {
            let why = format!("{}: expected {{\"data\": ...}}", channel.topic);
            return viewer.send_status(Status::warning(why));
        };
        let (session, topic) = (self.session.clone(), channel.topic.clone());
        self.runtime.spawn(async move {
            let keys = Map::from_iter([(key.to_owned(), data)]);
            if let Err(why) = ask(session, action, keys).await {
                viewer.send_status(Status::warning(format!("{topic}: {why}")));
            }
        });
    }
}

/// Action and key of a channel that a viewer publishes on.
fn command_of(channel: &ClientChannel) -> Result<(&'static str, &'static str), String> {
    let known = TOPICS.into_iter().find(|(topic, ..)| *topic == channel.topic);
    match known {
        Some((_, action, key)) if channel.encoding == "json" => Ok((action, key)),
        Some((topic, ..)) => Err(format!("{topic}: publish it as json, not {}", channel.encoding)),
        None => {
            let topics = TOPICS.map(|(topic, ..)| topic).join(", ");
            Err(format!("{} commands nothing; there are {topics}", channel.topic))
        }
    }
}
