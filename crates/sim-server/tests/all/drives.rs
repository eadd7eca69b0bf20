//! `drives from-can`: logs of real trucks into measured drives, and logs that hold none.

use std::path::Path;

use crate::support::columns::Columns;
use crate::support::{refused, server};
use serde_json::Value;

const LOGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/j1939");

fn log(name: &str) -> String {
    format!("{LOGS}/{name}.log.gz")
}

#[test]
fn half_a_minute_of_a_real_truck_becomes_a_drive_that_says_where_it_is_from() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("drives").display().to_string();
    let log = log("t270_normal");
    let command = ["drives", "from-can", &log, "--truck", "reference", "--min-drive-s", "20"];
    let output = server(&[&command[..], &["--out", &out]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read_to_string(Path::new(&out).join(name)).unwrap();
    let report: Value = serde_json::from_str(&read("conversion.json")).unwrap();
    let of_log = &report["logs"][0];
    let columns = of_log["columns"].as_array().unwrap();
    let speed = columns.iter().find(|c| c["column"] == "speed_m_s").unwrap();
    // the front axle has finer steps than the cab's speed, which is named beside it
    assert_eq!(
        (&speed["signal"], &speed["address"]),
        (&"EBC2.front_axle_speed".into(), &11.into())
    );
    assert_eq!(speed["others"][0], "CCVS1.speed of 00 on channel 0");
    let missing = of_log["missing"].as_array().unwrap();
    assert!(missing.iter().any(|m| m["why"] == "nobody sends VDC2.yaw_rate"));
    // half a minute without a map: what can be asked of it, and what not and why
    let notes = of_log["drives"][0]["notes"].as_array().unwrap();
    assert!(notes.iter().any(|n| n.as_str().unwrap().contains("too short for diagnose")));
    let causes = report["columns_for"].as_array().unwrap();
    assert!(causes.contains(&"turbo_lag".into()) && !causes.contains(&"mass".into()));
    let not = report["not_observable"].as_array().unwrap();
    let mass = not.iter().find(|n| n["id"] == "mass").unwrap();
    assert_eq!(mass["missing_columns"], serde_json::json!(["grade_frac"]));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("for want of grade_frac, of: rolling_resistance"), "{said}");
    let table = Columns::read(&Path::new(&out).join("t270_normal_1.csv").display().to_string());
    assert!(table.rows.len() > 550, "{} rows", table.rows.len());
    let (least, most) = table
        .of("speed_m_s")
        .into_iter()
        .fold((f64::MAX, 0.0_f64), |(a, b), v| (a.min(v), b.max(v)));
    // the README of the log: 23 to 55 km/h, gears 2 to 4
    assert!((5.0..8.0).contains(&least) && (14.0..16.0).contains(&most), "{least} {most}");
    assert!(table.of("gear").iter().all(|g| (2.0..=4.0).contains(g) || g.is_nan()));
    let index = read("drives.toml");
    assert!(index.contains("truck = \"reference\"") && !index.contains("reported_mass_kg"));
    let line = refused(&[&command[..], &["--out", &out]].concat());
    assert!(line.contains("--overwrite"), "{line}");
}

#[test]
fn a_log_without_a_drive_gets_one_line_that_says_why_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("drives");
    let at = out.display().to_string();
    let empty = folder.path().join("empty.log");
    std::fs::write(&empty, "").unwrap();
    let binary = folder.path().join("binary.log");
    std::fs::write(&binary, [0u8, 255, 3, 200, 10, 7]).unwrap();
    let nowhere = folder.path().join("nowhere.xodr");
    let road = road::builtin::flat(1_000.0).with_geo_reference(&road::GeoReference::default());
    std::fs::write(&nowhere, road.write_opendrive()).unwrap();
    let nowhere = nowhere.display().to_string();
    let (empty, binary) = (empty.display().to_string(), binary.display().to_string());
    let (idle, parked, drives) =
        (log("css_truck_idle"), log("uthp_modern_parked"), log("t270_normal"));
    let cases: [(&[&str], &str); 8] = [
        (&[&idle], "the truck stands for all of 127 s"),
        (&[&parked], "error or not available in all of"),
        (&[&drives], "shorter than 60 s; diagnose and identify need 90 s"),
        (&[&empty], "nobody sends HRW rear wheels or EBC2"),
        (&[&binary], "binary.log"),
        (&["nowhere.log"], "nowhere.log"),
        (&[&drives, &drives], "two logs are named t270_normal"),
        (&[&drives, "--map", &nowhere], "does not say where on earth it lies"),
    ];
    for (arguments, named) in cases {
        let command = ["drives", "from-can", "--truck", "reference", "--out", &at];
        let line = refused(&[&command[..], arguments].concat());
        assert!(line.contains(named), "{line}");
        assert!(!out.exists(), "{arguments:?} left something behind");
    }
    let line = refused(&["drives", "from-can", &drives, "--truck", "nosuch", "--out", &at]);
    assert!(line.contains("nosuch"), "{line}");
}

