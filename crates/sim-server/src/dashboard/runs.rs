//! `/api/v1/runs`: what sessions have left, seen again, compared, downloaded, removed.

use std::path::PathBuf;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, HeaderValue, Method, Request, StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use tempfile::TempDir;
use tower_http::services::ServeFile;
use utoipa::{IntoParams, ToSchema};

use super::hub::Hub;
use super::playback::Playback;
use super::{api, problem, run_report};
use crate::failure::Failure;
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};
use crate::run_folder::FoundRun;

/// Frames of one answer, at most.
const MAX_FRAMES: usize = 600;

/// A run that a session has left, or is leaving.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct RunObject {
    schema: u32,
    /// Name of the run.
    name: String,
    /// When its recording was written to last, s since 1970.
    written_unix_s: f64,
    recording_bytes: u64,
    /// It is being recorded.
    recording: bool,
    /// Its summary; null before its end, and after a crash.
    #[schema(value_type = Option<Object>)]
    summary: Option<()>,
}

/// The runs of a server.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct RunList {
    schema: u32,
    runs: Vec<RunObject>,
}

fn object(hub: &Hub, run: &FoundRun) -> Value {
    json!({
        "schema": SCHEMA, "version": VERSION, "git_revision": GIT_REVISION,
        "name": run.name, "written_unix_s": run.written_unix_s,
        "recording_bytes": run.recording_bytes, "recording": hub.is_recording(run),
        "summary": run.summary,
    })
}

/// The runs, the newest first, 1,000 at most.
#[utoipa::path(get, path = "/api/v1/runs", responses((status = 200, body = RunList)))]
pub(super) async fn list(State(hub): State<Arc<Hub>>) -> Response {
    let found = tokio::task::spawn_blocking(move || {
        hub.runs.runs().iter().map(|run| object(&hub, run)).collect::<Vec<Value>>()
    });
    match found.await {
        Ok(runs) => {
            api::json(StatusCode::OK, json!({ "schema": SCHEMA, "runs": runs }).to_string())
        }
        Err(broken) => problem::failed(&broken.to_string()),
    }
}

/// One run.
#[utoipa::path(get, path = "/api/v1/runs/{run}", params(("run" = String, Path, description = "Name of a run")), responses((status = 200, body = RunObject)))]
pub(super) async fn one(State(hub): State<Arc<Hub>>, Path(name): Path<String>) -> Response {
    match hub.runs.find(&name) {
        Some(run) => api::json(StatusCode::OK, object(&hub, &run).to_string()),
        None => problem::no_run(&name),
    }
}

/// Removes a run's files.
#[utoipa::path(delete, path = "/api/v1/runs/{run}", params(("run" = String, Path, description = "Name of a run")), responses((status = 204)))]
pub(super) async fn remove(State(hub): State<Arc<Hub>>, Path(name): Path<String>) -> Response {
    let Some(run) = hub.runs.find(&name) else { return problem::no_run(&name) };
    if hub.is_recording(&run) {
        return problem::run_is_recording(&name);
    }
    match run.remove() {
        Ok(()) => StatusCode::NO_CONTENT.into_response(),
        Err(failure) => problem::failed(&failure.line()),
    }
}

/// The recording, MCAP; whole or a range of bytes. Of a run that is being recorded its finished
/// part, as a whole file.
#[utoipa::path(get, path = "/api/v1/runs/{run}/recording", params(("run" = String, Path, description = "Name of a run")), responses((status = 200, body = String, content_type = "application/octet-stream")))]
pub(super) async fn recording(
    State(hub): State<Arc<Hub>>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Response {
    let Some(run) = hub.runs.find(&name) else { return problem::no_run(&name) };
    let (file, _folder) = if hub.is_recording(&run) {
        let Ok(_place) = hub.heavy.try_acquire() else { return problem::busy() };
        match tokio::task::spawn_blocking(move || finished_part(&run)).await {
            Ok(Ok((file, folder))) => (file, Some(folder)),
            Ok(Err(failure)) => return problem::unusable(&without(&failure, &hub)),
            Err(broken) => return problem::failed(&broken.to_string()),
        }
    } else {
        (run.recording(), None)
    };
    let mut response = served(&file, headers).await;
    let named = HeaderValue::from_str(&format!("attachment; filename=\"{name}.mcap\""));
    if let Ok(named) = named {
        response.headers_mut().insert(header::CONTENT_DISPOSITION, named);
    }
    response
}

/// What is whole of a file that is being written, in a folder that goes when nobody reads it.
fn finished_part(run: &FoundRun) -> Result<(PathBuf, TempDir), Failure> {
    let folder = tempfile::Builder::new().prefix("tractrix-part-").tempdir();
    let folder = folder.map_err(|e| Failure::Work(format!("a folder for the copy: {e}")))?;
    let part = folder.path().join("part.mcap");
    recording::recover_into(&run.recording(), &part)?;
    Ok((part, folder))
}

/// A file, or the range of it that was asked for.
pub(super) async fn served(file: &std::path::Path, headers: HeaderMap) -> Response {
    let mut request = Request::new(Body::empty());
    *request.method_mut() = Method::GET;
    for name in [header::RANGE, header::IF_RANGE] {
        if let Some(value) = headers.get(&name) {
            request.headers_mut().insert(name, value.clone());
        }
    }
    match ServeFile::new(file).try_call(request).await {
        Ok(response) => response.map(Body::new),
        Err(_) => problem::not_found("the file"),
    }
}

fn without(failure: &Failure, hub: &Hub) -> String {
    failure.line().replace(&format!("{}/", hub.runs.path().display()), "")
}

/// The frames of a run that is over, kept as long as somebody looks.
async fn played(hub: &Arc<Hub>, name: &str) -> Result<Arc<Playback>, Box<Response>> {
    let Some(run) = hub.runs.find(name) else { return Err(problem::no_run(name).into()) };
    if hub.is_recording(&run) {
        return Err(problem::run_is_recording(name).into());
    }
    let mut loaded = hub.playbacks.lock().await;
    if let Some(playback) = loaded.find(&run) {
        return Ok(playback);
    }
    let (file, of) = (run.recording(), name.to_owned());
    match tokio::task::spawn_blocking(move || Playback::load(&file, &of)).await {
        Ok(Ok(playback)) => Ok(loaded.keep(&run, playback)),
        Ok(Err(failure)) => Err(problem::unusable(&without(&failure, hub)).into()),
        Err(broken) => Err(problem::failed(&broken.to_string()).into()),
    }
}

/// The road that a run drove, and the truck's lengths.
#[utoipa::path(get, path = "/api/v1/runs/{run}/road", params(("run" = String, Path, description = "Name of a run")), responses((status = 200, body = Object)))]
pub(super) async fn road(State(hub): State<Arc<Hub>>, Path(name): Path<String>) -> Response {
    match played(&hub, &name).await {
        Ok(playback) => api::json(StatusCode::OK, playback.setting.clone()),
        Err(refused) => *refused,
    }
}

/// Columns over the distance of a run that is over; its first and last time; whether its commands
/// come out again (`ticks_different` is 0).
#[utoipa::path(get, path = "/api/v1/runs/{run}/strip", params(("run" = String, Path, description = "Name of a run")), responses((status = 200, body = Object)))]
pub(super) async fn strip(State(hub): State<Arc<Hub>>, Path(name): Path<String>) -> Response {
    let playback = match played(&hub, &name).await {
        Ok(playback) => playback,
        Err(refused) => return *refused,
    };
    let body = json!({
        "schema": SCHEMA, "kind": "strip", "first": 0, "span_s": playback.span_s(),
        "ticks_different": playback.ticks_different,
    });
    api::json(StatusCode::OK, api::with(body, &playback.strip).to_string())
}

/// A stretch of time.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct Stretch {
    /// Simulation time, s.
    from_s: f64,
    /// Simulation time, s.
    to_s: f64,
}

