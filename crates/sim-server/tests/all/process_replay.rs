//! The recorded inputs of the stack, and of the bus before it, through both again.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use crate::support::{refused, server};
use serde_json::Value;

/// Drives a scenario; gives its recording and its summary.
fn run(folder: &Path, words: &[&str]) -> (PathBuf, Value) {
    let out = folder.join("out");
    let options = ["run", "--headless", "--json", "--overwrite", "--out", out.to_str().unwrap()];
    let output = server(&[&options[..], words].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (out.join("run.mcap"), serde_json::from_slice(&output.stdout).unwrap())
}

/// Replays a recording; gives the exit code and the report.
fn replayed(file: &Path, options: &[&str]) -> (i32, Value) {
    let words = ["process-replay", file.to_str().unwrap(), "--json"];
    let output = server(&[&words[..], options].concat());
    let report = serde_json::from_slice(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    (output.status.code().unwrap(), report.unwrap_or_else(|_| panic!("{stderr}")))
}

fn assert_same(file: &Path, from: &str, ticks: u64) {
    let (code, report) = replayed(file, &["--from", from]);
    assert_eq!((code, &report["ticks_compared"]), (0, &ticks.into()), "{report}");
    assert_eq!(report["ticks_different"], 0, "{report}");
    assert!(report["first_difference"].is_null(), "{report}");
    assert_eq!(report["schema"], 1);
}

#[test]
fn direct_drives_come_out_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (file, summary) = run(folder.path(), &["highway-sag", "--duration", "200"]);
    assert!(summary["lane_changes"].as_u64().unwrap() > 0, "{summary}");
    assert_same(&file, "ego", 20_000);
    let planned = ["dense-15", "--speed-planner", "predictive", "--decider", "mobil"];
    for words in [&planned[..], &["incident", "--decider", "rules:50"]] {
        let (file, _) = run(folder.path(), &[words, &["--duration", "60"]].concat());
        assert_same(&file, "ego", 6_000);
    }
}

#[test]
fn drives_over_a_bus_come_out_bit_for_bit_from_frames_and_from_the_ego_state() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["highway", "--vehicle", "bus", "--speed-planner", "predictive"];
    let (file, _) = run(folder.path(), &[&words[..], &["--duration", "40"]].concat());
    assert_same(&file, "frames", 4_000);
    assert_same(&file, "ego", 4_000);
}

#[test]
fn after_a_changed_parameter_the_first_difference_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (file, _) = run(folder.path(), &["flat", "--vehicle", "bus", "--duration", "5"]);
    for from in ["frames", "ego"] {
        let (code, report) = replayed(&file, &["--from", from, "--set", "set_speed_m_s=19.5"]);
        assert_eq!(code, 1, "{report}");
        let first = &report["first_difference"];
        assert_eq!(first["field"], "command accelerator_pedal_frac", "{report}");
        let tick = first["tick"].as_f64().unwrap();
        assert!((first["time_s"].as_f64().unwrap() - 0.01 * tick).abs() < 1e-9, "{report}");
        let pedal = |key: &str| first[key].as_str().unwrap().parse::<f64>().unwrap();
        assert!(pedal("replayed") < pedal("recorded"), "slower: {report}");
        assert!(report["ticks_different"].as_u64().unwrap() <= 500, "{report}");
    }
}

/// The same file without the topics that hold inputs of the stack: as earlier versions wrote it.
fn without_inputs(file: &Path, to: &Path) {
    let bytes = std::fs::read(file).unwrap();
    let mut writer = mcap::Writer::new(BufWriter::new(File::create(to).unwrap())).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if !message.channel.topic.starts_with("/stack/") {
            writer.write(&message).unwrap();
        }
    }
    let metadata = [("seed".to_owned(), "1".to_owned())].into();
    let run = mcap::records::Metadata { name: "run".to_owned(), metadata };
    writer.write_metadata(&run).unwrap();
    writer.finish().unwrap();
}

#[test]
fn what_cannot_be_replayed_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let (file, _) = run(folder.path(), &["flat", "--duration", "3"]);
    let at = |name: &str| folder.path().join(name);
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(at("torn.mcap"), &whole[..whole.len() / 2]).unwrap();
    std::fs::write(at("foreign.mcap"), "no recording").unwrap();
    let mut foreign = mcap::Writer::new(BufWriter::new(File::create(at("other.mcap")).unwrap()));
    foreign.as_mut().unwrap().finish().unwrap();
    without_inputs(&file, &at("old.mcap"));
    for (name, options, says) in [
        ("torn.mcap", &[][..], "it is torn: `sim-server recover`"),
        ("foreign.mcap", &[], "not an MCAP file"),
        ("other.mcap", &[], "no recording of this program"),
        ("old.mcap", &[], "it has no /stack/input"),
        ("nowhere.mcap", &[], "No such file"),
        ("out/run.mcap", &["--from", "frames"], "it has no frames of a bus"),
        ("out/run.mcap", &["--set", "guard.nonsense=1"], "there are accel_max_m_s2"),
        (
            "out/run.mcap",
            &["--set", "guard.frozen_max_s=x"],
            "expected f64 in `guard.frozen_max_s`",
        ),
        ("out/run.mcap", &["--set", "guard.frozen_max_s=99"], "guard.frozen_max_s"),
        ("out/run.mcap", &["--road", "builtin:highway"], "is not the one that was driven"),
    ] {
        let path = at(name);
        let line = refused(&[&["process-replay", path.to_str().unwrap()], options].concat());
        assert!(line.contains(says), "{name} {options:?}: {line}");
    }
    let torn = at("torn.mcap");
    assert!(server(&["recover", torn.to_str().unwrap()]).status.success());
    let (code, report) = replayed(&at("torn.recovered.mcap"), &[]);
    assert_eq!((code, &report["ticks_different"]), (0, &0.into()), "{report}");
    assert!(report["ticks_compared"].as_u64().unwrap() >= 100, "{report}");
}
