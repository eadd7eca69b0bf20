//! The HTTP server: routes, the loopback listener, and who may ask.

use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;

use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Uri, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};

use super::{Shared, api, assets, socket};
use crate::failure::Failure;

/// The loopback listener of the dashboard. Port 0 takes any free port.
///
/// # Errors
/// [`Failure::Input`] names the port when it is taken.
#[expect(clippy::disallowed_methods, reason = "the shell owns the socket")]
pub(crate) fn bind(port: u16) -> Result<TcpListener, Failure> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(|e| match e.kind() {
        std::io::ErrorKind::AddrInUse => Failure::Input(format!(
            "port {port} on 127.0.0.1 is in use; choose another with --port, or --headless"
        )),
        _ => Failure::Input(format!("port {port} on 127.0.0.1: {e}")),
    })?;
    listener.set_nonblocking(true).map_err(Failure::work)?;
    Ok(listener)
}

/// A dashboard ready to be served.
pub(crate) struct Dashboard {
    listener: TcpListener,
    shared: Arc<Shared>,
}

impl Dashboard {
    /// Serves what the world's thread leaves in `shared`.
    pub(crate) const fn new(listener: TcpListener, shared: Arc<Shared>) -> Self {
        Self { listener, shared }
    }

    /// Serves until the future is dropped.
    ///
    /// # Errors
    /// [`Failure::Work`] when the listener fails.
    pub(crate) async fn serve(self) -> Result<(), Failure> {
        let listener = tokio::net::TcpListener::from_std(self.listener).map_err(Failure::work)?;
        axum::serve(listener, router(self.shared)).await.map_err(Failure::work)
    }
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/api/v1/state", get(api::state))
        .route("/api/v1/summary", get(api::summary))
        .route("/api/v1/road", get(api::road))
        .route("/api/v1/health", get(api::health))
        .route("/api/v1/control", post(api::control))
        .route("/report", get(report))
        .route("/ws", get(socket::upgrade))
        .fallback(page)
        .method_not_allowed_fallback(api::wrong_method)
        .layer(middleware::from_fn(local_only))
        .with_state(shared)
}

async fn page(State(shared): State<Arc<Shared>>, uri: Uri) -> Response {
    assets::asset(uri.path(), shared.setting().report.is_some())
        .unwrap_or_else(|| api::not_found(uri.path()))
}

/// The report of the diagnosis that the truck comes from.
async fn report(State(shared): State<Arc<Shared>>) -> Response {
    let page = |text: &Arc<str>| Html(text.to_string()).into_response();
    shared.setting().report.as_ref().map_or_else(|| api::not_found("/report"), page)
}

/// Refuses requests that another web site makes through the user's browser: a foreign `Host`
/// (a name bound to 127.0.0.1) or a foreign `Origin`; and bodies that are announced as too long.
async fn local_only(request: Request, next: Next) -> Response {
    if !is_own(request.headers()) {
        api::foreign()
    } else if announced_bytes(request.headers()) > LONGEST_BODY {
        api::body_not_read()
    } else {
        next.run(request).await
    }
}

/// Longest body that is waited for, bytes: a control is a line.
const LONGEST_BODY: u64 = 16_384;

/// Length that a request says its body has, bytes.
fn announced_bytes(headers: &HeaderMap) -> u64 {
    let length = headers.get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok());
    length.and_then(|l| l.parse().ok()).unwrap_or(0)
}

fn is_own(headers: &HeaderMap) -> bool {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let host = text(header::HOST).unwrap_or_default();
    let origin = text(header::ORIGIN);
    is_loopback(host) && origin.is_none_or(|o| o.strip_prefix("http://") == Some(host))
}

fn is_loopback(host: &str) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    matches!(name, "127.0.0.1" | "localhost")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_loopback_names_are_served() {
        for good in ["127.0.0.1:8080", "localhost:8080", "localhost"] {
            assert!(is_loopback(good), "{good}");
        }
        for bad in ["", "evil.example:8080", "127.0.0.1.evil.example", "[::1]:8080"] {
            assert!(!is_loopback(bad), "{bad}");
        }
    }
}
