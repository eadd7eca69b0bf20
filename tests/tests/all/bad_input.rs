//! Bad scenarios, roads and trucks: one clear error that names the key, file or value; no panic.

use sim::{Scenario, World};

/// The built-in highway scenario with one line replaced or added.
fn broken(from: &str, to: &str) -> String {
    let text = Scenario::builtin_text("highway").unwrap();
    let out = text.replace(from, to);
    assert_ne!(out, text, "the scenario has no {from:?}");
    match Scenario::from_toml_str("broken.toml", &out) {
        Err(e) => e.to_string(),
        Ok(s) => World::new(&s, 1).map(|_| ()).unwrap_err().to_string(),
    }
}

#[test]
fn a_wrong_key_is_named_with_its_line() {
    let e = broken("payload_kg", "payload_t");
    assert!(e.contains("payload_t") && e.contains("line") && e.contains("broken.toml"), "{e}");
}

#[test]
fn a_value_out_of_range_is_named_with_its_bounds() {
    let e = broken("payload_kg = 36000.0", "payload_kg = -1.0");
    assert!(e.contains("truck.payload_kg") && e.contains("-1"), "{e}");
    let e = broken("payload_kg = 36000.0", "payload_kg = nan");
    assert!(e.contains("truck.payload_kg") && e.contains("NaN"), "{e}");
}

#[test]
fn an_unknown_road_or_truck_is_named() {
    let e = broken("builtin:highway", "builtin:motorway");
    assert!(e.contains("builtin:motorway"), "{e}");
    let e = broken("file = \"longhaul\"", "file = \"scania\"");
    assert!(e.contains("scania"), "{e}");
}

#[test]
fn a_missing_file_is_named() {
    let e = broken("builtin:highway", "nowhere/road.csv");
    assert!(e.contains("nowhere/road.csv"), "{e}");
}

#[test]
fn a_wrong_type_is_named_with_its_line() {
    let e = broken("speed_m_s = 20.0", "speed_m_s = \"fast\"");
    assert!(e.contains("line"), "{e}");
}
