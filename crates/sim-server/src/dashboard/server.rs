//! The HTTP server: routes and the loopback listener.

use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::Uri;
use axum::middleware;
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};

use super::{Shared, api, assets, connections, gate, problem, sessions, socket};
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
        connections::serve(listener, router(self.shared)).await;
        Ok(())
    }
}

/// What there is of a session; the paths without one are those of the session `default`.
fn session() -> Router<Arc<Shared>> {
    Router::new()
        .route("/state", get(api::state))
        .route("/summary", get(api::summary))
        .route("/road", get(api::road))
        .route("/control", post(api::control))
}

fn router(shared: Arc<Shared>) -> Router {
    let known = || middleware::from_fn(sessions::known);
    Router::new()
        .nest("/api/v1", session())
        .route("/api/v1/sessions", get(sessions::list))
        .route("/api/v1/sessions/{session}", get(sessions::one).layer(known()))
        .nest("/api/v1/sessions/{session}", session().layer(known()))
        .route("/api/v1/health", get(api::health))
        .route("/api/v1/ready", get(api::ready))
        .route("/api/v1/metrics", get(api::metrics))
        .route("/report", get(report))
        .route("/ws", get(socket::upgrade))
        .fallback(page)
        .method_not_allowed_fallback(problem::wrong_method)
        .layer(middleware::from_fn(gate::gate))
        .with_state(shared)
}

async fn page(State(shared): State<Arc<Shared>>, uri: Uri) -> Response {
    assets::asset(uri.path(), shared.setting().report.is_some())
        .unwrap_or_else(|| problem::not_found(uri.path()))
}

/// The report of the diagnosis that the truck comes from.
async fn report(State(shared): State<Arc<Shared>>) -> Response {
    let page = |text: &Arc<str>| Html(text.to_string()).into_response();
    shared.setting().report.as_ref().map_or_else(|| problem::not_found("/report"), page)
}
