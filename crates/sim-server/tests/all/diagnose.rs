//! `diagnose` refuses what cannot be diagnosed with one line that says why.

use std::path::Path;

use crate::support;
use crate::support::columns::Columns;
use crate::support::refused;
use tractrix_core::GRAVITY_M_S2;

fn drives(folder: &Path, index: &str, table: &str) -> String {
    std::fs::write(folder.join("drives.toml"), index).unwrap();
    std::fs::write(folder.join("d.csv"), table).unwrap();
    folder.display().to_string()
}

const INDEX: &str =
    "schema = 1\ntruck = \"reference\"\n[[drive]]\nname = \"d\"\nfile = \"d.csv\"\n";

fn line(drives: &str, out: &Path) -> String {
    let out = out.join("out");
    let arguments = ["--truck", "reference", "--drives", drives, "--out"];
    let line = refused(&[&["diagnose"], &arguments[..], &[&out.display().to_string()]].concat());
    assert!(!out.exists(), "nothing is written for bad input");
    line
}

#[test]
fn a_missing_folder_and_a_folder_without_an_index_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("nowhere").display().to_string();
    assert!(line(&missing, folder.path()).contains("nowhere"));
    assert!(line(&folder.path().display().to_string(), folder.path()).contains("drives.toml"));
}

#[test]
fn tables_that_hold_nothing_are_refused_with_their_drive() {
    let folder = tempfile::tempdir().unwrap();
    for table in ["", "time_s,speed_m_s\n", "time_s,speed_m_s\n0.0,20.0\n"] {
        let line = line(&drives(folder.path(), INDEX, table), folder.path());
        assert!(line.contains("drive d") || line.contains("d.csv"), "{table:?}: {line}");
    }
    let shuffled = "time_s,speed_m_s\n0.0,20.0\n2.0,20.0\n1.0,20.0\n";
    let line = line(&drives(folder.path(), INDEX, shuffled), folder.path());
    assert!(line.contains("shuffled"), "{line}");
}

#[test]
fn an_unknown_truck_and_an_unknown_drive_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..2400)
        .map(|i| {
            let t = f64::from(i) * 0.05;
            format!("{t},{}\n", 20.0 + (0.1 * t).sin())
        })
        .collect();
    let at = drives(folder.path(), INDEX, &format!("time_s,speed_m_s\n{rows}"));
    let out = folder.path().join("out").display().to_string();
    let unknown = refused(&["diagnose", "--truck", "no-such", "--drives", &at, "--out", &out]);
    assert!(unknown.contains("no-such"), "{unknown}");
    let held = ["--truck", "reference", "--drives", &at, "--hold-out", "d9", "--out", &out];
    assert!(refused(&[&["diagnose"], &held[..]].concat()).contains("d9"));
}

fn diagnosed(arguments: &[&str]) -> serde_json::Value {
    let output = support::server(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// A folder of recorded runs of the reference truck, and the folder's path.
fn runs(at: &Path, payloads_kg: &[&str]) -> String {
    for payload in payloads_kg {
        let out = text(&at.join(format!("run_{payload}")));
        let options = ["--truck", "reference", "--payload-kg", payload, "--headless", "--out"];
        let run = [&["run", "highway-sag", "--duration", "300"], &options[..], &[&out]].concat();
        assert!(support::server(&run).status.success());
    }
    text(at)
}

#[test]
fn our_own_recordings_of_the_same_truck_leave_nothing_to_explain() {
    let folder = tempfile::tempdir().unwrap();
    let drives = runs(&folder.path().join("runs"), &["12000", "30000"]);
    let baseline = runs(&folder.path().join("others"), &["4000", "20000"]);
    let out = text(&folder.path().join("out"));
    let given = ["diagnose", "--truck", "reference", "--drives", &drives, "--baseline", &baseline];
    let found = diagnosed(&[&given[..], &["--out", &out, "--json"]].concat());
    assert_eq!(found["verdict"], "nothing_to_explain", "{found}");
    assert!(found["extended_truck"].is_null() && found["causes"].as_array().unwrap().is_empty());
    assert!(folder.path().join("out/report.html").is_file());
}

/// The example takes a truck; one that does not exist is named, and nothing is left.
#[test]
fn the_example_of_a_truck_that_does_not_exist_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = text(&folder.path().join("out"));
    let args = ["diagnose", "--example", "--truck", "no-such-truck", "--out", &out];
    let output = support::server(&args);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("no-such-truck"), "{said}");
    assert!(!folder.path().join("out").exists(), "{said}");
}

/// The whole loop: what was hidden is named, the extended truck loads and drives, the gain on the
/// drives held out is significant.
#[test]
fn the_example_finds_what_it_hid_and_its_truck_drives() {
    let folder = tempfile::tempdir().unwrap();
    let out = text(folder.path());
    let found = diagnosed(&["diagnose", "--example", "--seed", "2", "--out", &out, "--json"]);
    for key in ["schema", "version", "git_revision", "seed", "verdict", "wrong", "not_observable"] {
        assert!(!found[key].is_null(), "{key}");
    }
    assert_eq!(found["verdict"], "explained");
    assert_eq!(found["causes"][0]["id"], found["hidden"]["id"], "{found}");
    assert_eq!(found["gain"]["significant"], true);
    let errors = found["gain"]["errors"].as_array().unwrap();
    assert!(errors.iter().any(|e| e["claimed"] == true), "{errors:?}");
    let extended = text(&folder.path().join(found["extended_truck"].as_str().unwrap()));
    let run = ["run", "highway-empty", "--truck", &extended, "--duration", "5", "--headless"];
    let at = text(&folder.path().join("run"));
    assert!(support::server(&[&run[..], &["--out", &at]].concat()).status.success());
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("plotly.js v"), "the page is whole");
    for place in ["{{style}}", "{{plotly}}", "{{data}}", "{{script}}"] {
        assert!(!page.contains(place), "{place}");
    }
    // the library itself names addresses; the page's own part may not
    let own = &page[page.find("</head>").unwrap()..];
    assert!(!own.contains("http"), "and needs nothing else");
}

