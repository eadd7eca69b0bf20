//! The `traffic` command: traffic alone, its statistics, comparison and calibration.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::support::{program, refused, server};
use serde_json::Value;

fn shared(path: &str) -> Option<String> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(path);
    if !file.exists() {
        eprintln!("skipped: no {}", file.display());
        return None;
    }
    Some(file.display().to_string())
}

/// Runs `traffic` into a folder and returns its statistics.
fn statistics(out: &Path, options: &[&str]) -> Value {
    let fixed = ["traffic", "--json", "--out", out.to_str().unwrap()];
    let output = server(&[&fixed, options].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let written = std::fs::read_to_string(out.join("statistics.json")).unwrap();
    assert_eq!(String::from_utf8(output.stdout).unwrap().trim(), written.trim());
    serde_json::from_str(&written).unwrap()
}

fn number(value: &Value, path: &[&str]) -> f64 {
    path.iter().fold(value, |at, key| &at[key]).as_f64().unwrap()
}

/// Drives the sparse family for a while; returns the trajectories.
fn recorded(folder: &Path, seed: &str) -> PathBuf {
    let out = folder.join(seed);
    let options = ["--scenario", "sparse-15", "--road", "builtin:flat"];
    statistics(&out, &[&options[..], &["--duration", "60", "--seed", seed]].concat());
    out.join("trajectories.parquet")
}

#[test]
fn traffic_alone_has_the_flow_that_was_asked_for_and_its_files_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let s = statistics(&out, &["--scenario", "medium-15", "--duration", "120", "--seed", "4"]);
    assert_eq!((&s["schema"], &s["seed"], &s["mode"]), (&1.into(), &4.into(), &"pure".into()));
    // 0.02 per lane and 0.1 s are 720 vehicles per hour; trucks are 8 % slower than the rest.
    let flow = number(&s, &["simulated", "flow_per_lane_1_h"]);
    assert!((500.0..800.0).contains(&flow), "{flow}");
    let (density, speed) = (
        number(&s, &["simulated", "density_per_lane_1_km"]),
        number(&s, &["simulated", "speed_m_s", "mean"]),
    );
    assert!((density * speed * 3.6 / flow - 1.0).abs() < 0.05, "{density} {speed} {flow}");
    assert!(number(&s, &["simulated", "min_gap_m"]) > 0.5);
    for file in ["trajectories.parquet", "statistics.html", "traffic.manifest.toml"] {
        assert!(out.join(file).metadata().unwrap().len() > 500, "{file}");
    }
    assert!(s.get("measured").is_none());
}

#[test]
fn traffic_is_like_itself_with_another_seed_and_unlike_denser_traffic() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), "1").display().to_string();
    let options = ["--road", "builtin:flat", "--duration", "60", "--compare", &file];
    let ks = |scenario: &str, seed: &str| {
        let out = folder.path().join(format!("{scenario}-{seed}"));
        let who = ["--scenario", scenario, "--seed", seed];
        let s = statistics(&out, &[&who[..], &options].concat());
        (number(&s, &["distances", "speed_m_s", "ks"]), number(&s, &["distances", "gap_m", "ks"]))
    };
    let (same, other, dense) = (ks("sparse-15", "1"), ks("sparse-15", "2"), ks("dense-15", "1"));
    let kinds = |scenario: &str| {
        let file = folder.path().join(scenario).join("statistics.json");
        let s: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
        let kinds = s["comparisons"].as_array().unwrap();
        assert_eq!((&kinds[0]["kind"], &kinds[1]["kind"]), (&"free".into(), &"bounded".into()));
        assert_eq!(kinds[0]["ks_of_speed"], s["distances"]["speed_m_s"]["ks"]);
        assert_eq!(kinds[1]["ks_of_speed"], s["bounded"]["distances"]["speed_m_s"]["ks"]);
        assert!(kinds.iter().all(|k| k["definition"].as_str().unwrap().len() > 40));
        kinds[0]["within_bound"].as_bool().unwrap()
    };
    assert!(kinds("sparse-15-1") && !kinds("dense-15-1"));
    assert!(same.0 < 0.02 && same.1 < 0.05, "its own trajectories: {same:?}");
    assert!(other.0 < 0.3, "{other:?}");
    assert!(dense.1 > 0.5, "{dense:?}");
}

