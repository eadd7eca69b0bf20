//! `/api/v1/`: state, summary, road, health and control as JSON.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::rejection::BytesRejection;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::openapi::{ActedObject, CommandObject, FrameObject, Health};
use super::{Shared, gate, problem};
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};
use crate::session::{self, Acted, Command, Handle, Refused, Wish};

pub(super) fn json(status: StatusCode, body: String) -> Response {
    (status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
}

/// The latest frame.
#[utoipa::path(get, path = "/state", params(("session" = String, Path, description = "Id of a session: `default`")), responses((status = 200, body = FrameObject)))]
pub(super) async fn state(State(shared): State<Arc<Shared>>) -> Response {
    let frame = Arc::clone(&shared.frame.borrow().json);
    if frame.is_empty() { problem::no_tick_yet() } else { json(StatusCode::OK, frame.to_string()) }
}

/// Says that there is a run to look at.
#[utoipa::path(get, path = "/api/v1/ready", responses((status = 200, body = Health)))]
pub(super) async fn ready(State(shared): State<Arc<Shared>>) -> Response {
    if shared.frame.borrow().json.is_empty() {
        return problem::no_tick_yet();
    }
    json(StatusCode::OK, serde_json::json!({ "schema": SCHEMA, "status": "ready" }).to_string())
}

/// Counts and times, OpenMetrics.
#[utoipa::path(get, path = "/api/v1/metrics", responses((status = 200, body = String, content_type = "application/openmetrics-text")))]
pub(super) async fn metrics(State(shared): State<Arc<Shared>>) -> Response {
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    ([(header::CONTENT_TYPE, kind)], shared.metrics.text()).into_response()
}

/// The summary so far, the final one after the end.
#[utoipa::path(get, path = "/summary", params(("session" = String, Path, description = "Id of a session: `default`")), responses((status = 200, body = Object)))]
pub(super) async fn summary(State(shared): State<Arc<Shared>>) -> Response {
    let summary = shared.summary().to_string();
    json(StatusCode::OK, summary)
}

/// The road's geometry and the truck's lengths.
#[utoipa::path(get, path = "/road", params(("session" = String, Path, description = "Id of a session: `default`")), responses((status = 200, body = Object)))]
pub(super) async fn road(State(shared): State<Arc<Shared>>) -> Response {
    json(StatusCode::OK, shared.setting().road.to_string())
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
#[utoipa::path(post, path = "/control", params(("session" = String, Path, description = "Id of a session: `default`")), request_body = CommandObject, responses((status = 200, body = ActedObject)))]
pub(super) async fn control(
    State(shared): State<Arc<Shared>>,
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
            let mut body = serde_json::json!({ "schema": SCHEMA });
            if let (Some(body), Ok(serde_json::Value::Object(acted))) =
                (body.as_object_mut(), serde_json::to_value(acted))
            {
                body.extend(acted);
            }
            json(StatusCode::OK, body.to_string())
        }
        Ok(Err(why)) => problem::refused(&why),
        Err(_) => problem::no_answer(),
    }
}

/// A million ticks at the speed of a slow machine.
const LONGEST_WAIT: Duration = Duration::from_secs(600);

/// Carries out what was asked for.
///
/// # Errors
/// [`Refused`].
pub(crate) async fn carry_out(handle: Handle, wish: Wish) -> Result<Acted, Refused> {
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
