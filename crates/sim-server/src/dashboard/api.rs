//! `/api/v1/`: state, summary, road, health and control as JSON.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::rejection::{BytesRejection, QueryRejection};
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use tokio::task::JoinError;
use utoipa::IntoParams;

use super::hub::{Hub, Of};
use super::openapi::{ActedObject, CommandObject, FrameObject, Health};
use super::{Shared, gate, problem};
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};
use crate::session::{self, Acted, Command, DEFAULT, Handle, Refused, Wish};

/// How long a question for the state waits for the first frame: frames are made beside the run, and on
/// a loaded machine commands are answered before one is there.
const FIRST_FRAME: Duration = Duration::from_secs(2);

pub(super) fn json(status: StatusCode, body: String) -> Response {
    (status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
}

/// The latest frame.
#[utoipa::path(get, path = "/state", params(("session" = String, Path, description = "Id of a session; `run` has `default`")), responses((status = 200, body = FrameObject)))]
pub(super) async fn state(Of(shared): Of) -> Response {
    let mut frames = shared.frame.subscribe();
    let first = frames.wait_for(|frame| !frame.json.is_empty());
    match tokio::time::timeout(FIRST_FRAME, first).await {
        Ok(Ok(frame)) => json(StatusCode::OK, frame.json.to_string()),
        Ok(Err(_)) | Err(_) => problem::no_tick_yet(),
    }
}

/// Says that the server can be used: the run that it was started with, if it was, has begun.
#[utoipa::path(get, path = "/api/v1/ready", responses((status = 200, body = Health)))]
pub(super) async fn ready(State(hub): State<Arc<Hub>>) -> Response {
    let waits = |session: &Shared| session.frame.borrow().json.is_empty();
    if hub.sessions.get(DEFAULT).is_some_and(|session| waits(&session)) {
        return problem::no_tick_yet();
    }
    json(StatusCode::OK, serde_json::json!({ "schema": SCHEMA, "status": "ready" }).to_string())
}

/// Counts and times, OpenMetrics.
#[utoipa::path(get, path = "/api/v1/metrics", responses((status = 200, body = String, content_type = "application/openmetrics-text")))]
pub(super) async fn metrics(State(hub): State<Arc<Hub>>) -> Response {
    hub.metrics.sessions.set(i64::try_from(hub.sessions.count()).unwrap_or(i64::MAX));
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    ([(header::CONTENT_TYPE, kind)], hub.metrics.text()).into_response()
}

/// The summary so far, the final one after the end.
#[utoipa::path(get, path = "/summary", params(("session" = String, Path, description = "Id of a session; `run` has `default`")), responses((status = 200, body = Object)))]
pub(super) async fn summary(Of(shared): Of) -> Response {
    let summary = shared.summary().to_string();
    json(StatusCode::OK, summary)
}

/// The road's geometry and the truck's lengths.
#[utoipa::path(get, path = "/road", params(("session" = String, Path, description = "Id of a session; `run` has `default`")), responses((status = 200, body = Object)))]
pub(super) async fn road(Of(shared): Of) -> Response {
    json(StatusCode::OK, shared.setting().road.to_string())
}

/// From which number on.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct Since {
    /// `next` of the answer before; without it all that are here.
    #[param(nullable = false)]
    since: Option<u64>,
}

/// The number that is asked from; 0: all.
fn number(since: Result<Query<Since>, QueryRejection>) -> Result<u64, Box<Response>> {
    match since {
        Ok(Query(Since { since })) => Ok(since.unwrap_or(0)),
        Err(why) => Err(Box::new(problem::wrong_query(&why.body_text()))),
    }
}

/// The last frames, 20 a second of wall time; 200 are kept.
#[utoipa::path(get, path = "/frames", params(("session" = String, Path, description = "Id of a session; `run` has `default`"), Since), responses((status = 200, body = Object)))]
pub(super) async fn frames(
    Of(shared): Of,
    since: Result<Query<Since>, QueryRejection>,
) -> Response {
    let since = match number(since) {
        Ok(since) => since,
        Err(refused) => return *refused,
    };
    let (frames, next) = shared.frames_since(since);
    let body = format!(
        "{{\"schema\":{SCHEMA},\"next\":{next},\"frames\":[{}]}}",
        frames.iter().map(|frame| &**frame).collect::<Vec<_>>().join(",")
    );
    json(StatusCode::OK, body)
}

