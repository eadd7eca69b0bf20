//! What is built in: scenarios and trucks.

use axum::extract::Path;
use axum::http::StatusCode;
use axum::response::Response;
use dynamics::TruckParameters;
use serde_json::{Value, json};
use sim::Scenario;
use utoipa::ToSchema;

use super::{api, problem};
use crate::provenance::SCHEMA;

/// A built-in scenario.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a schema")]
pub(super) struct ScenarioObject {
    schema: u32,
    name: String,
    description: String,
    /// Its text.
    toml: String,
}

/// The built-in scenarios: names and descriptions.
#[utoipa::path(get, path = "/api/v1/scenarios", responses((status = 200, body = Object)))]
pub(super) async fn scenarios() -> Response {
    let all = Scenario::names().filter_map(|name| Scenario::builtin(name).ok());
    let all = all.map(|s| json!({ "name": s.name, "description": s.description, "road": s.road }));
    let body = json!({ "schema": SCHEMA, "scenarios": all.collect::<Vec<Value>>() });
    api::json(StatusCode::OK, body.to_string())
}

/// A built-in scenario with its text.
#[utoipa::path(get, path = "/api/v1/scenarios/{scenario}", params(("scenario" = String, Path, description = "Name of a built-in scenario")), responses((status = 200, body = ScenarioObject)))]
pub(super) async fn scenario(Path(name): Path<String>) -> Response {
    let (Ok(text), Ok(scenario)) = (Scenario::builtin_text(&name), Scenario::builtin(&name)) else {
        return problem::not_found(&format!("scenario {name:?}"));
    };
    let body = json!({
        "schema": SCHEMA, "name": name, "description": scenario.description, "toml": text,
    });
    api::json(StatusCode::OK, body.to_string())
}

/// The built-in trucks, and the built-in roads.
#[utoipa::path(get, path = "/api/v1/trucks", responses((status = 200, body = Object)))]
pub(super) async fn trucks() -> Response {
    let trucks: Vec<&str> = TruckParameters::names().collect();
    api::json(StatusCode::OK, json!({ "schema": SCHEMA, "trucks": trucks }).to_string())
}
