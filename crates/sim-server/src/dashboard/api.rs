//! `/api/v1/`: state, summary, road, health and control as JSON.

use std::sync::Arc;
use std::sync::mpsc::TrySendError;

use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::Shared;
use crate::driver::Control;
use crate::failure::one_line;
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};

fn json(status: StatusCode, body: String) -> Response {
    (status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
}

fn error(status: StatusCode, why: &str) -> Response {
    json(status, serde_json::json!({ "schema": SCHEMA, "error": one_line(why) }).to_string())
}

/// The latest frame.
pub(super) async fn state(State(shared): State<Arc<Shared>>) -> Response {
    let frame = shared.frame.borrow().clone();
    if frame.is_empty() {
        return error(StatusCode::SERVICE_UNAVAILABLE, "no tick has been driven yet");
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
pub(super) async fn control(State(shared): State<Arc<Shared>>, body: String) -> Response {
    let control: Control = match serde_json::from_str(&body) {
        Ok(control) => control,
        Err(e) => return error(StatusCode::BAD_REQUEST, &e.to_string()),
    };
    match shared.controls.try_send(control) {
        Ok(()) => json(StatusCode::ACCEPTED, format!("{{\"schema\":{SCHEMA}}}")),
        Err(TrySendError::Full(_)) => error(StatusCode::TOO_MANY_REQUESTS, "too many controls"),
        Err(TrySendError::Disconnected(_)) => error(StatusCode::CONFLICT, "the run has ended"),
    }
}
