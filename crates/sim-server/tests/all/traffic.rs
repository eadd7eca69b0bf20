//! Traffic sources and modes through the program; tests of SUMO print why they are skipped without.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{program, refused, server};
use serde_json::Value;

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn sumo_is_here() -> bool {
    match traffic_client::sumo::Programs::find(None) {
        Ok(_) => true,
        Err(e) => {
            eprintln!("skipped: {e}");
            false
        }
    }
}

/// Runs `run` into a folder and returns its summary.
fn run_into(out: &Path, options: &[&str]) -> Value {
    let fixed = ["run", "--headless", "--out", out.to_str().unwrap()];
    let output = server(&[&fixed, options].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    json(&out.join("summary.json"))
}

#[test]
fn a_run_in_sumo_traffic_meets_others_and_hits_nobody() {
    if !sumo_is_here() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let summary = run_into(&out, &["medium-15", "--traffic", "sumo", "--duration", "60"]);
    assert_eq!((&summary["collisions"], &summary["traffic"]["mode"]), (&0.into(), &"inter".into()));
    assert!(summary["traffic"]["engine"].as_str().unwrap().starts_with("SUMO 1."), "{summary}");
    assert!(summary["vehicles_met"].as_u64().unwrap() > 5, "{summary}");
    assert!(out.join("sumo/road.net.xml").exists(), "everything lies in the folder that was given");
}

#[test]
fn a_manifest_repeats_a_run_with_its_seed_and_refuses_another_one() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    let first = run_into(&a, &["dense-12.5", "--duration", "30", "--seed", "9"]);
    let manifest = a.join("traffic.manifest.toml").display().to_string();
    let repeat = ["dense-12.5", "--mode", "re", "--manifest", &manifest];
    let second = run_into(&b, &[&repeat[..], &["--duration", "30"]].concat());
    assert_eq!((&second["state_hash"], &second["seed"]), (&first["state_hash"], &9.into()));
    let out = folder.path().join("c").display().to_string();
    let other = |options: &[&str]| {
        refused(&[&["run", "--headless", "--out", &out], &repeat[..], options].concat())
    };
    assert!(other(&["--seed", "10"]).contains("seed was `9`, is `10`"));
    assert!(other(&["--payload-kg", "1000"]).contains("payload_kg"));
    assert!(!Path::new(&out).exists());
}

#[test]
fn sources_and_modes_that_cannot_be_are_one_line() {
    for (options, named) in [
        (&["--traffic", "trains"][..], "trains"),
        (&["--traffic", "replay"], "replay:FILE"),
        (&["--traffic", "replay:nowhere.csv"], "nowhere.csv"),
        (&["--mode", "all"], "all"),
        (&["--mode", "re"], "manifest"),
        (&["--mode", "rep"], "replay:FILE"),
        (&["--traffic", "native", "--on-traffic-failure", "pray"], "pray"),
        (&["--manifest", "nowhere.toml"], "nowhere.toml"),
    ] {
        let line = refused(&[&["run", "--headless"], options].concat());
        assert!(line.contains(named), "{options:?}: {line}");
    }
}

#[test]
fn without_sumo_the_line_says_how_to_get_it_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = program()
        .env_clear()
        .env("PATH", "/nowhere")
        .args(["run", "--headless", "--traffic", "sumo", "--out", out.to_str().unwrap()])
        .output()
        .unwrap();
    let line = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{line}");
    assert!(line.contains("pip install eclipse-sumo") && line.contains("SUMO_BINARY"), "{line}");
    assert!(!out.exists());
}

#[test]
fn a_sumo_that_is_named_but_not_there_is_not_replaced_by_another_one() {
    let folder = tempfile::tempdir().unwrap();
    let output = program()
        .env("SUMO_BINARY", "/nowhere/sumo")
        .args(["run", "--headless", "--duration", "1", "--traffic", "sumo", "--out"])
        .arg(folder.path().join("out"))
        .output()
        .unwrap();
    let line = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{line}");
    assert!(line.contains("/nowhere/sumo"), "{line}");
}

/// Process id of the child that a process has started.
fn child_of(pid: u32) -> Option<u32> {
    std::fs::read_dir("/proc").unwrap().flatten().find_map(|entry| {
        let child = entry.file_name().to_str()?.parse().ok()?;
        let stat = std::fs::read_to_string(entry.path().join("stat")).ok()?;
        let after_name = stat.rsplit_once(')')?.1;
        let parent: u32 = after_name.split_whitespace().nth(1)?.parse().ok()?;
        (parent == pid).then_some(child)
    })
}

/// Drives in SUMO traffic, kills SUMO in the middle of it, and waits for the end.
fn killed_in(out: &Path, options: &[&str]) -> std::process::Output {
    let fixed = ["run", "--headless", "--traffic", "sumo", "--pace", "4", "--duration", "40"];
    let mut run = program()
        .args([&fixed[..], &["--out", out.to_str().unwrap()], options].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The road is recorded before SUMO is there: the run goes on once much more than that came.
    let begun = |out: &Path| out.join("run.mcap").metadata().is_ok_and(|m| m.len() > 1_000_000);
    let start = Instant::now();
    let sumo = loop {
        if let Some(sumo) = child_of(run.id()).filter(|_| begun(out)) {
            break sumo;
        }
        if start.elapsed() > Duration::from_secs(60) {
            run.kill().unwrap();
            panic!("no SUMO, or no recording");
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    let kill = Command::new("kill").args(["-9", &sumo.to_string()]).status().unwrap();
    assert!(kill.success());
    run.wait_with_output().unwrap()
}

#[test]
fn a_killed_sumo_ends_the_run_with_whole_files_or_the_native_engine_goes_on() {
    if !sumo_is_here() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("stop");
    let output = killed_in(&out, &[]);
    let line = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{line}");
    assert!(line.contains("SUMO went away at") && line.contains("signal: 9"), "{line}");
    let summary = json(&out.join("summary.json"));
    assert_eq!(summary["end_reason"], "failed");
    assert!(summary["distance_m"].as_f64().unwrap() > 1.0);
    assert!(out.join("traffic.manifest.toml").exists());
    let bytes = std::fs::read(out.join("run.mcap")).unwrap();
    let messages =
        mcap::MessageStream::new(&bytes).unwrap().inspect(|m| assert!(m.is_ok())).count();
    assert!(messages > 100, "{messages} messages");

    let out = folder.path().join("go_on");
    let output = killed_in(&out, &["--on-traffic-failure", "native"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let summary = json(&out.join("summary.json"));
    assert_eq!((&summary["end_reason"], &summary["collisions"]), (&"time_over".into(), &0.into()));
    assert!(summary["traffic"]["failure"].as_str().unwrap().contains("SUMO went away"));
}
