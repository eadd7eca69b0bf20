//! `/api/v1/sessions`: which sessions there are. One: the program's own.

use std::collections::HashMap;
use std::sync::Arc;

use axum::extract::{Path, Request, State};
use axum::http::StatusCode;
use axum::middleware::Next;
use axum::response::Response;
use serde_json::{Value, json};

use super::openapi::{SessionList, SessionObject};
use super::{Shared, api, problem};
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};

/// The session that the program starts with.
pub(super) const DEFAULT: &str = "default";

/// All sessions.
#[utoipa::path(get, path = "/api/v1/sessions", responses((status = 200, body = SessionList)))]
pub(super) async fn list(State(shared): State<Arc<Shared>>) -> Response {
    let body = json!({ "schema": SCHEMA, "sessions": [object(&shared)] });
    api::json(StatusCode::OK, body.to_string())
}

/// One session.
#[utoipa::path(get, path = "/api/v1/sessions/{session}", params(("session" = String, Path, description = "Id of a session: `default`")), responses((status = 200, body = SessionObject)))]
pub(super) async fn one(State(shared): State<Arc<Shared>>) -> Response {
    api::json(StatusCode::OK, object(&shared).to_string())
}

/// Answers for sessions that are not there.
pub(super) async fn known(
    Path(path): Path<HashMap<String, String>>,
    request: Request,
    next: Next,
) -> Response {
    match path.get("session").map(String::as_str) {
        Some(DEFAULT) => next.run(request).await,
        other => problem::no_session(other.unwrap_or_default()),
    }
}

fn object(shared: &Shared) -> Value {
    let handle = &shared.handle;
    json!({
        "schema": SCHEMA, "version": VERSION, "git_revision": GIT_REVISION,
        "id": DEFAULT, "state": handle.state(), "scenario": handle.scenario().name,
        "seed": handle.seed(), "tick_s": handle.scenario().run.tick_s,
    })
}
