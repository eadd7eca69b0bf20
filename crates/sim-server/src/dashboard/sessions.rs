//! `/api/v1/sessions`: which sessions there are, another one, and the end of one.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::rejection::BytesRejection;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use sim::TrafficKind;

use super::hub::{Hub, Of};
use super::new_session::{self, NewSession};
use super::openapi::{SessionList, SessionObject};
use super::{Shared, api, gate, problem};
use crate::failure::Failure;
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};
use crate::session::{self, Refused};

/// A session that is to end has this time to write its summary.
const LONGEST_END: Duration = Duration::from_secs(60);
/// How often it is looked for.
const LOOK: Duration = Duration::from_millis(20);

/// All sessions.
#[utoipa::path(get, path = "/api/v1/sessions", responses((status = 200, body = SessionList)))]
pub(super) async fn list(State(hub): State<Arc<Hub>>) -> Response {
    let sessions: Vec<Value> = hub.sessions.all().iter().map(|session| object(session)).collect();
    let body = json!({ "schema": SCHEMA, "most": hub.sessions.most(), "sessions": sessions });
    api::json(StatusCode::OK, body.to_string())
}

/// One session.
#[utoipa::path(get, path = "", params(("session" = String, Path, description = "Id of a session; `run` has `default`")), responses((status = 200, body = SessionObject)))]
pub(super) async fn one(Of(session): Of) -> Response {
    api::json(StatusCode::OK, object(&session).to_string())
}

/// Begins a session: a built-in scenario or a scenario's text, with changes. It records into a
/// folder of its own.
#[utoipa::path(post, path = "/api/v1/sessions", request_body = NewSession, responses((status = 201, body = SessionObject)))]
pub(super) async fn create(
    State(hub): State<Arc<Hub>>,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    if !gate::is_json(&headers) {
        return problem::not_json();
    }
    let Ok(body) = body else { return problem::body_not_read() };
    let wanted = match new_session::read(&body) {
        Ok(wanted) => wanted,
        Err(why) => return problem::wrong_body(&why),
    };
    let Some(claim) = hub.sessions.claim(None) else {
        return problem::too_many_sessions(hub.sessions.most());
    };
    let started = tokio::task::spawn_blocking(move || {
        let mut wanted = wanted.build().map_err(|why| Box::new(problem::unusable(&why)))?;
        new_session::keep_inside(&mut wanted.scenario, hub.assets.as_deref())
            .map_err(|why| Box::new(problem::outside(&why)))?;
        let is_sumo = |kind: TrafficKind| kind == TrafficKind::Sumo;
        let has_sumo = |s: &Arc<Shared>| is_sumo(s.handle.scenario().traffic.source);
        if is_sumo(wanted.scenario.traffic.source) && hub.sessions.all().iter().any(has_sumo) {
            return Err(Box::new(problem::refused(&Refused::SecondSumo)));
        }
        session::start(&wanted, hub.runs.path(), claim, &hub.metrics).map_err(|failure| {
            Box::new(match failure {
                Failure::Input(why) => problem::unusable(&without(&why, &hub)),
                Failure::Work(why) => problem::failed(&without(&why, &hub)),
            })
        })
    });
    match started.await {
        Ok(Ok(session)) => {
            let body = object(&session).to_string();
            let mut response = api::json(StatusCode::CREATED, body);
            let place = format!("/api/v1/sessions/{}", session.id);
            if let Ok(place) = HeaderValue::from_str(&place) {
                response.headers_mut().insert(header::LOCATION, place);
            }
            response
        }
        Ok(Err(refused)) => *refused,
        Err(broken) => problem::failed(&broken.to_string()),
    }
}

/// An answer names no place on this machine.
fn without(why: &str, hub: &Hub) -> String {
    let places = [Some(hub.runs.path()), hub.assets.as_deref()];
    places
        .into_iter()
        .flatten()
        .fold(why.to_owned(), |why, place| why.replace(&format!("{}/", place.display()), ""))
}

/// Ends a session between two ticks; its summary is written when the answer comes.
#[utoipa::path(delete, path = "", params(("session" = String, Path, description = "Id of a session; the end of `default` is that of the program")), responses((status = 204)))]
pub(super) async fn end(State(hub): State<Arc<Hub>>, Of(session): Of) -> Response {
    session.stop.store(true, Ordering::Relaxed);
    let id = Arc::clone(&session.id);
    drop(session);
    let gone = async {
        while hub.sessions.get(&id).is_some() {
            tokio::time::sleep(LOOK).await;
        }
    };
    match tokio::time::timeout(LONGEST_END, gone).await {
        Ok(()) => StatusCode::NO_CONTENT.into_response(),
        Err(_) => problem::no_answer(),
    }
}

fn object(session: &Shared) -> Value {
    let handle = &session.handle;
    let (folder, recording) = handle.recording();
    let run = folder.as_ref().and_then(|folder| folder.file_name()?.to_str());
    json!({
        "schema": SCHEMA, "version": VERSION, "git_revision": GIT_REVISION,
        "id": *session.id, "state": handle.state(), "scenario": handle.scenario().name,
        "seed": handle.seed(), "tick_s": handle.scenario().run.tick_s, "run": run,
        "recording": recording,
    })
}
