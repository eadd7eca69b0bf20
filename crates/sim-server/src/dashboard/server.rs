//! The HTTP server: routes and the listener.

use std::net::TcpListener;
use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::{StatusCode, Uri};
use axum::middleware;
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::access::Access;
use super::hub::{Hub, Of};
use super::{
    Shared, api, assets, bus, connections, gate, jobs, library, openapi, problem, runs, sessions,
    socket,
};
use crate::failure::Failure;
use crate::session::DEFAULT;

/// The listener of the dashboard. Port 0 takes any free port.
///
/// # Errors
/// [`Failure::Input`] names the port when it is taken.
#[expect(clippy::disallowed_methods, reason = "the shell owns the socket")]
pub(crate) fn bind(access: &Access, port: u16) -> Result<TcpListener, Failure> {
    let ip = access.bind;
    let listener = TcpListener::bind((ip, port)).map_err(|e| match e.kind() {
        std::io::ErrorKind::AddrInUse => Failure::Input(format!(
            "port {port} on {ip} is in use; choose another with --port, or --headless"
        )),
        _ => Failure::Input(format!("port {port} on {ip}: {e}")),
    })?;
    listener.set_nonblocking(true).map_err(Failure::work)?;
    Ok(listener)
}

/// A dashboard ready to be served.
pub(crate) struct Dashboard {
    listener: TcpListener,
    hub: Arc<Hub>,
}

impl Dashboard {
    /// Serves what the sessions' threads leave in `hub`.
    pub(crate) const fn new(listener: TcpListener, hub: Arc<Hub>) -> Self {
        Self { listener, hub }
    }

    /// Serves until the future is dropped.
    ///
    /// # Errors
    /// [`Failure::Work`] when the listener fails.
    pub(crate) async fn serve(self) -> Result<(), Failure> {
        let listener = tokio::net::TcpListener::from_std(self.listener).map_err(Failure::work)?;
        connections::serve(listener, router(self.hub)).await;
        Ok(())
    }
}

/// What there is of a session.
fn session() -> OpenApiRouter<Arc<Hub>> {
    OpenApiRouter::new()
        .routes(routes!(api::state))
        .routes(routes!(api::summary))
        .routes(routes!(api::road))
        .routes(routes!(api::frames))
        .routes(routes!(api::events))
        .routes(routes!(api::entities))
        .routes(routes!(bus::bus))
        .routes(routes!(api::control))
}

fn router(hub: Arc<Hub>) -> Router {
    let one = OpenApiRouter::new().routes(routes!(sessions::one, sessions::end));
    let (documented, document) = OpenApiRouter::with_openapi(openapi::document())
        .routes(routes!(sessions::list, sessions::create))
        .nest("/api/v1/sessions/{session}", one.merge(session()))
        .routes(routes!(runs::list))
        .routes(routes!(runs::one, runs::remove))
        .routes(routes!(runs::recording))
        .routes(routes!(runs::report))
        .routes(routes!(runs::road))
        .routes(routes!(runs::strip))
        .routes(routes!(runs::frames))
        .routes(routes!(runs::compare))
        .routes(routes!(library::scenarios))
        .routes(routes!(library::scenario))
        .routes(routes!(library::trucks))
        .routes(routes!(jobs::plan))
        .routes(routes!(jobs::diagnose))
        .routes(routes!(jobs::list))
        .routes(routes!(jobs::one, jobs::remove))
        .routes(routes!(jobs::job_file))
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
        .layer(middleware::from_fn_with_state(Arc::clone(&hub), gate::gate))
        .with_state(hub)
}

async fn page(State(hub): State<Arc<Hub>>, uri: Uri) -> Response {
    let has_report = |session: Arc<Shared>| session.setting().report.is_some();
    let report = hub.sessions.get(DEFAULT).is_some_and(has_report);
    assets::asset(uri.path(), report).unwrap_or_else(|| problem::not_found(uri.path()))
}

/// The report of the diagnosis that the truck comes from.
async fn report(Of(session): Of) -> Response {
    let page = |text: &Arc<str>| Html(text.to_string()).into_response();
    session.setting().report.as_ref().map_or_else(|| problem::not_found("/report"), page)
}
