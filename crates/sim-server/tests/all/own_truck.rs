//! From a data sheet to a truck file, and from drives to its figures.

use crate::support::{refused, server};

#[test]
fn the_template_is_a_sheet_that_makes_a_truck_which_drives() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (answers, truck) = (at("answers.toml"), at("truck.toml"));
    let printed = server(&["truck", "new", "--template"]);
    assert!(printed.status.success());
    std::fs::write(&answers, &printed.stdout).unwrap();
    let made = ["truck", "new", "--from", &answers, "--out", &truck];
    let output = server(&made);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("estimates") && said.contains("resistance.drag_area_m2"), "{said}");
    let line = refused(&made);
    assert!(line.contains("--overwrite"), "{line}");
    let sheet = at("sheet.toml");
    let output = server(&["truck", "sheet", &truck, "--payload-kg", "10000", "--out", &sheet]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_sheet_that_cannot_be_gets_one_line_with_all_that_is_wrong_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (answers, truck) = (at("answers.toml"), at("truck.toml"));
    let template = String::from_utf8(server(&["truck", "new", "--template"]).stdout).unwrap();
    let wrong = template
        .replace("tractor_kg = 7900.0", "tractor_kg = 7.9")
        .replace("max_torque_nm = 2300.0", "");
    std::fs::write(&answers, wrong).unwrap();
    let line = refused(&["truck", "new", "--from", &answers, "--out", &truck]);
    assert!(line.contains("tractor_kg = 7.9") && line.contains("max_torque_nm"), "{line}");
    std::fs::write(&answers, template.replace("wheelbase_m", "wheel_base_m")).unwrap();
    let line = refused(&["truck", "new", "--from", &answers, "--out", &truck]);
    assert!(line.contains("wheel_base_m") && line.contains("line 18"), "{line}");
    assert!(!std::path::Path::new(&truck).exists());
}

const EXAMPLES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples");

/// Drives in order of the built-in truck: what comes out is a truck file that diagnosis takes.
#[test]
fn drives_make_a_truck_file_whose_figures_say_where_they_are_from() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("identified").display().to_string();
    let drives = format!("{EXAMPLES}/baseline");
    let command = ["identify", "--truck", "reference", "--drives", &drives, "--out", &out];
    let output = server(&command);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("resistance.drag_area_m2"), "{said}");
    let read = |name: &str| std::fs::read_to_string(format!("{out}/{name}")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&read("identify.json")).unwrap();
    let figures = report["figures"].as_array().unwrap();
    let drag = figures.iter().find(|f| f["path"] == "resistance.drag_area_m2").unwrap();
    let [low, high] = [0, 1].map(|i| drag["interval_90"][i].as_f64().unwrap());
    assert!(low < 6.2 && 6.2 < high && high - low < 2.0, "{low} to {high}");
    assert!(!report["not_told"].as_array().unwrap().is_empty());
    let truck = read("reference.identified.toml");
    assert!(truck.contains("known_by = \"drives\"") && truck.contains("baseline"), "{truck}");
    let replayed = folder.path().join("replayed").display().to_string();
    let truck = format!("{out}/reference.identified.toml");
    let output = server(&["replay", "--truck", &truck, "--drives", &drives, "--out", &replayed]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(refused(&command).contains("--overwrite"));
}
