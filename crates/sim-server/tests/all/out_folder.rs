//! The folder of the results: not overwritten, nothing left behind by a failure, a full disk.

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use crate::support::{program, refused, server};

const RUN: [&str; 5] = ["run", "flat", "--headless", "--duration", "1"];
const PLAN: [&str; 13] = [
    "plan",
    "--truck",
    "sinotruk",
    "--road",
    "builtin:flat",
    "--mass-kg",
    "40000",
    "--set-speed-m-s",
    "20",
    "--speed-min-m-s",
    "18",
    "--speed-max-m-s",
    "22",
];
const TRAFFIC: [&str; 5] = ["traffic", "--scenario", "flat", "--duration", "2"];

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A command into a folder.
fn into(command: &[&str], out: &Path, more: &[&str]) -> Output {
    server(&[command, &["--out", text(out)], more].concat())
}

fn refused_into(command: &[&str], out: &Path) -> String {
    refused(&[command, &["--out", text(out)]].concat())
}

/// Runs the program with files limited to so many bytes, as a disk that fills up limits them.
fn with_little_room(bytes: u64, arguments: &[&str]) -> Output {
    // dash counts in blocks of 512 bytes
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$0\" \"$@\"", bytes / 512);
    let program = env!("CARGO_BIN_EXE_sim-server");
    Command::new("sh").args(["-c", &script, program]).args(arguments).output().unwrap()
}

/// The line of a command that met a full disk: exit code 1.
fn full(output: &Output) -> String {
    let line = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(1), "{line}");
    assert_eq!(line.lines().count(), 1, "{line}");
    assert!(line.contains("the disk is full"), "{line}");
    line
}

/// `plan --out DIR` of an earlier plan replaced it without a word, and so did `run` with a run.
#[test]
fn results_are_replaced_only_if_asked_for_and_whole() {
    for (command, result) in
        [(&RUN[..], "run.mcap"), (&PLAN, "plan.csv"), (&TRAFFIC, "statistics.html")]
    {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        assert!(into(command, &out, &[]).status.success());
        let files = || std::fs::read_dir(&out).unwrap().count();
        let (first, count) = (std::fs::read(out.join(result)).unwrap(), files());
        assert!(count >= 3, "all results are there");
        let line = refused_into(command, &out);
        assert!(line.contains("--overwrite") && line.contains(text(&out)), "{line}");
        assert_eq!(std::fs::read(out.join(result)).unwrap(), first);
        assert!(into(command, &out, &["--overwrite"]).status.success());
        assert!(!out.join(".replaced").exists() && files() == count);
    }
}

#[test]
fn no_command_writes_into_the_folder_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    assert!(into(&RUN, &out, &[]).status.success());
    let drives = ["--truck", "sinotruk", "--drives", text(&out)];
    for command in [
        &PLAN[..],
        &TRAFFIC,
        &[&["replay"], &drives[..]].concat(),
        &[&["diagnose"], &drives[..]].concat(),
        &[&["experiment", "suggest", "--causes", "air_drag"], &drives[..]].concat(),
    ] {
        assert!(refused_into(command, &out).contains("run.mcap is in it"), "{command:?}");
    }
}

/// A refused diagnosis of a recording left OUT/drives behind.
#[test]
fn a_refused_command_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(into(&RUN, &run, &[]).status.success());
    for command in ["diagnose", "replay"] {
        let out = folder.path().join("new/out");
        let line = refused_into(&[command, "--truck", "sinotruk", "--drives", text(&run)], &out);
        assert!(line.contains("of usable data"), "too short for a drive: {line}");
        assert!(!folder.path().join("new").exists(), "{command}");
    }
}

#[test]
fn a_disk_that_fills_up_ends_a_run_with_one_line_that_says_what_helps() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let run = ["run", "--headless", "--duration", "120", "--out", text(&out)];
    let line = full(&with_little_room(1_000_000, &run));
    let file = out.join("run.mcap");
    assert!(line.contains(text(&file)) && line.contains("sim-server recover"), "{line}");
    let recovered = server(&["recover", text(&file)]);
    let said = String::from_utf8(recovered.stdout).unwrap();
    assert!(recovered.status.success() && said.contains(" messages on "), "{said}");
    assert!(
        file.metadata().unwrap().len() < 999_936,
        "cut where its last chunk ends: there is room"
    );
    assert!(out.join("summary.json").exists());
    for entry in std::fs::read_dir(&out).unwrap() {
        assert!(entry.unwrap().metadata().unwrap().len() > 100, "no empty file is left");
    }

    let again = folder.path().join("again");
    let line = full(&with_little_room(2_048, &["run", "--headless", "--out", text(&again)]));
    assert!(line.contains("run.mcap") && !line.contains("recover"), "nothing to save: {line}");
    assert!(!again.exists(), "an empty recording is no use to anyone");
}