/// What happened: runs, states, manoeuvres, refusals, the guard, settings and faults, wheels off the
/// road, collisions; the last 1,000.
#[utoipa::path(get, path = "/events", params(("session" = String, Path, description = "Id of a session; `run` has `default`"), Since), responses((status = 200, body = Object)))]
pub(super) async fn events(
    Of(shared): Of,
    since: Result<Query<Since>, QueryRejection>,
) -> Response {
    let since = match number(since) {
        Ok(since) => since,
        Err(refused) => return *refused,
    };
    let (events, next) = shared.events().since(since);
    let body = serde_json::json!({ "schema": SCHEMA, "next": next, "events": events });
    json(StatusCode::OK, body.to_string())
}

/// The truck and the vehicles around it at the latest tick.
#[utoipa::path(get, path = "/entities", params(("session" = String, Path, description = "Id of a session; `run` has `default`")), responses((status = 200, body = Object)))]
pub(super) async fn entities(Of(shared): Of) -> Response {
    let bodies = shared.handle.bodies();
    let body = serde_json::json!({
        "schema": SCHEMA, "time_s": bodies.time.seconds(), "ego": bodies.ego,
        "vehicles": bodies.others,
    });
    json(StatusCode::OK, body.to_string())
}

/// Says that the server answers.
#[utoipa::path(get, path = "/api/v1/health", responses((status = 200, body = Health)))]
pub(super) async fn health() -> Response {
    let body = serde_json::json!({
        "schema": SCHEMA, "status": "ok", "version": VERSION, "git_revision": GIT_REVISION,
    });
    json(StatusCode::OK, body.to_string())
}

/// Carries out a command, between two ticks; a step with `"wait": true` is answered when it is
/// driven.
#[utoipa::path(post, path = "/control", params(("session" = String, Path, description = "Id of a session; `run` has `default`")), request_body = CommandObject, responses((status = 200, body = ActedObject)))]
pub(super) async fn control(
    Of(shared): Of,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    if !gate::is_json(&headers) {
        return problem::not_json();
    }
    let Ok(body) = body else { return problem::body_not_read() };
    let wish = match Wish::from_json(&body) {
        Ok(wish) => wish,
        Err(why) => return problem::no_command(&why),
    };
    let answered = tokio::time::timeout(LONGEST_WAIT, carry_out(shared.handle.clone(), wish));
    match answered.await {
        Ok(Ok(acted)) => {
            let body = with(serde_json::json!({ "schema": SCHEMA }), &acted);
            json(StatusCode::OK, body.to_string())
        }
        Ok(Err(why)) => problem::refused(&why),
        Err(_) => problem::no_answer(),
    }
}

/// An object with the keys of another one.
pub(super) fn with(mut body: Value, more: &impl Serialize) -> Value {
    if let (Some(body), Ok(Value::Object(more))) =
        (body.as_object_mut(), serde_json::to_value(more))
    {
        body.extend(more);
    }
    body
}

/// A million ticks at the speed of a slow machine.
pub(super) const LONGEST_WAIT: Duration = Duration::from_secs(600);

/// Carries out what was asked for.
///
/// # Errors
/// [`Refused`].
pub(crate) async fn carry_out(handle: Handle, wish: Wish) -> Result<Acted, Refused> {
    let command = command_of(&handle, wish).await?;
    handle.ask(command).await
}

/// The command that carries out what was asked for; another world is built first.
///
/// # Errors
/// [`Refused`].
pub(super) async fn command_of(handle: &Handle, wish: Wish) -> Result<Command, Refused> {
    Ok(match wish {
        Wish::Command(command) => command,
        Wish::Reset { seed } => restart(handle.clone(), seed, None).await?,
        Wish::Restore(name) => {
            let handle = handle.clone();
            built(tokio::task::spawn_blocking(move || handle.restore(&name)).await)?
        }
        Wish::Stop => restart(handle.clone(), None, Some(session::State::Stopped)).await?,
    })
}

/// A world is built where nobody waits.
async fn restart(
    handle: Handle,
    seed: Option<u64>,
    state: Option<session::State>,
) -> Result<Command, Refused> {
    built(tokio::task::spawn_blocking(move || handle.reset(seed, state)).await)
}

fn built(done: Result<Result<Command, Refused>, JoinError>) -> Result<Command, Refused> {
    done.unwrap_or_else(|e| Err(Refused::Unusable(e.to_string())))
}
