//! `plan` and `map check` through the program.

use crate::support::server;
use serde_json::Value;

#[test]
fn a_plan_is_written_as_table_json_and_picture() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("plan");
    let output = server(&[
        "plan",
        "--truck",
        "sinotruk",
        "--road",
        "builtin:test-site",
        "--mass-kg",
        "55000",
        "--set-speed-m-s",
        "20",
        "--speed-min-m-s",
        "16.7",
        "--speed-max-m-s",
        "23.6",
        "--out",
        &out.display().to_string(),
        "--json",
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |pointer: &str| plan.pointer(pointer).and_then(Value::as_f64).unwrap();
    for baseline in ["", "/baseline_set_speed", "/baseline_overspeed_5_km_h"] {
        for key in ["fuel_g", "trip_time_s", "brake_energy_j"] {
            assert!(number(&format!("{baseline}/{key}")) >= 0.0);
        }
    }
    assert!(number("/saving_frac/vs_set_speed") > 0.0);
    assert!(number("/saving_frac/vs_overspeed") > -0.05);
    for key in ["iterations", "sqp_iterations", "solve_time_ms"] {
        assert!(number(&format!("/solver/{key}")) > 0.0, "{key}");
    }
    assert!(number("/solver/max_violation") < 0.05);
    assert!(plan["solver"]["status"].is_string());

    let table = std::fs::read_to_string(out.join("plan.csv")).unwrap();
    let mut lines = table.lines();
    assert_eq!(
        lines.next(),
        Some("s_m,v_m_s,time_s,gear,drive_force_n,brake_force_n,fuel_g,grade_rad")
    );
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    assert!(rows.len() > 500 && rows.iter().all(|row| row.len() == 8));
    assert!(rows.windows(2).all(|w| w[1][0] > w[0][0] && w[1][2] > w[0][2] && w[1][6] >= w[0][6]));
    let last = &rows[rows.len() - 1];
    assert!((last[2] - number("/trip_time_s")).abs() < 1.0);
    let picture = std::fs::read_to_string(out.join("plan.html")).unwrap();
    let (head, body) = picture.split_once("<body>").unwrap();
    assert!(body.contains("Plotly.newPlot") && body.contains("overspeed"));
    assert!(head.len() > 1_000_000 && !body.contains("src="), "the picture needs no network");
}

#[test]
fn a_map_check_reports_lanes_length_grade_range_and_jumps() {
    let output = server(&["map", "check", "builtin:highway", "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["length_m"], 15_000.0);
    assert!(report["grade_frac"]["max"].as_f64().unwrap() > 0.01);
    assert!(report["lanes"].as_array().unwrap().len() >= 4);
    let text = server(&["map", "check", "builtin:highway"]);
    assert!(String::from_utf8(text.stdout).unwrap().contains("jumps"));
}

#[test]
fn a_map_check_counts_what_an_opendrive_file_holds_and_what_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("straight.xodr");
    std::fs::write(&file, STRAIGHT).unwrap();
    let output = server(&["map", "check", &file.display().to_string(), "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["roads"], &report["revision"]), (&1.into(), &"1.6".into()));
    assert_eq!(report["length_m"], 250.0);
    assert_eq!(report["lanes"]["driving"], 1);
    assert!(report["grade_frac"].to_string().contains("0.02"));
    let text = server(&["map", "check", &file.display().to_string()]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.contains("1 roads") && text.contains("250.0 m"), "{text}");
}

/// One road of 250 m, 2 % uphill, one driving lane.
const STRAIGHT: &str = r#"<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="straight"/>
<road name="r" length="250.0" id="1" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="250.0"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="0" b="0.02" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"#;
