//! Refusals of the API: problem details (RFC 9457). All there are.

use axum::http::{HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};

use crate::failure::one_line;
use crate::provenance::SCHEMA;
use crate::session::{CommandError, Refused};

/// A problem: a word for programs and a sentence for people. Whoever came too early is told when
/// to come again.
fn problem(status: StatusCode, kind: &str, why: &str) -> Response {
    let body = details(status, kind, why);
    let content = [(header::CONTENT_TYPE, "application/problem+json")];
    let mut response = (status, content, body.to_string()).into_response();
    if matches!(status, StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE) {
        response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
    }
    response
}

fn details(status: StatusCode, kind: &str, why: &str) -> Value {
    json!({
        "schema": SCHEMA,
        "type": format!("urn:tractrix:{kind}"),
        "title": status.canonical_reason(),
        "status": status.as_u16(),
        "detail": one_line(why),
    })
}

/// A path that is not there.
pub(super) fn not_found(path: &str) -> Response {
    problem(StatusCode::NOT_FOUND, "not_found", &format!("nothing at {path}"))
}

/// A session that is not there.
pub(super) fn no_session(id: &str) -> Response {
    let why = format!("no session {id:?}; GET /api/v1/sessions names those that there are");
    problem(StatusCode::NOT_FOUND, "no_session", &why)
}

/// A run that is not there.
pub(super) fn no_run(name: &str) -> Response {
    problem(StatusCode::NOT_FOUND, "no_run", &format!("no run {name:?}"))
}

/// A job that is not there.
pub(super) fn no_job(id: &str) -> Response {
    problem(StatusCode::NOT_FOUND, "no_job", &format!("no job {id:?}"))
}

/// A run that is not over.
pub(super) fn run_is_recording(name: &str) -> Response {
    let why = format!("run {name:?} is being recorded; end its session first");
    problem(StatusCode::CONFLICT, "run_is_recording", &why)
}

/// A query that is not what it is to be.
pub(super) fn wrong_query(why: &str) -> Response {
    problem(StatusCode::BAD_REQUEST, "wrong_query", why)
}

/// Others are at the same work.
pub(super) fn busy() -> Response {
    let why = "others have the same done now";
    problem(StatusCode::TOO_MANY_REQUESTS, "busy", why)
}

/// One job more than are kept.
pub(super) fn too_many_jobs() -> Response {
    let why = "too many jobs are under way";
    problem(StatusCode::TOO_MANY_REQUESTS, "too_many_jobs", why)
}

/// A path that is there for another method.
pub(super) async fn wrong_method(method: Method, uri: Uri) -> Response {
    let why = format!("{} does not take {method}", uri.path());
    problem(StatusCode::METHOD_NOT_ALLOWED, "method_not_allowed", &why)
}

/// A request from another web site.
pub(super) fn foreign() -> Response {
    problem(StatusCode::FORBIDDEN, "foreign_page", "only pages of this server may ask")
}

/// A request without the token.
pub(super) fn unauthorized() -> Response {
    let why = "the server's token is missing or wrong: Authorization: Bearer TOKEN";
    let mut response = problem(StatusCode::UNAUTHORIZED, "unauthorized", why);
    let wanted = HeaderValue::from_static("Bearer");
    response.headers_mut().insert(header::WWW_AUTHENTICATE, wanted);
    response
}

/// A body that is too long, or broke off.
pub(super) fn body_not_read() -> Response {
    let why = "the body is too long, or broke off";
    problem(StatusCode::PAYLOAD_TOO_LARGE, "body_not_read", why)
}

/// A body that did not arrive in time.
pub(super) fn body_too_slow() -> Response {
    problem(StatusCode::REQUEST_TIMEOUT, "body_too_slow", "the body has not arrived in 10 s")
}

/// A body of another kind.
pub(super) fn not_json() -> Response {
    let why = "the body must be JSON: Content-Type: application/json";
    problem(StatusCode::UNSUPPORTED_MEDIA_TYPE, "not_json", why)
}