/// The frames that went over the bus of a run, as candump writes them.
fn logged(recording: &Path, to: &Path) {
    let mut inputs = recording::Inputs::open(recording, true).unwrap();
    let mut lines = Vec::new();
    while let Some(call) = inputs.next_call().unwrap() {
        let sent = call.sent.iter().map(|sent| (call.now, sent.frame));
        let received = call.received.iter().flatten().map(|heard| (heard.time, heard.value));
        for (time, frame) in sent.chain(received) {
            let bytes = &frame.data[..usize::from(frame.len)];
            let hex: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
            let at_s = 10.0 + time.seconds();
            lines.push((time, format!("({at_s:.6}) can0 {:08X}#{hex}\n", frame.id)));
        }
    }
    lines.sort_by_key(|(time, _)| *time);
    std::fs::write(to, lines.into_iter().map(|(_, line)| line).collect::<String>()).unwrap();
}

/// The built-in roads lie on the earth: by the fixes of the bus a log finds its place, and its grade.
#[test]
fn a_log_of_a_run_on_a_built_in_road_finds_its_grade_by_position() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let run = ["run", "highway-sag", "--truck", "reference", "--vehicle", "bus", "--headless"];
    let rest = ["--traffic", "none", "--duration", "90", "--out", &at("run")];
    let output = server(&[&run[..], &rest].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    logged(&folder.path().join("run/run.mcap"), &folder.path().join("bus.log"));
    let drives = ["drives", "from-can", &at("bus.log"), "--truck", "reference"];
    let rest = ["--mass-kg", "40000", "--map", "builtin:highway-sag", "--out", &at("drives")];
    let output = server(&[&drives[..], &rest].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let road = road::Road::load("builtin:highway-sag").unwrap();
    let map = std::fs::read_to_string(at("drives/map.csv")).unwrap();
    let grade = map.lines().nth(401).unwrap().split(',').nth(1).unwrap().parse::<f64>().unwrap();
    assert!((grade - road.at(2_000.0, 0.0).grade_rad.tan()).abs() < 1e-9, "{grade}");
    let table = Columns::read(&at("drives/bus_1.csv"));
    let (s_m, speed_m_s) = (table.of("s_map_m"), table.of("speed_m_s"));
    let driven_m = s_m[s_m.len() - 1] - s_m[0];
    assert!(driven_m > 1_000.0 && *speed_m_s.last().unwrap() > 10.0, "{driven_m}");
    assert!(s_m.is_sorted_by(|a, b| a < b), "the place goes on");
}

/// A DBC with a message of the maker: speed in km/h, hand wheel in degrees, positive to the right.
fn dbc(change: (&str, &str)) -> String {
    let text = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: ECU\n\n\
        BO_ 2566852641 OEM1: 8 ECU\n\
        \x20SG_ Speed : 0|16@1+ (0.01,0) [0|250] \"km/h\" ECU\n\
        \x20SG_ Wheel : 23|16@0- (0.1,0) [-2000|2000] \"deg\" ECU\n\
        \x20SG_ Clutch : 32|8@1+ (1,0) [0|100] \"%\" ECU\n\n\
        BA_DEF_ SG_ \"SPN\" INT 0 600000;\nBA_DEF_DEF_ \"SPN\" 0;\n\
        BA_ \"SPN\" SG_ 2566852641 Speed 84;\n";
    assert!(text.contains(change.0), "{change:?}");
    text.replace(change.0, change.1)
}

/// Two minutes in which only the maker's message says anything.
fn makers_log(to: &Path) {
    let mut log = String::new();
    for k in 0..2400 {
        let t = 0.05 * f64::from(k);
        let speed = ((54.0 + 18.0 * (0.1 * t).sin()) * 100.0).round() as u16;
        let wheel = (10.0 * (0.2 * t).sin() * 10.0).round() as i16;
        let ([s0, s1], [w0, w1]) = (speed.to_le_bytes(), wheel.to_be_bytes());
        let data = format!("{s0:02X}{s1:02X}{w0:02X}{w1:02X}FFFFFFFF");
        log.push_str(&format!("({:.6}) can0 18FF1021#{data}\n", 100.0 + t));
    }
    std::fs::write(to, log).unwrap();
}

#[test]
fn a_maker_s_signals_fill_columns_by_name_and_by_number_in_the_column_s_unit() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    makers_log(&folder.path().join("own.log"));
    std::fs::write(at("own.dbc"), dbc(("", ""))).unwrap();
    let command = ["drives", "from-can", &at("own.log"), "--truck", "reference"];
    let rest = ["--dbc", &at("own.dbc"), "--signal", "steering_wheel_rad=-OEM1.Wheel"];
    let output = server(&[&command[..], &rest, &["--out", &at("drives")]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("speed_m_s from OEM1.Speed of 21 every 50 ms"), "{said}");
    let table = Columns::read(&at("drives/own_1.csv"));
    let rows = table.of("time_s").into_iter().zip(table.of("speed_m_s"));
    for ((t, speed), wheel) in rows.zip(table.of("steering_wheel_rad")) {
        assert!((speed - (15.0 + 5.0 * (0.1 * t).sin())).abs() < 0.02, "{t} {speed}");
        assert!((wheel + (10.0 * (0.2 * t).sin()).to_radians()).abs() < 0.01, "{t} {wheel}");
    }
    assert!(table.rows.len() > 2000, "{}", table.rows.len());
}

#[test]
fn a_dbc_that_cannot_be_used_gets_one_line_that_names_the_signal() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    makers_log(&folder.path().join("own.log"));
    let cases = [
        (("Clutch : 32", "Clutch : 12"), "OEM1: Speed and Clutch overlap at bit 12"),
        (("\"km/h\"", "\"l/h\""), "OEM1.Speed: unit \"l/h\" is none of speed_m_s"),
        (("\"deg\"", "\"\""), "OEM1.Wheel: unit \"\" is none of steering_wheel_rad"),
        (("SG_ Wheel", "SG_ Rad"), "steering_wheel_rad: no signal OEM1.Wheel"),
        (("2566852641", "321"), "11-bit identifier"),
        (("0|16@1+", "0|99@1+"), "99 bits are no number"),
        (("BO_ 2566852641", "BO_ twelve"), "no DBC"),
    ];
    for (change, expected) in cases {
        std::fs::write(at("own.dbc"), dbc(change)).unwrap();
        let command = ["drives", "from-can", &at("own.log"), "--truck", "reference"];
        let rest = ["--dbc", &at("own.dbc"), "--signal", "steering_wheel_rad=-OEM1.Wheel"];
        let line = refused(&[&command[..], &rest, &["--out", &at("drives")]].concat());
        assert!(line.contains(expected) && line.contains("own.dbc"), "{expected}: {line}");
    }
    std::fs::write(at("own.dbc"), dbc(("", ""))).unwrap();
    let command = ["drives", "from-can", &at("own.log"), "--truck", "reference"];
    let rest = ["--dbc", &at("own.dbc"), "--signal", "colour=Wheel", "--out", &at("drives")];
    let line = refused(&[&command[..], &rest].concat());
    assert!(line.contains("colour is no column"), "{line}");
}
