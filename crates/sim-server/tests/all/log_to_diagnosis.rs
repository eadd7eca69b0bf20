//! From what a truck says on its bus to a named cause: the same as from the drive itself.

use std::path::Path;

use crate::bus_log;
use crate::support::server;
use serde_json::Value;

/// Payload of each drive, kg, of those in order, and how long they last.
const PAYLOADS_KG: [f64; 3] = [6_000.0, 20_000.0, 34_000.0];
const IN_ORDER_KG: [f64; 2] = [12_000.0, 28_000.0];
const DURATION_S: f64 = 300.0;
const EMPTY_KG: f64 = 19_000.0;
/// Where `highway-sag` begins, m.
const START_S_M: &str = "40";

fn run(arguments: &[&str]) {
    let output = server(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// Causes that a diagnosis of a folder of drives names.
fn causes(drives: &Path, baseline: Option<&Path>, out: &Path) -> Vec<String> {
    let (drives, out_dir) = (text(drives), text(out));
    let mut command = vec!["diagnose", "--truck", "reference", "--drives", &drives];
    command.extend(["--out", &out_dir]);
    let baseline = baseline.map(text);
    command.extend(baseline.iter().flat_map(|b| ["--baseline", b.as_str()]));
    run(&command);
    let found = std::fs::read_to_string(out.join("diagnosis.json")).unwrap();
    let found: Value = serde_json::from_str(&found).unwrap();
    let causes = found["causes"].as_array().unwrap();
    causes.iter().map(|c| c["id"].as_str().unwrap().to_owned()).collect()
}

/// Logs of a truck at these payloads, made into drives.
fn logged(truck: &str, payloads_kg: &[f64], out: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let log_of = |(i, payload_kg): (usize, &f64)| {
        let scenario = bus_log::alone("highway-sag", truck, *payload_kg, DURATION_S);
        let log = folder.path().join(format!("day{i}.log.gz"));
        bus_log::log(&scenario, &log, 0.0);
        text(&log)
    };
    let logs: Vec<String> = payloads_kg.iter().enumerate().map(log_of).collect();
    let masses: Vec<String> = payloads_kg.iter().map(|kg| (EMPTY_KG + kg).to_string()).collect();
    let (masses, out_dir) = (masses.join(","), text(out));
    let mut command = vec!["drives", "from-can", "--truck", "reference", "--out", &out_dir];
    command.extend(["--mass-kg", &masses, "--map", "builtin:highway-sag"]);
    command.extend(["--start-s-m", START_S_M]);
    command.extend(logs.iter().map(String::as_str));
    run(&command);
    let report = std::fs::read_to_string(out.join("conversion.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    for log in report["logs"].as_array().unwrap() {
        assert_eq!(log["drives"][0]["on_map"], true, "{log:#}");
    }
}

/// A bus has delays of its own, which drives in order teach.
#[test]
fn a_log_of_the_bus_leads_to_the_cause_that_the_drive_leads_to() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let truck = at("hidden.toml");
    let hidden = "schema = 1\nbase = \"reference\"\nname = \"hidden\"\n[set]\n\
                  \"resistance.parasitic_force_n\" = { value = 1500.0, source = \"hidden\" }\n";
    std::fs::write(&truck, hidden).unwrap();
    let truck = text(&truck);
    for (i, payload_kg) in PAYLOADS_KG.into_iter().enumerate() {
        let (payload, duration) = (payload_kg.to_string(), DURATION_S.to_string());
        let out = text(&at("runs").join(format!("day{i}")));
        let mut command = vec!["run", "highway-sag", "--truck", &truck, "--payload-kg", &payload];
        command.extend(["--duration", &duration, "--traffic", "none", "--headless"]);
        command.extend(["--pace", "max", "--out", &out]);
        run(&command);
    }
    logged(&truck, &PAYLOADS_KG, &at("logged"));
    logged("reference", &IN_ORDER_KG, &at("in_order"));
    let direct = causes(&at("runs"), None, &at("from_drives"));
    let by_log = causes(&at("logged"), Some(&at("in_order")), &at("from_logs"));
    assert_eq!(direct, ["dragging_brake"], "from the drives themselves");
    assert_eq!(by_log, direct, "from the logs");
}
