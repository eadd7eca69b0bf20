//! `/api/v1/plan`, `/api/v1/diagnose` and `/api/v1/jobs`: work that takes longer than an answer may.

use std::ffi::OsString;
use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use dynamics::TruckParameters;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::hub::Hub;
use super::{api, gate, problem, runs};
use crate::jobs::Job;
use crate::provenance::{GIT_REVISION, SCHEMA, VERSION};

/// A trip to plan, as `sim-server plan` takes it.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewPlan {
    /// A built-in truck, or a file among the server's assets.
    truck: String,
    /// A built-in road, or a file among the server's assets.
    road: String,
    mass_kg: f64,
    set_speed_m_s: f64,
    speed_min_m_s: f64,
    speed_max_m_s: f64,
    #[schema(nullable = false)]
    trip_time_s: Option<f64>,
    #[serde(default)]
    eco_roll: bool,
}

/// Drives to diagnose, as `sim-server diagnose` takes them.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewDiagnosis {
    /// A built-in truck, or a file among the server's assets.
    truck: String,
    /// Folder of measured drives among the server's assets; or
    #[schema(nullable = false)]
    drives: Option<String>,
    /// a run of this server.
    #[schema(nullable = false)]
    run: Option<String>,
    /// Folder of drives that are in order, among the assets.
    #[schema(nullable = false)]
    baseline: Option<String>,
    /// Names of the drives on which the gain is measured.
    #[serde(default)]
    hold_out: Vec<String>,
}

/// A job.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct JobObject {
    schema: u32,
    id: String,
    /// `plan` or `diagnose`.
    kind: String,
    /// `queued`, `running`, `done`, `failed`, `cancelled` or `timed_out`.
    status: String,
    /// What it left: `plan.json`, `report.html`, ...
    files: Vec<String>,
}

/// The jobs of a server.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct JobList {
    schema: u32,
    jobs: Vec<JobObject>,
}

fn object(job: &Job) -> Value {
    let body = json!({
        "schema": SCHEMA, "version": VERSION, "git_revision": GIT_REVISION,
        "id": job.id, "kind": job.kind, "asked": job.asked, "files": job.files(),
    });
    api::with(body, &job.progress())
}

/// Plans a trip: a job, whose files are those of `sim-server plan`.
#[utoipa::path(post, path = "/api/v1/plan", request_body = NewPlan, responses((status = 202, body = JobObject)))]
pub(super) async fn plan(
    State(hub): State<Arc<Hub>>,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    let (wanted, asked) = match read::<NewPlan>(&headers, body) {
        Ok(read) => read,
        Err(refused) => return *refused,
    };
    let is_builtin = |road: &str| road.starts_with("builtin:");
    let (truck, road) =
        match (truck(&hub, &wanted.truck), file(&hub, "road", &wanted.road, is_builtin)) {
            (Ok(truck), Ok(road)) => (truck, road),
            (Err(why), _) | (_, Err(why)) => return problem::outside(&why),
        };
    let mut arguments = vec![option("truck", truck), option("road", road)];
    let numbers = [
        ("mass-kg", Some(wanted.mass_kg)),
        ("set-speed-m-s", Some(wanted.set_speed_m_s)),
        ("speed-min-m-s", Some(wanted.speed_min_m_s)),
        ("speed-max-m-s", Some(wanted.speed_max_m_s)),
        ("trip-time-s", wanted.trip_time_s),
    ];
    for (name, value) in numbers {
        arguments.extend(value.map(|value| option(name, value.to_string())));
    }
    arguments.extend(wanted.eco_roll.then(|| "--eco-roll".into()));
    begin(&hub, "plan", arguments, asked)
}

/// Diagnoses drives: a job, whose files are those of `sim-server diagnose`.
#[utoipa::path(post, path = "/api/v1/diagnose", request_body = NewDiagnosis, responses((status = 202, body = JobObject)))]
pub(super) async fn diagnose(
    State(hub): State<Arc<Hub>>,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    let (wanted, asked) = match read::<NewDiagnosis>(&headers, body) {
        Ok(read) => read,
        Err(refused) => return *refused,
    };
    let drives = match (&wanted.drives, &wanted.run) {
        (Some(folder), None) => file(&hub, "drives", folder, |_| false),
        (None, Some(name)) => match hub.runs.find(name) {
            Some(run) if hub.is_recording(&run) => return problem::run_is_recording(name),
            Some(run) => Ok(run.recording().into_os_string()),
            None => return problem::no_run(name),
        },
        _ => return problem::wrong_body("either drives or run is to be given"),
    };
    let baseline = wanted
        .baseline
        .as_ref()
        .map(|folder| file(&hub, "baseline", folder, |_| false))
        .transpose();
    let (truck, drives, baseline) = match (truck(&hub, &wanted.truck), drives, baseline) {
        (Ok(truck), Ok(drives), Ok(baseline)) => (truck, drives, baseline),
        (Err(why), ..) | (_, Err(why), _) | (.., Err(why)) => return problem::outside(&why),
    };
    let mut arguments = vec![option("truck", truck), option("drives", drives)];
    arguments.extend(baseline.map(|baseline| option("baseline", baseline)));
    if !wanted.hold_out.is_empty() {
        arguments.push(option("hold-out", wanted.hold_out.join(",")));
    }
    begin(&hub, "diagnose", arguments, asked)
}