/// A run under way, twenty times real time for a minute.
fn under_way(out: &Path, temporary: &Path) -> Child {
    let run = ["run", "flat", "--headless", "--pace", "20", "--duration", "1200", "--out"];
    let mut command = program();
    command.args(run).arg(out).env("TMPDIR", temporary).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let recording = out.join("run.mcap");
    let is_recorded = || recording.metadata().is_ok_and(|m| m.len() > 100_000);
    let began = (0..1000).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        is_recorded()
    });
    if !began {
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert!(began, "nothing was recorded");
    child
}

/// The line of a run that could not go on or not be written: exit code 1, its summary elsewhere.
fn summary_elsewhere(run: Child, temporary: &Path) -> String {
    let output = run.wait_with_output().unwrap();
    let line = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), line.lines().count()), (Some(1), 1), "{line}");
    let (_, file) = line.trim_end().split_once("summary: ").expect(&line);
    assert!(Path::new(file).starts_with(temporary), "{line}");
    let summary: serde_json::Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    assert!(summary["duration_s"].as_f64().unwrap() > 0.5, "{summary}");
    line
}

/// A run whose folder was deleted drove to its end, wrote into a file without a name, and ended as
/// if its command line had been wrong.
#[test]
fn a_run_whose_folder_vanishes_ends_and_its_summary_is_kept_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let (out, temporary) = (folder.path().join("out"), tempfile::tempdir().unwrap());
    let run = under_way(&out, temporary.path());
    std::fs::remove_dir_all(&out).unwrap();
    let line = summary_elsewhere(run, temporary.path());
    assert!(line.contains("run.mcap: it was deleted") && !line.contains("recover"), "{line}");
}

/// The recording goes on in a folder that was moved away; what comes after it finds no place.
#[test]
fn a_run_whose_folder_was_moved_keeps_its_recording_and_its_summary() {
    let folder = tempfile::tempdir().unwrap();
    let (out, temporary) = (folder.path().join("out"), tempfile::tempdir().unwrap());
    let run = under_way(&out, temporary.path());
    let moved = folder.path().join("moved");
    std::fs::rename(&out, &moved).unwrap();
    let stop = Command::new("kill").args(["-TERM", &run.id().to_string()]).status().unwrap();
    assert!(stop.success());
    let line = summary_elsewhere(run, temporary.path());
    assert!(line.contains("out/summary.json"), "{line}");
    let whole = server(&["recover", text(&moved.join("run.mcap"))]);
    assert!(String::from_utf8(whole.stdout).unwrap().contains("the file was whole"));
}

#[test]
fn a_disk_that_fills_up_is_the_same_line_in_every_command_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let to = ["--out", text(&out)];
    for (command, file) in [(&PLAN[..], "plan.html"), (&TRAFFIC, "statistics.html")] {
        let line = full(&with_little_room(1_000_000, &[command, &to].concat()));
        assert!(line.contains(text(&out.join(file))), "{line}");
        assert!(!out.exists(), "{command:?}");
    }
    assert!(into(&RUN, &out, &[]).status.success());
    let recording = out.join("run.mcap");
    let line = full(&with_little_room(4_096, &["recover", text(&recording)]));
    assert!(line.contains("run.recovered.mcap"), "{line}");
    assert!(!out.join("run.recovered.mcap").exists());
}

/// `scenario list > FILE` on a full disk ended with 0 and an empty file.
#[test]
fn a_result_that_cannot_be_printed_is_a_failure() {
    let Ok(stdout) = std::fs::File::options().write(true).open("/dev/full") else { return };
    let output = program().args(["scenario", "list"]).stdout(stdout).output().unwrap();
    assert!(full(&output).contains("standard output"));
}