/// A recording says where its road was, not what it was: curvature comes of the road that is found
/// there, if it is still the one that was driven.
#[test]
fn a_recording_whose_road_is_gone_or_another_has_no_curvature_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name));
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for name in ["scenario.toml", "road.csv", "truck.toml"] {
        std::fs::copy(examples.join(name), at(name)).unwrap();
    }
    let run = ["run", &at("scenario.toml"), "--headless", "--duration", "100"];
    assert!(support::server(&[&run[..], &["--out", &at("run")]].concat()).status.success());
    let replayed = |out: &str| {
        let given = ["replay", "--truck", "longhaul", "--drives", &at("run"), "--out", &at(out)];
        let output = support::server(&given);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let table = Columns::read(&at(&format!("{out}/drives/run.csv")));
        (table.has("curvature_1_m"), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    assert!(replayed("whole").0);
    let road = std::fs::read_to_string(at("road.csv")).unwrap();
    let shorter: Vec<&str> = road.lines().take(road.lines().count() - 20).collect();
    std::fs::write(at("road.csv"), shorter.join("\n")).unwrap();
    let (has, said) = replayed("changed");
    assert!(!has && said.contains("not the one that was driven"), "{said}");
    std::fs::remove_file(at("road.csv")).unwrap();
    let (has, said) = replayed("gone");
    assert!(
        !has && said.contains("no curvature of its road") && said.contains("road.csv"),
        "{said}"
    );
}

#[test]
fn a_recording_is_reproduced_in_open_loop_and_the_accuracy_is_defined() {
    let folder = tempfile::tempdir().unwrap();
    let drives = runs(&folder.path().join("runs"), &["20000"]);
    let out = text(&folder.path().join("out"));
    let given = ["replay", "--truck", "reference", "--drives", &drives, "--out", &out, "--json"];
    let fidelity = diagnosed(&given);
    assert!(fidelity["accuracy_is"].as_str().unwrap().starts_with("1 - mean |"));
    let speed = |horizon: serde_json::Value| {
        let all = fidelity["overall"].as_array().unwrap();
        let is = |s: &&serde_json::Value| s["quantity"] == "speed_m_s" && s["horizon_s"] == horizon;
        all.iter().find(is).unwrap()["accuracy_frac"].as_f64().unwrap()
    };
    assert!(speed(serde_json::json!(60.0)) > 0.97, "{fidelity}");
    assert!(speed(serde_json::Value::Null) > 0.9, "{fidelity}");
    assert!(folder.path().join("out/replay.html").is_file());
    let drive = Columns::read(&text(&folder.path().join("out/drives/run_20000.csv")));
    let road = road::Road::load("builtin:highway-sag").unwrap();
    let stations_m = drive.of("s_map_m");
    let on_map = |s_m: &f64| road.at(*s_m, 1.875).curvature_1_m;
    let curves: Vec<f64> = stations_m.iter().map(on_map).collect();
    assert!(curves.iter().any(|k| k.abs() > 2e-4), "the road bends");
    for (k, driven) in curves.iter().zip(drive.of("curvature_1_m")) {
        assert!((k - driven).abs() < 2e-5, "{k} {driven}");
    }
    // Uphill an accelerometer shows more than the speed's change, by gravity's part.
    let speed_m_s = drive.of("gps_speed_m_s");
    let changed_m_s2 = (speed_m_s[speed_m_s.len() - 1] - speed_m_s[0]) / 300.0;
    let mean = |name: &str| drive.of(name).iter().sum::<f64>() / speed_m_s.len() as f64;
    let found = mean("accel_x_m_s2") - changed_m_s2;
    assert!((found - GRAVITY_M_S2 * mean("grade_frac")).abs() < 0.01, "{found}");
    let (missing, out) = (text(&folder.path().join("none")), text(&folder.path().join("other")));
    let refused = refused(&["replay", "--truck", "reference", "--drives", &missing, "--out", &out]);
    assert!(refused.contains("none"), "{refused}");
}

#[test]
fn an_experiment_is_suggested_for_what_a_diagnosis_leaves_open() {
    let folder = tempfile::tempdir().unwrap();
    let diagnosis = folder.path().join("diagnosis.json");
    let open = r#"{"causes": [{"id": "brake_gain", "confused_with": []}],
        "not_observable": [{"id": "brake_fade", "why": "no braking above 150 degC"},
            {"id": "crosswind", "why": "...", "missing_channels": ["yaw_rate_rad_s"]}]}"#;
    std::fs::write(&diagnosis, open).unwrap();
    let (file, out) = (text(&diagnosis), text(&folder.path().join("out")));
    let given = ["experiment", "suggest", "--truck", "reference", "--diagnosis", &file];
    let found = diagnosed(&[&given[..], &["--out", &out, "--json"]].concat());
    assert_eq!(found["causes"], serde_json::json!(["brake_gain", "brake_fade"]));
    assert_eq!(found["plan"][0]["manoeuvre"], "hot_brakes", "{found}");
    assert!(folder.path().join("out/experiment.json").is_file());

    let out = text(&folder.path().join("other"));
    let wrong = ["experiment", "suggest", "--truck", "reference", "--causes", "flux"];
    assert!(refused(&[&wrong[..], &["--out", &out]].concat()).contains("flux"));
    std::fs::write(&diagnosis, "{}").unwrap();
    assert!(refused(&[&given[..], &["--out", &out]].concat()).contains("causes"));
}
