//! Who may ask, with what, and what a browser may make of the answer.

use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::access::Access;
use super::hub::Hub;
use super::problem;

/// Longest body, bytes: a control is a line,
const MAX_BODY_BYTES: usize = 16_384;
/// a scenario has some pages.
const MAX_SCENARIO_BYTES: usize = 262_144;
/// A body arrives within this time.
const BODY_TIMEOUT: Duration = Duration::from_secs(10);

/// What the page may load and do: nothing from elsewhere. Plotly writes style elements.
const PAGE_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' \
     data: blob:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
);
/// A report has all in one file, and talks to nobody.
const REPORT_POLICY: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: \
     blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
);

/// Refuses requests that another web site makes through the user's browser, and bodies that are
/// too long or too slow; says to browsers what an answer may do.
pub(super) async fn gate(State(hub): State<Arc<Hub>>, request: Request, next: Next) -> Response {
    let path = request.uri().path();
    let is_page = path != "/report" && !path.starts_with("/api/");
    let mut response = if !is_own(&hub.access, request.method(), request.headers()) {
        problem::foreign()
    } else if hub.access.admits(request.headers()) {
        match with_body(request).await {
            Ok(request) => next.run(request).await,
            Err(refused) => refused,
        }
    } else if let Some(cookie) = hub.access.cookie_for(request.uri()).filter(|_| is_page) {
        keep_cookie(cookie)
    } else {
        problem::unauthorized()
    };
    let headers = response.headers_mut();
    let kind = text(headers, header::CONTENT_TYPE.as_str()).unwrap_or_default();
    let is_report = kind.starts_with("text/html") && !is_page;
    let policy = if is_report { REPORT_POLICY } else { PAGE_POLICY };
    headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    let same_origin = HeaderValue::from_static("same-origin");
    headers.insert("cross-origin-resource-policy", same_origin);
    response
}

/// Sends a browser on to the page without the token in its address.
fn keep_cookie((cookie, place): (String, String)) -> Response {
    let mut response = StatusCode::SEE_OTHER.into_response();
    for (name, value) in [(header::SET_COOKIE, cookie), (header::LOCATION, place)] {
        if let Ok(value) = HeaderValue::from_str(&value) {
            response.headers_mut().insert(name, value);
        }
    }
    response
}

/// The request with its body in memory.
async fn with_body(request: Request) -> Result<Request, Response> {
    let (head, body) = request.into_parts();
    let may_be_long = head.uri.path() == "/api/v1/sessions";
    let most = if may_be_long { MAX_SCENARIO_BYTES } else { MAX_BODY_BYTES };
    let announced = text(&head.headers, header::CONTENT_LENGTH.as_str());
    let announced_bytes = announced.and_then(|l| l.parse::<u64>().ok()).unwrap_or(0);
    if announced_bytes > most as u64 {
        return Err(problem::body_not_read());
    }
    match tokio::time::timeout(BODY_TIMEOUT, to_bytes(body, most)).await {
        Ok(Ok(bytes)) => Ok(Request::from_parts(head, Body::from(bytes))),
        Ok(Err(_)) => Err(problem::body_not_read()),
        Err(_) => Err(problem::body_too_slow()),
    }
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}

/// Whether a body is JSON: a form of another site cannot send this without asking first.
pub(super) fn is_json(headers: &HeaderMap) -> bool {
    let kind = text(headers, header::CONTENT_TYPE.as_str()).unwrap_or_default();
    let kind = kind.split(';').next().unwrap_or_default().trim();
    kind.eq_ignore_ascii_case("application/json")
}

/// Whether the user or a page of this server asks: the `Host` is this computer (and not a foreign
/// name that leads to it), the `Origin` is this server, and the browser does not say that another
/// site asks. A link on another site may lead to a page.
fn is_own(access: &Access, method: &Method, headers: &HeaderMap) -> bool {
    let host = text(headers, header::HOST.as_str()).unwrap_or_default();
    let origin = text(headers, header::ORIGIN.as_str());
    let opens_page = method == Method::GET
        && text(headers, "sec-fetch-mode") == Some("navigate")
        && text(headers, "sec-fetch-dest") == Some("document");
    let site = text(headers, "sec-fetch-site").unwrap_or("none");
    access.serves(host)
        && origin.is_none_or(|o| o.strip_prefix("http://") == Some(host))
        && (opens_page || matches!(site, "none" | "same-origin"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_site_may_link_to_a_page_and_nothing_else() {
        let asks = |method: Method, headers: &[(&'static str, &'static str)]| {
            let own = [("host", "127.0.0.1:8080")];
            let all = own.iter().chain(headers);
            let all = all.map(|(name, value)| {
                (header::HeaderName::from_static(name), HeaderValue::from_static(value))
            });
            is_own(&Access::loopback(), &method, &all.collect())
        };
        assert!(asks(Method::POST, &[]), "a program");
        assert!(asks(Method::POST, &[("origin", "http://127.0.0.1:8080")]));
        for origin in ["null", "http://evil.example", "https://127.0.0.1:8080", "http://localhost"]
        {
            assert!(!asks(Method::POST, &[("origin", origin)]), "{origin}");
        }
        let link = [("sec-fetch-mode", "navigate"), ("sec-fetch-dest", "document")];
        let frame = [("sec-fetch-mode", "navigate"), ("sec-fetch-dest", "iframe")];
        for site in ["cross-site", "same-site"] {
            let from = [("sec-fetch-site", site)];
            assert!(asks(Method::GET, &[&from[..], &link].concat()), "a link");
            assert!(!asks(Method::POST, &[&from[..], &link].concat()), "a form");
            assert!(!asks(Method::GET, &[&from[..], &frame].concat()), "a frame");
            assert!(!asks(Method::GET, &from), "a picture");
        }
    }
}
