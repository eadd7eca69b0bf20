//! Roads with values that no highway has, and a truck that leaves the road.

use std::fs;
use std::path::Path;

use crate::support::server;
use serde_json::Value;

/// A level road of 1.2 km that turns right with this radius between 700 and 760 m.
fn bend(folder: &Path, radius_m: f64, limit_m_s: f64) -> String {
    let mut text = "s_m,z_m,curvature_1_m,speed_limit_m_s\n".to_owned();
    for i in 0..=120 {
        let s = 10.0 * f64::from(i);
        let k = if (700.0..=760.0).contains(&s) { -1.0 / radius_m } else { 0.0 };
        text.push_str(&format!("{s},0,{k},{limit_m_s}\n"));
    }
    let file = folder.join("bend.csv");
    fs::write(&file, text).unwrap();
    file.display().to_string()
}

/// One straight road of 2 km with a lane of the given width and limit.
fn lane(folder: &Path, width_m: f64, limit_m_s: f64) -> String {
    let text = format!(
        r#"<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="6" name="lane"/>
<road name="r" length="2000" id="1" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="2000"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none" level="false"/></center>
<right><lane id="-1" type="driving" level="false">
<width sOffset="0" a="3.5" b="0" c="0" d="0"/>
<width sOffset="1000" a="{width_m}" b="0" c="0" d="0"/>
<speed sOffset="0" max="{limit_m_s}" unit="m/s"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"#
    );
    let file = folder.join("lane.xodr");
    fs::write(&file, text).unwrap();
    file.display().to_string()
}

/// Exit code and stderr of both commands on a road.
fn both(road: &str, folder: &Path) -> [(Option<i32>, String); 2] {
    let out = folder.join("out").display().to_string();
    let run = [
        "run",
        "flat",
        "--road",
        road,
        "--headless",
        "--duration",
        "1",
        "--overwrite",
        "--out",
        &out,
    ];
    [&["map", "check", road][..], &run].map(|arguments| {
        let output = server(arguments);
        let both = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(both).unwrap())
    })
}

#[test]
fn lanes_that_no_road_has_are_refused_by_name_by_map_check_and_run_alike() {
    // Lanes of 1e9 m and of negative width were driven on without a word.
    let folder = tempfile::tempdir().unwrap();
    for (width_m, named) in [(1e9, "width_m = 1000000000"), (-2.0, "width_m = -2")] {
        for (code, text) in both(&lane(folder.path(), width_m, 25.0), folder.path()) {
            assert_eq!(code, Some(2), "{text}");
            assert!(text.contains(named) && text.contains("s = 1000.0 m"), "{text}");
        }
    }
    assert!(!folder.path().join("out").exists());
}

#[test]
fn limits_and_bends_that_are_hardly_meant_are_warned_of_by_both() {
    // A limit of 80 m/s is one of 80 km/h in the wrong unit; a bend of 20 m lies on no highway.
    let folder = tempfile::tempdir().unwrap();
    for (road, named) in [
        (lane(folder.path(), 3.5, 80.0), "speed_limit_m_s = 80"),
        (bend(folder.path(), 20.0, 25.0), "curvature_1_m = -0.05"),
    ] {
        for (code, text) in both(&road, folder.path()) {
            assert_eq!(code, Some(0), "{text}");
            assert!(text.contains(named) && text.contains("s = "), "{text}");
        }
    }
}

#[test]
fn a_trailer_that_cuts_a_bend_across_the_border_ends_the_run_unless_it_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let road = bend(folder.path(), 25.0, 25.0);
    let summary = |name: &str, more: &[&str]| -> Value {
        let out = folder.path().join(name);
        let out_text = out.display().to_string();
        let run = ["run", "flat", "--road", &road, "--headless", "--out", &out_text];
        let output = server(&[&run[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_str(&fs::read_to_string(out.join("summary.json")).unwrap()).unwrap()
    };
    let ended = summary("ended", &[]);
    assert_eq!(ended["end_reason"], "off_road");
    assert_eq!(ended["off_road_events"], 1);
    let allowed = summary("allowed", &["--allow-off-road"]);
    assert_eq!(allowed["end_reason"], "road_end");
    assert!(allowed["off_road_events"].as_u64().unwrap() >= 1);
    assert!(allowed["off_road_time_s"].as_f64().unwrap() > 1.0);
    assert!(allowed["distance_m"].as_f64().unwrap() > ended["distance_m"].as_f64().unwrap());
}
