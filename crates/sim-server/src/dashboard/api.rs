//! `/api/v1/`: state, summary, road, health and control as JSON.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::rejection::BytesRejection;
use axum::http::{Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use super::Shared;
use crate::failure::one_line;
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};
use crate::session::{self, Acted, Command, Handle, Refused, Wish};

pub(super) fn json(status: StatusCode, body: String) -> Response {
    (status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
}

/// A refusal: a word for programs and one for people.
fn error(status: StatusCode, code: &str, why: &str) -> Response {
    let body = serde_json::json!({ "schema": SCHEMA, "code": code, "error": one_line(why) });
    json(status, body.to_string())
}

/// A path that is not there.
pub(super) fn not_found(path: &str) -> Response {
    error(StatusCode::NOT_FOUND, "not_found", &format!("nothing at {path}"))
}

/// A session that is not there.
pub(super) fn no_session(id: &str) -> Response {
    let why = format!("no session {id:?}; there is \"{}\"", super::sessions::DEFAULT);
    error(StatusCode::NOT_FOUND, "no_session", &why)
}

/// A path that is there for another method.
pub(super) async fn wrong_method(method: Method, uri: Uri) -> Response {
    let why = format!("{} does not take {method}", uri.path());
    error(StatusCode::METHOD_NOT_ALLOWED, "method_not_allowed", &why)
}

/// A request from another web site.
pub(super) fn foreign() -> Response {
    error(StatusCode::FORBIDDEN, "foreign_page", "only pages of this server may ask")
}

/// A body that is too long, or broke off.
pub(super) fn body_not_read() -> Response {
    let why = "the body is too long, or broke off";
    error(StatusCode::PAYLOAD_TOO_LARGE, "body_not_read", why)
}

/// A body that did not arrive in time.
pub(super) fn body_too_slow() -> Response {
    error(StatusCode::REQUEST_TIMEOUT, "body_too_slow", "the body has not arrived in 10 s")
}

/// A body of another kind.
pub(super) fn not_json() -> Response {
    let why = "the body must be JSON: Content-Type: application/json";
    error(StatusCode::UNSUPPORTED_MEDIA_TYPE, "not_json", why)
}

/// One viewer more than there are places.
pub(super) fn too_many_viewers() -> Response {
    let why = format!("{} viewers look on already", super::MAX_VIEWERS);
    let mut response = error(StatusCode::TOO_MANY_REQUESTS, "too_many_viewers", &why);
    response.headers_mut().insert(header::RETRY_AFTER, header::HeaderValue::from_static("5"));
    response
}

/// The latest frame.
pub(super) async fn state(State(shared): State<Arc<Shared>>) -> Response {
    let frame = Arc::clone(&shared.frame.borrow().json);
    if frame.is_empty() { no_tick_yet() } else { json(StatusCode::OK, frame.to_string()) }
}

fn no_tick_yet() -> Response {
    error(StatusCode::SERVICE_UNAVAILABLE, "no_tick_yet", "no tick has been driven yet")
}

/// Says that there is a run to look at.
pub(super) async fn ready(State(shared): State<Arc<Shared>>) -> Response {
    if shared.frame.borrow().json.is_empty() {
        return no_tick_yet();
    }
    json(StatusCode::OK, serde_json::json!({ "schema": SCHEMA, "status": "ready" }).to_string())
}

/// Counts and times, OpenMetrics.
pub(super) async fn metrics(State(shared): State<Arc<Shared>>) -> Response {
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    ([(header::CONTENT_TYPE, kind)], shared.metrics.text()).into_response()
}

/// The summary so far, the final one after the end.
pub(super) async fn summary(State(shared): State<Arc<Shared>>) -> Response {
    let summary = shared.summary().to_string();
    json(StatusCode::OK, summary)
}

/// The road's geometry and the truck's lengths.
pub(super) async fn road(State(shared): State<Arc<Shared>>) -> Response {
    json(StatusCode::OK, shared.setting().road.to_string())
}

/// Says that the server answers.
pub(super) async fn health() -> Response {
    let body = serde_json::json!({
        "schema": SCHEMA, "status": "ok", "version": VERSION, "git_revision": GIT_REVISION,
    });
    json(StatusCode::OK, body.to_string())
}

/// Carries out a command, between two ticks; a step with `"wait": true` is answered when it is
/// driven.
pub(super) async fn control(
    State(shared): State<Arc<Shared>>,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    let Ok(body) = body else { return body_not_read() };
    let wish = match Wish::from_json(&body) {
        Ok(wish) => wish,
        Err(e) => return error(StatusCode::BAD_REQUEST, e.code(), &e.to_string()),
    };
    let answered = tokio::time::timeout(LONGEST_WAIT, carry_out(shared.handle.clone(), wish));
    match answered.await {
        Ok(Ok(acted)) => {
            let mut body = serde_json::json!({ "schema": SCHEMA });
            if let (Some(body), Ok(serde_json::Value::Object(acted))) =
                (body.as_object_mut(), serde_json::to_value(acted))
            {
                body.extend(acted);
            }
            json(StatusCode::OK, body.to_string())
        }
        Ok(Err(why)) => refusal(&why),
        Err(_) => {
            let why = "the session has not answered; what was asked for may still act";
            error(StatusCode::GATEWAY_TIMEOUT, "no_answer", why)
        }
    }
}

/// A million ticks at the speed of a slow machine.
const LONGEST_WAIT: Duration = Duration::from_secs(600);

async fn carry_out(handle: Handle, wish: Wish) -> Result<Acted, Refused> {
    let command = match wish {
        Wish::Command(command) => command,
        Wish::Reset { seed } => restart(handle.clone(), seed, None).await?,
        Wish::Stop => restart(handle.clone(), None, Some(session::State::Stopped)).await?,
    };
    handle.ask(command).await
}

/// A world is built where nobody waits.
async fn restart(
    handle: Handle,
    seed: Option<u64>,
    state: Option<session::State>,
) -> Result<Command, Refused> {
    let built = tokio::task::spawn_blocking(move || handle.reset(seed, state)).await;
    built.unwrap_or_else(|e| Err(Refused::Unusable(e.to_string())))
}

fn refusal(why: &Refused) -> Response {
    let (status, code) = match why {
        Refused::TooMany => (StatusCode::TOO_MANY_REQUESTS, "too_many_controls"),
        Refused::Ended => (StatusCode::CONFLICT, "run_ended"),
        Refused::WrongState { .. } => (StatusCode::CONFLICT, "wrong_state"),
        Refused::NoExternalDecider => (StatusCode::CONFLICT, "no_external_decider"),
        Refused::OutsideBus(_) => (StatusCode::CONFLICT, "outside_bus"),
        Refused::OneSumo => (StatusCode::CONFLICT, "one_sumo"),
        Refused::CutShort { .. } => (StatusCode::CONFLICT, "cut_short"),
        Refused::TooFar { .. } => (StatusCode::UNPROCESSABLE_ENTITY, "too_far"),
        Refused::Unusable(_) => (StatusCode::UNPROCESSABLE_ENTITY, "unusable"),
    };
    error(status, code, &why.to_string())
}
