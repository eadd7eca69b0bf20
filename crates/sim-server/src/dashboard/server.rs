//! The HTTP server: routes and the loopback listener.

use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::{StatusCode, Uri};
use axum::middleware;
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::{Shared, api, assets, connections, gate, openapi, problem, sessions, socket};
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

/// What there is of a session.
fn session() -> OpenApiRouter<Arc<Shared>> {
    OpenApiRouter::new()
        .routes(routes!(api::state))
        .routes(routes!(api::summary))
        .routes(routes!(api::road))
        .routes(routes!(api::control))
}

fn router(shared: Arc<Shared>) -> Router {
    let known = || middleware::from_fn(sessions::known);
    let (documented, document) = OpenApiRouter::with_openapi(openapi::document())
        .routes(routes!(sessions::list))
        .merge(OpenApiRouter::new().routes(routes!(sessions::one)).layer(known()))
        .nest("/api/v1/sessions/{session}", session().layer(known()))
        .routes(routes!(api::health))
        .routes(routes!(api::ready))
        .routes(routes!(api::metrics))
        .split_for_parts();
    let document: Arc<str> = openapi::text(document).into();
    documented
        // The paths without a session are those of the session `default`
        .nest("/api/v1", session().into())
        .route(
            "/api/openapi.json",
            get(async move || api::json(StatusCode::OK, document.to_string())),
        )
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