/// One viewer more than there are places.
pub(super) fn too_many_viewers() -> Response {
    let why = format!("{} viewers look on already", super::hub::MAX_VIEWERS);
    problem(StatusCode::TOO_MANY_REQUESTS, "too_many_viewers", &why)
}

/// One session more than there are places.
pub(super) fn too_many_sessions(most: usize) -> Response {
    let why = format!("no more than {most} sessions at once; end one of them");
    problem(StatusCode::TOO_MANY_REQUESTS, "too_many_sessions", &why)
}

/// A body that is not what it is to be.
pub(super) fn wrong_body(why: &str) -> Response {
    problem(StatusCode::BAD_REQUEST, "wrong_body", why)
}

/// Something that was asked for and cannot be made.
pub(super) fn unusable(why: &str) -> Response {
    problem(StatusCode::UNPROCESSABLE_ENTITY, "unusable", why)
}

/// A scenario that names what it may not.
pub(super) fn outside(why: &str) -> Response {
    problem(StatusCode::UNPROCESSABLE_ENTITY, "outside", why)
}

/// The server itself could not do it.
pub(super) fn failed(why: &str) -> Response {
    problem(StatusCode::INTERNAL_SERVER_ERROR, "failed", why)
}

/// No frame yet.
pub(super) fn no_tick_yet() -> Response {
    problem(StatusCode::SERVICE_UNAVAILABLE, "no_tick_yet", "no tick has been driven yet")
}

/// A text that is no command.
pub(super) fn no_command(why: &CommandError) -> Response {
    problem(StatusCode::BAD_REQUEST, why.code(), &why.to_string())
}

/// A session that does not answer.
pub(super) fn no_answer() -> Response {
    problem(StatusCode::GATEWAY_TIMEOUT, "no_answer", NO_ANSWER)
}

/// As [`no_answer`], for a message of `/ws`.
pub(super) fn no_answer_details() -> Value {
    details(StatusCode::GATEWAY_TIMEOUT, "no_answer", NO_ANSWER)
}

const NO_ANSWER: &str = "the session has not answered; what was asked for may still act";

/// A command that did not act.
pub(super) fn refused(why: &Refused) -> Response {
    let (status, code) = code_of(why);
    problem(status, code, &why.to_string())
}

/// As [`refused`], for a message of `/ws`.
pub(super) fn refused_details(why: &Refused) -> Value {
    let (status, code) = code_of(why);
    details(status, code, &why.to_string())
}

/// As [`no_command`], for a message of `/ws`.
pub(super) fn no_command_details(why: &CommandError) -> Value {
    details(StatusCode::BAD_REQUEST, why.code(), &why.to_string())
}

/// As [`wrong_body`], for a message of `/ws`.
pub(super) fn wrong_body_details(why: &str) -> Value {
    details(StatusCode::BAD_REQUEST, "wrong_body", why)
}

const fn code_of(why: &Refused) -> (StatusCode, &'static str) {
    match why {
        Refused::TooMany => (StatusCode::TOO_MANY_REQUESTS, "too_many_controls"),
        Refused::Ended => (StatusCode::CONFLICT, "run_ended"),
        Refused::WrongState { .. } => (StatusCode::CONFLICT, "wrong_state"),
        Refused::NoBus(_) => (StatusCode::CONFLICT, "no_bus"),
        Refused::NoExternalDecider => (StatusCode::CONFLICT, "no_external_decider"),
        Refused::OutsideBus(_) => (StatusCode::CONFLICT, "outside_bus"),
        Refused::OneSumo | Refused::SecondSumo => (StatusCode::CONFLICT, "one_sumo"),
        Refused::NothingKept(_) => (StatusCode::CONFLICT, "nothing_kept"),
        Refused::TooManyKept => (StatusCode::CONFLICT, "too_many_kept"),
        Refused::CutShort { .. } => (StatusCode::CONFLICT, "cut_short"),
        Refused::TooFar { .. } => (StatusCode::UNPROCESSABLE_ENTITY, "too_far"),
        Refused::Unusable(_) => (StatusCode::UNPROCESSABLE_ENTITY, "unusable"),
    }
}