/// Frames of a run that is over, as a viewer of the run had them, four a second; 600 at most.
#[utoipa::path(get, path = "/api/v1/runs/{run}/frames", params(("run" = String, Path, description = "Name of a run"), Stretch), responses((status = 200, body = Object)))]
pub(super) async fn frames(
    State(hub): State<Arc<Hub>>,
    Path(name): Path<String>,
    stretch: Result<Query<Stretch>, QueryRejection>,
) -> Response {
    let Query(Stretch { from_s, to_s }) = match stretch {
        Ok(stretch) => stretch,
        Err(why) => return problem::wrong_query(&why.body_text()),
    };
    match played(&hub, &name).await {
        Ok(playback) => {
            let frames = playback.frames(from_s, to_s, MAX_FRAMES).join(",");
            let body = format!("{{\"schema\":{SCHEMA},\"frames\":[{frames}]}}");
            api::json(StatusCode::OK, body)
        }
        Err(refused) => *refused,
    }
}

/// A page with what the run's summary says and its course, all in one file.
#[utoipa::path(get, path = "/api/v1/runs/{run}/report", params(("run" = String, Path, description = "Name of a run")), responses((status = 200, body = String, content_type = "text/html")))]
pub(super) async fn report(State(hub): State<Arc<Hub>>, Path(name): Path<String>) -> Response {
    let Some(run) = hub.runs.find(&name) else { return problem::no_run(&name) };
    match played(&hub, &name).await {
        Ok(playback) => Html(run_report::page_of(&run, &playback)).into_response(),
        Err(refused) => *refused,
    }
}

/// Two runs.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub(super) struct Pair {
    /// Name of a run.
    a: String,
    /// Name of another one.
    b: String,
}

/// Whether two runs are the same bit for bit, or the first tick and value in which they differ.
#[utoipa::path(get, path = "/api/v1/compare", params(Pair), responses((status = 200, body = Object)))]
pub(super) async fn compare(
    State(hub): State<Arc<Hub>>,
    pair: Result<Query<Pair>, QueryRejection>,
) -> Response {
    let Query(Pair { a, b }) = match pair {
        Ok(pair) => pair,
        Err(why) => return problem::wrong_query(&why.body_text()),
    };
    let found = |name: &str| hub.runs.find(name).ok_or_else(|| Box::new(problem::no_run(name)));
    let (one, other) = match (found(&a), found(&b)) {
        (Ok(one), Ok(other)) => (one, other),
        (Err(refused), _) | (_, Err(refused)) => return *refused,
    };
    let Ok(_place) = hub.heavy.try_acquire() else { return problem::busy() };
    let compared = tokio::task::spawn_blocking(move || {
        crate::replayed::compare(&one.recording(), &other.recording())
    });
    match compared.await {
        Ok(Ok(compared)) => {
            let body = json!({
                "schema": SCHEMA, "a": a, "b": b, "ticks": compared.ticks,
                "ticks_different": compared.differing, "first_difference": compared.first,
                "other_scene_s": compared.other_scene_s,
                "more_ticks": { "a": compared.more[0], "b": compared.more[1] },
            });
            api::json(StatusCode::OK, body.to_string())
        }
        Ok(Err(failure)) => problem::unusable(&without(&failure, &hub)),
        Err(broken) => problem::failed(&broken.to_string()),
    }
}