/// The jobs, the newest first; 32 are kept.
#[utoipa::path(get, path = "/api/v1/jobs", responses((status = 200, body = JobList)))]
pub(super) async fn list(State(hub): State<Arc<Hub>>) -> Response {
    let jobs: Vec<Value> = hub.jobs.all().iter().map(|job| object(job)).collect();
    api::json(StatusCode::OK, json!({ "schema": SCHEMA, "jobs": jobs }).to_string())
}

/// A job: how far it is.
#[utoipa::path(get, path = "/api/v1/jobs/{job}", params(("job" = String, Path, description = "Id of a job")), responses((status = 200, body = JobObject)))]
pub(super) async fn one(State(hub): State<Arc<Hub>>, Path(id): Path<String>) -> Response {
    match hub.jobs.get(&id) {
        Some(job) => api::json(StatusCode::OK, object(&job).to_string()),
        None => problem::no_job(&id),
    }
}

/// Ends a job, and forgets it with its files.
#[utoipa::path(delete, path = "/api/v1/jobs/{job}", params(("job" = String, Path, description = "Id of a job")), responses((status = 204)))]
pub(super) async fn remove(State(hub): State<Arc<Hub>>, Path(id): Path<String>) -> Response {
    if hub.jobs.remove(&id) { StatusCode::NO_CONTENT.into_response() } else { problem::no_job(&id) }
}

/// A file that a job left.
#[utoipa::path(get, path = "/api/v1/jobs/{job}/files/{file}", params(("job" = String, Path, description = "Id of a job"), ("file" = String, Path, description = "One of its files")), responses((status = 200, body = String, content_type = "application/octet-stream")))]
pub(super) async fn job_file(
    State(hub): State<Arc<Hub>>,
    Path((id, name)): Path<(String, String)>,
    headers: HeaderMap,
) -> Response {
    let Some(job) = hub.jobs.get(&id) else { return problem::no_job(&id) };
    match job.file(&name) {
        Some(path) => runs::served(&path, headers).await,
        None => problem::not_found(&format!("file {name:?}")),
    }
}

/// Reads what is asked for, and as it was said.
fn read<T: DeserializeOwned>(
    headers: &HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Result<(T, Value), Box<Response>> {
    if !gate::is_json(headers) {
        return Err(problem::not_json().into());
    }
    let body = body.map_err(|_| Box::new(problem::body_not_read()))?;
    let wrong = |e: serde_json::Error| Box::new(problem::wrong_body(&e.to_string()));
    let asked: Value = serde_json::from_slice(&body).map_err(wrong)?;
    Ok((serde_json::from_slice(&body).map_err(wrong)?, asked))
}

fn begin(hub: &Hub, kind: &'static str, arguments: Vec<OsString>, asked: Value) -> Response {
    match hub.jobs.start(kind, arguments, asked) {
        Ok(Some(job)) => api::json(StatusCode::ACCEPTED, object(&job).to_string()),
        Ok(None) => problem::too_many_jobs(),
        Err(failure) => problem::failed(&failure.line()),
    }
}

/// `--NAME=VALUE`: a value that begins with a hyphen stays one.
fn option(name: &str, value: impl Into<OsString>) -> OsString {
    let mut option = OsString::from(format!("--{name}="));
    option.push(value.into());
    option
}

fn truck(hub: &Hub, name: &str) -> Result<OsString, String> {
    file(hub, "truck", name, |name| TruckParameters::names().any(|builtin| builtin == name))
}

/// Something built in, or a file among the assets.
fn file(
    hub: &Hub,
    key: &str,
    name: &str,
    is_builtin: impl Fn(&str) -> bool,
) -> Result<OsString, String> {
    if is_builtin(name) {
        return Ok(name.into());
    }
    among(hub.assets.as_deref(), key, name).map(PathBuf::into_os_string)
}

/// A file or folder below the assets.
///
/// # Errors
/// Names the key.
pub(super) fn among(assets: Option<&FilePath>, key: &str, name: &str) -> Result<PathBuf, String> {
    let Some(assets) = assets else {
        return Err(format!(
            "{key} = {name:?} is nothing built in, and the server has no --assets"
        ));
    };
    let is_plain =
        FilePath::new(name).components().all(|c| matches!(c, std::path::Component::Normal(_)));
    let found = assets.join(name).canonicalize().ok();
    match (found, assets.canonicalize().ok()) {
        (Some(found), Some(root)) if is_plain && found.starts_with(&root) => Ok(found),
        _ => Err(format!("{key} = {name:?} is no file among the server's assets")),
    }
}
