//! `/api/v1/`: state, summary, road, health and control as JSON.

use std::sync::Arc;
use std::sync::mpsc::TrySendError;

use axum::body::Bytes;
use axum::extract::State;
use axum::extract::rejection::BytesRejection;
use axum::http::{Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use super::Shared;
use crate::driver::Control;
use crate::failure::one_line;
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};

fn json(status: StatusCode, body: String) -> Response {
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

/// The latest frame.
pub(super) async fn state(State(shared): State<Arc<Shared>>) -> Response {
    let frame = shared.frame.borrow().clone();
    if frame.is_empty() {
        let why = "no tick has been driven yet";
        return error(StatusCode::SERVICE_UNAVAILABLE, "no_tick_yet", why);
    }
    json(StatusCode::OK, frame.to_string())
}

/// The summary so far, the final one after the end.
pub(super) async fn summary(State(shared): State<Arc<Shared>>) -> Response {
    let summary = shared.summary().to_string();
    json(StatusCode::OK, summary)
}

/// The road's geometry and the truck's lengths.
pub(super) async fn road(State(shared): State<Arc<Shared>>) -> Response {
    json(StatusCode::OK, shared.road.to_string())
}

/// Says that the server answers.
pub(super) async fn health() -> Response {
    let body = serde_json::json!({
        "schema": SCHEMA, "status": "ok", "version": VERSION, "git_revision": GIT_REVISION,
    });
    json(StatusCode::OK, body.to_string())
}

/// Hands a control to the world's thread.
pub(super) async fn control(
    State(shared): State<Arc<Shared>>,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    let Ok(body) = body else { return body_not_read() };
    let control = match Control::from_json(&body) {
        Ok(control) => control,
        Err(e) => return error(StatusCode::BAD_REQUEST, e.code(), &e.to_string()),
    };
    if matches!(control, Control::LaneChange { .. }) && !shared.external_decider {
        let why = "the run decides on lane changes itself; start it with --decider external";
        return error(StatusCode::CONFLICT, "no_external_decider", why);
    }
    match shared.controls.try_send(control) {
        Ok(()) => json(StatusCode::ACCEPTED, format!("{{\"schema\":{SCHEMA}}}")),
        Err(TrySendError::Full(_)) => {
            error(StatusCode::TOO_MANY_REQUESTS, "too_many_controls", "too many controls at once")
        }
        Err(TrySendError::Disconnected(_)) => {
            error(StatusCode::CONFLICT, "run_ended", "the run has ended")
        }
    }
}