#[test]
fn recorded_traffic_in_mode_rep_has_the_speeds_of_its_file() {
    for class in ["Fast", "Middle", "Slow"] {
        let Some(file) = shared(&format!("traffic_recorded/mapped_{class}_sample1.csv.gz")) else {
            return;
        };
        let folder = tempfile::tempdir().unwrap();
        let source = format!("replay:{file}");
        let options = ["--scenario", "flat", "--road", "recording:2", "--mode", "rep"];
        let more = ["--traffic", &source, "--compare", &file];
        let s = statistics(&folder.path().join("out"), &[&options[..], &more].concat());
        assert_eq!(s["mode"], "rep");
        let ks = number(&s, &["distances", "speed_m_s", "ks"]);
        assert!(ks <= 0.10, "{class}: {ks}");
        assert!(number(&s, &["measured", "speed_m_s", "samples"]) > 10_000.0);
    }
}

#[test]
fn a_calibration_brings_the_speeds_nearer_and_is_a_scenario_that_drives_again() {
    let folder = tempfile::tempdir().unwrap();
    let truth = folder.path().join("truth");
    let jam = folder.path().join("jam.toml");
    std::fs::write(folder.path().join("road.csv"), "s_m,z_m\n0,0\n300,0\n600,0\n").unwrap();
    let text = "schema = 1\nname = \"jam\"\nroad = \"road.csv\"\n\
        [truck]\nfile = \"sinotruk\"\npayload_kg = 30000.0\n\
        [traffic.native]\nspawn_probability = 0.04\nmax_speed_m_s = 20.0\n\
        outflow_speed_m_s = 6.0\noutflow_sigma_m_s = 2.0\nwarm_up_s = 100.0\n";
    std::fs::write(&jam, text).unwrap();
    statistics(&truth, &["--scenario", jam.to_str().unwrap(), "--duration", "40"]);
    let file = truth.join("trajectories.parquet").display().to_string();
    let out = folder.path().join("calibrated");
    let options = ["--scenario", "flat", "--calibrate", &file, "--compare", &file];
    let s = statistics(&out, &[&options[..], &["--generations", "1", "--duration", "60"]].concat());
    assert_eq!(s["calibrated_to"].as_array().unwrap().len(), 1);
    let before = statistics(
        &folder.path().join("before"),
        &["--scenario", "medium-15", "--compare", &file, "--duration", "60"],
    );
    let ks = |s: &Value| number(s, &["distances", "speed_m_s", "ks"]);
    assert!(ks(&s) < 0.7 * ks(&before), "{} from {}", ks(&s), ks(&before));
    let again = out.join("calibrated.toml").display().to_string();
    let again = statistics(
        &folder.path().join("again"),
        &["--scenario", &again, "--compare", &file, "--duration", "60"],
    );
    assert_eq!(ks(&again), ks(&s), "the file holds all that was found");
}

/// `traffic --duration 1e9` grew until memory was full, and Ctrl-C threw away what it had seen.
#[test]
#[expect(clippy::disallowed_methods, reason = "the test waits for another process")]
fn ctrl_c_writes_what_there_is_and_a_duration_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let line = refused(&["traffic", "--duration", "1e9", "--out", out.to_str().unwrap()]);
    assert!(line.contains("--duration") && line.contains("86400"), "{line}");

    let options = ["traffic", "--scenario", "medium-15", "--duration", "86400", "--out"];
    // Before there is anything to write, the program just ends; nobody knows how long that is.
    for seconds in [3, 10, 30] {
        let mut traffic = program().args(options).arg(&out).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_secs(seconds));
        let id = traffic.id().to_string();
        assert!(Command::new("kill").args(["-s", "TERM", &id]).status().unwrap().success());
        if traffic.wait().unwrap().code() == Some(0) {
            break;
        }
        assert!(!out.exists());
    }
    let written = std::fs::read_to_string(out.join("statistics.json")).unwrap();
    let statistics: Value = serde_json::from_str(&written).unwrap();
    assert_eq!(statistics["end_reason"], "interrupted");
    assert!(number(&statistics, &["simulated", "duration_s"]) > 0.0);
    assert!(out.join("trajectories.parquet").exists());
}

#[test]
fn what_cannot_be_read_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    let line = |options: &[&str]| refused(&[&["traffic", "--out", &out], options].concat());
    assert!(line(&["--compare", "nowhere.csv"]).contains("nowhere.csv"));
    assert!(line(&["--compare", empty.to_str().unwrap()]).contains("no recordings"));
    assert!(line(&["--scenario", "nowhere.toml"]).contains("nowhere.toml"));
    assert!(line(&["--duration", "-3"]).contains("-3"));
    assert!(line(&["--lanes", "0"]).contains("--lanes"));
    assert!(line(&["--mode", "rep"]).contains("replay:FILE"));
    assert!(line(&["--road", "recording:2"]).contains("traffic.replay.file"));
    assert!(!Path::new(&out).exists());
}
