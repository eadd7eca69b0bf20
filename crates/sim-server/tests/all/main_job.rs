//! The main job through the program: files, determinism, interruption.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::support::{program, server};
use serde_json::Value;

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Runs `run` with these options into a fresh folder and returns its summary.
fn summary_of(options: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = server(&[&["run", "--out", &out.display().to_string()], options].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(out.join("run.mcap").metadata().unwrap().len() > 1000);
    json(&out.join("summary.json"))
}

#[test]
fn the_summary_has_the_keys_of_the_contract() {
    let summary = summary_of(&["--headless", "--duration", "5", "--seed", "3"]);
    for key in [
        "distance_m",
        "duration_s",
        "mean_speed_m_s",
        "fuel_g",
        "brake_energy_j",
        "lane_changes",
        "collisions",
        "min_time_to_collision_s",
        "rss_violations",
        "delta_speed_frac",
        "max_lateral_error_m",
        "max_trailer_lateral_error_m",
        "guard_activations",
        "missed_deadlines",
        "version",
        "git_revision",
    ] {
        assert!(summary.get(key).is_some(), "{key}");
    }
    assert_eq!((&summary["schema"], &summary["seed"]), (&1.into(), &3.into()));
    for quantile in ["p50", "p99", "max"] {
        assert!(summary["tick_time_us"][quantile].as_f64().unwrap() > 0.0, "{quantile}");
    }
    assert_eq!(summary["end_reason"], "time_over");
}

#[test]
fn a_learned_decider_drives_from_its_files() {
    let weights =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../planner/tests/fixtures/policy.safetensors");
    let file = format!("dqn:{}", weights.display());
    for decider in [file.as_str(), "dqn"] {
        let summary = summary_of(&["--headless", "--duration", "40", "--decider", decider]);
        assert_eq!(summary["collisions"], 0, "{decider}");
        assert_eq!(summary["end_reason"], "time_over", "{decider}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_with_and_without_recorder_dashboard_and_pace() {
    let options = ["--duration", "60", "--seed", "11"];
    let headless = summary_of(&[&["--headless"], &options[..]].concat());
    let shown = summary_of(&[&["--port", "0", "--pace", "max"], &options[..]].concat());
    let paced = summary_of(&[&["--headless", "--pace", "60"], &options[..]].concat());
    let mut scenario = sim::Scenario::builtin("highway").unwrap();
    scenario.run.duration_s = 60.0;
    let alone = sim::World::new(&scenario, 11).unwrap().run(&mut ()).unwrap();
    assert!(alone.distance_m > 200.0);
    for summary in [&headless, &shown, &paced] {
        assert_eq!(summary["state_hash"], alone.state_hash.as_str());
        assert_eq!(summary["fuel_g"], alone.fuel_g);
    }
    let other = summary_of(&["--headless", "--duration", "60", "--seed", "12"]);
    assert_ne!(other["state_hash"], headless["state_hash"], "the seed matters");
}

#[test]
fn json_is_the_summary_and_nothing_else_on_stdout() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let output = server(&["run", "--headless", "--duration", "2", "--json", "--out", &out]);
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(printed, json(&folder.path().join("summary.json")));
    assert!(output.stderr.is_empty(), "no progress where there is no terminal");
}

#[test]
fn without_a_folder_each_run_gets_a_new_one_under_runs() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["flat-1", "flat-1-2", "flat-1-3"] {
        let output = program()
            .args(["run", "flat", "--headless", "--duration", "1"])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(output.status.success());
        assert!(folder.path().join("runs").join(name).join("run.mcap").exists(), "{name}");
    }
}

/// Starts a run, waits until the recording has this many bytes, and returns the process.
#[expect(clippy::disallowed_methods, reason = "the test waits for another process")]
fn under_way(command: &mut Command, recording: &Path, bytes: u64) -> Child {
    let mut run = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    for _ in 0..1200 {
        if recording.metadata().is_ok_and(|m| m.len() > bytes) || run.try_wait().unwrap().is_some()
        {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    run
}

fn signal(process: &Child, name: &str) {
    let kill = ["-s", name, &process.id().to_string()].map(str::to_owned);
    assert!(Command::new("kill").args(kill).status().unwrap().success());
}

/// A hangup (the terminal is closed) killed the run and left a torn recording. The tests themselves may
/// run under `nohup`.
#[test]
fn ctrl_c_sigterm_and_a_hangup_finish_the_recording_and_the_summary() {
    for name in ["INT", "TERM", "HUP"] {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("run.mcap");
        let arguments = ["run", "--headless", "--pace", "20", "--out"];
        let mut command = Command::new("env");
        command.args(["--default-signal=HUP", env!("CARGO_BIN_EXE_sim-server")]);
        let mut run = under_way(command.args(arguments).arg(folder.path()), &recording, 600_000);
        signal(&run, name);
        assert_eq!(run.wait().unwrap().code(), Some(0));
        let summary = json(&folder.path().join("summary.json"));
        assert_eq!(summary["end_reason"], "interrupted");
        let recording = fs::read(recording).unwrap();
        let file = mcap::Summary::read(&recording).unwrap().expect("a summary section");
        let ticks = (summary["duration_s"].as_f64().unwrap() / 0.01).round() as u64 + 1;
        let statistics = file.stats.unwrap();
        let clock = file.channels.values().find(|c| c.topic == "/clock").unwrap();
        assert_eq!(statistics.channel_message_counts[&clock.id], ticks, "every tick is there");
    }
}

/// With `--keep-open` the first SIGTERM ended the run only, and the server waited for another.
#[test]
fn one_sigterm_ends_a_server_that_is_kept_open() {
    let folder = tempfile::tempdir().unwrap();
    let (recording, summary) = (folder.path().join("run.mcap"), folder.path().join("summary.json"));
    let serve = |more: &[&str], wait_for: &Path, bytes| {
        let fixed = ["run", "flat", "--port", "0", "--keep-open", "--overwrite", "--out"];
        let command = &mut program();
        under_way(command.args(fixed).arg(folder.path()).args(more), wait_for, bytes)
    };
    let mut under_way = serve(&[], &recording, 10_000);
    signal(&under_way, "TERM");
    assert_eq!(under_way.wait().unwrap().code(), Some(0));
    assert_eq!(json(&summary)["end_reason"], "interrupted");

    fs::remove_file(&summary).unwrap();
    let mut ended = serve(&["--duration", "1", "--pace", "max"], &summary, 100);
    signal(&ended, "TERM");
    assert_eq!(ended.wait().unwrap().code(), Some(0));
    assert_eq!(json(&summary)["end_reason"], "time_over");
}

/// `nohup` starts a program with hangups ignored: they do not end the run.
#[test]
fn a_run_under_nohup_goes_on_after_a_hangup() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("run.mcap");
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_sim-server")]);
    shell.args(["run", "flat", "--headless", "--pace", "10", "--duration", "30", "--out"]);
    let mut run = under_way(shell.arg(folder.path()), &recording, 20_000);
    signal(&run, "HUP");
    assert_eq!(run.wait().unwrap().code(), Some(0));
    assert_eq!(json(&folder.path().join("summary.json"))["end_reason"], "time_over");
}

#[test]
fn built_in_scenarios_are_listed_and_shown_as_they_can_be_run() {
    let list = server(&["scenario", "list", "--json"]);
    let list: Value = serde_json::from_slice(&list.stdout).unwrap();
    let names: Vec<&str> =
        list["scenarios"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"highway") && names.contains(&"test-site"));
    for name in names {
        let shown = server(&["scenario", "show", name]);
        let text = String::from_utf8(shown.stdout).unwrap();
        assert_eq!(sim::Scenario::from_toml_str(name, &text).unwrap().name, name);
    }
}
