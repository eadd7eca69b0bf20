//! `diagnose` refuses what cannot be diagnosed with one line that says why.

mod support;

use std::path::Path;

use support::refused;

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
