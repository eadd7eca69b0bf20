//! How the session is set, as parameters: all can be read, and what a command changes is written by
//! that command.

use std::sync::Arc;

use foxglove::WebSocketServerHandle;
use foxglove::websocket::{
    AnyClient, GetParametersResponder, Parameter, ParameterHandler, ParameterValue,
    SetParametersResponder,
};
use serde::Serialize;
use serde_json::{Map, Value};
use sim::Fault;
use tokio::runtime;

use super::commands::ask;
use crate::session::{Handle, Standing};

/// Faults are bool parameters behind this.
const FAULT: &str = "fault.";
/// Parameters of one request, at most; there are fewer.
const MOST: usize = 64;

/// The parameters of a session.
pub(super) struct Parameters {
    session: Handle,
    runtime: runtime::Handle,
}

impl Parameters {
    pub(super) const fn new(session: Handle, runtime: runtime::Handle) -> Self {
        Self { session, runtime }
    }
}

impl ParameterHandler for Parameters {
    fn get(
        &self,
        _viewer: AnyClient,
        names: Vec<String>,
        _request: Option<String>,
        responder: GetParametersResponder,
    ) {
        let wanted = |p: &Parameter| names.is_empty() || names.contains(&p.name);
        responder.respond(all(&self.session).into_iter().filter(wanted).collect());
    }

    fn set(
        &self,
        viewer: AnyClient,
        parameters: Vec<Parameter>,
        _request: Option<String>,
        responder: SetParametersResponder,
    ) {
        let session = self.session.clone();
        self.runtime.spawn(async move {
            if parameters.len() > MOST {
                viewer.send_warning(format!("more than {MOST} parameters: the first ones are set"));
            }
            for Parameter { name, value, .. } in parameters.iter().take(MOST).cloned() {
                if let Err(why) = set(&session, &name, value).await {
                    viewer.send_warning(format!("{}: {why}", shortened(&name)));
                }
            }
            // What they are now, also those that were refused
            let named = |p: &Parameter| parameters.iter().any(|set| set.name == p.name);
            responder.respond(all(&session).into_iter().filter(named).collect());
        });
    }
}

/// Tells viewers of what changes, whoever changes it, until the runtime ends.
pub(super) async fn tell(session: Handle, server: Arc<WebSocketServerHandle>) {
    let mut standing = session.standing();
    let mut told = all(&session);
    while standing.changed().await.is_ok() {
        let now = all(&session);
        let changed = now.iter().filter(|p| !told.contains(p)).cloned().collect();
        server.publish_parameter_values(changed);
        told = now;
    }
}

/// All parameters with their values; those of a run only once there is one.
fn all(session: &Handle) -> Vec<Parameter> {
    let Standing { state, controls } = session.standing().borrow().clone();
    let mut all = vec![
        Parameter::string("state", word(state)),
        Parameter::string("scenario", session.scenario().name.clone()),
        // Beyond what a number holds exactly
        Parameter::string("seed", session.seed().to_string()),
    ];
    let Some(now) = controls else { return all };
    all.extend([
        Parameter::string("pace", now.pace.to_string()),
        Parameter::float64("set_speed_m_s", now.set_speed_m_s),
        Parameter::string("decider", now.settings.decider),
        Parameter::string("speed_planner", word(now.settings.speed_planner)),
        Parameter::bool("driven_from_outside", now.settings.driven_from_outside),
    ]);
    all.extend(Fault::ALL.map(|fault| {
        let is_on = now.settings.faults.contains(&fault.word());
        Parameter::bool(format!("{FAULT}{}", fault.word()), is_on)
    }));
    all
}

/// Carries out the command that changes a parameter.
async fn set(session: &Handle, name: &str, value: Option<ParameterValue>) -> Result<(), String> {
    let value = value.ok_or_else(|| "it cannot be unset".to_owned())?;
    let value = serde_json::to_value(value).map_err(|e| e.to_string())?;
    let (action, keys) = match (name, value) {
        ("state", state) => match state.as_str() {
            Some("playing") => ("play", Map::new()),
            Some("paused") => ("pause", Map::new()),
            Some("stopped") => ("stop", Map::new()),
            _ => return Err(format!("{state}: expected playing, paused or stopped")),
        },
        ("pace", value) => ("pace", with("pace", value)),
        ("set_speed_m_s", value) => ("set_speed", with("speed_m_s", value)),
        ("decider", value) => ("set_decider", with("decider", value)),
        ("speed_planner", value) => ("set_speed_planner", with("speed_planner", value)),
        ("scenario" | "seed" | "driven_from_outside", _) => {
            return Err("it is read only".to_owned());
        }
        (name, value) => match name.strip_prefix(FAULT) {
            Some(fault) => {
                let mut keys = with("on", value);
                keys.insert("fault".to_owned(), fault.into());
                ("fault", keys)
            }
            None => return Err("there is no such parameter".to_owned()),
        },
    };
    ask(session.clone(), action, keys).await.map(drop)
}

fn with(key: &str, value: Value) -> Map<String, Value> {
    Map::from_iter([(key.to_owned(), value)])
}

/// A value's word in JSON.
fn word(of: impl Serialize) -> String {
    let word = serde_json::to_value(of).ok();
    word.as_ref().and_then(Value::as_str).unwrap_or_default().to_owned()
}

fn shortened(name: &str) -> String {
    name.chars().take(40).collect()
}
