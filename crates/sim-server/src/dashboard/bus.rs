//! `/api/v1/sessions/ID/bus`: what is on the bus between stack and truck.

use axum::http::StatusCode;
use axum::response::Response;
use j1939::{GLOBAL_ADDRESS, Id, Slot};
use serde_json::{Value, json};

use super::api;
use super::hub::Of;
use super::strip::round;
use crate::bus_board::{Board, Latest};
use crate::bus_content::{self, Content, Item, Said};
use crate::provenance::SCHEMA;

/// What carries the messages (SAE J1939-21, -81).
const PROTOCOL: [(u32, &str); 5] =
    [(0xE800, "ACK"), (0xEA00, "RQST"), (0xEB00, "TP.DT"), (0xEC00, "TP.CM"), (0xEE00, "AC")];

/// What is on the bus between stack and truck: each message as it was last, with its rate, its age
/// and its signals; who claimed which address; what of the truck is not in order. Of a truck that is
/// driven directly all lists are empty.
#[utoipa::path(get, path = "/bus", params(("session" = String, Path, description = "Id of a session; `run` has `default`")), responses((status = 200, body = Object)))]
pub(super) async fn bus(Of(shared): Of) -> Response {
    api::json(StatusCode::OK, object(&shared.handle.bus().now()).to_string())
}

fn object(board: &Board) -> Value {
    let messages = board.messages.iter();
    let messages: Vec<Value> = messages
        .map(|(&(sent, raw), latest)| message(board, sent, Id::from_raw(raw), latest))
        .collect();
    let claims = board.claims.iter().map(|(address, name)| {
        json!({
            "address": address, "name": format!("{:016X}", name.0), "function": name.function(),
            "manufacturer": name.manufacturer(), "identity": name.identity(),
            "can_choose": name.can_choose(),
        })
    });
    let faults = board
        .status
        .faults()
        .map(|fault| json!({ "fault": fault.fault, "since_s": round(fault.since.seconds(), 1e3) }));
    json!({
        "schema": SCHEMA, "vehicle": board.vehicle, "time_s": board.now.seconds(),
        "messages": messages, "left_out": board.left_out,
        "claims": claims.collect::<Vec<_>>(), "faults": faults.collect::<Vec<_>>(),
        "errors": board.errors, "figures": board.figures,
    })
}

fn message(board: &Board, sent: bool, id: Id, latest: &Latest) -> Value {
    let (name, signals, wrong) = match bus_content::read(id, &latest.bytes) {
        Some((name, Content::Said(items))) => (Some(name), items, None),
        Some((name, Content::Wrong(why))) => (Some(name), Vec::new(), Some(why.to_string())),
        None => {
            let known = PROTOCOL.iter().find(|(pgn, _)| *pgn == id.pgn());
            (known.map(|(_, name)| *name), Vec::new(), None)
        }
    };
    let bytes: String = latest.bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    let to = Some(id.da()).filter(|da| *da != GLOBAL_ADDRESS);
    json!({
        "id": format!("{:08X}", id.raw()), "pgn": id.pgn(), "name": name,
        "source": id.sa(), "destination": to, "sent_by_the_stack": sent,
        "count": latest.count, "age_s": round(board.now.seconds_since(latest.last), 1e3),
        "rate_hz": latest.period_s.filter(|s| *s > 0.0).map(|s| round(1.0 / s, 100.0)),
        "bytes": bytes, "wrong": wrong,
        "signals": signals.iter().map(signal).collect::<Vec<_>>(),
    })
}

fn signal(item: &Item) -> Value {
    let value = match &item.slot {
        Slot::Value(Said::Number(number)) => json!(number),
        Slot::Value(Said::Code(code)) => json!(code),
        Slot::Value(Said::Text(text)) => json!(text),
        _ => Value::Null,
    };
    json!({ "name": item.name, "unit": item.unit, "value": value, "state": item.slot.state() })
}
