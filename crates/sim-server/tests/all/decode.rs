//! `decode`: logs of a bus, whole and wrong.

use std::path::Path;

use crate::support::{refused, server};

/// EEC1 with an engine speed, one with an error, a vehicle identification in four packets, and what
/// is no J1939 message of the table; two channels.
const LOG: &str = "\
(10.000000) can0 0CF00400#F07D7DA02EFFFFFF
(10.010000) can1 0CF00400#F07D7D00FEFFFFFF
(10.020000) can0 123#0011
(10.030000) can0 1CECFF00#20120003FFECFE00
(10.040000) can1 1CECFF00#20120003FFECFE00
(10.080000) can0 1CEBFF00#0131584B54524143
(10.130000) can0 1CEBFF00#0254524958303030
(10.140000) can0 18FF1200#0000000000000000
(10.180000) can0 1CEBFF00#033030312AFFFFFF
(10.190000) can0 0CF00400#F07D7D
(12.000000) can1 1CEBFF00#0131584B54524143
";

fn log(folder: &Path, text: &str) -> String {
    let file = folder.join("bus.log");
    std::fs::write(&file, text).unwrap();
    file.display().to_string()
}

#[test]
fn values_states_and_transported_messages_come_out_channel_by_channel() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(folder.path(), LOG);
    let output = server(&["decode", &file, "--signals", "engine_speed_rad_s,VI,EEC1.torque_frac"]);
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let expected = [
        "time_s,channel,pgn,message,sa,da,signal,unit,value,state",
        "10.000000,can0,61444,EEC1,0,255,torque_frac,,0,value",
        "10.000000,can0,61444,EEC1,0,255,engine_speed_rad_s,rad/s,156.24187",
        "10.010000,can1,61444,EEC1,0,255,torque_frac,,0,value",
        "10.010000,can1,61444,EEC1,0,255,engine_speed_rad_s,rad/s,,error",
        "10.180000,can0,65260,VI,0,255,vin,,1XK**************,value",
        "10.190000,can0,61444,EEC1,0,255,,,,\"PGN 61444 from 0x00 has 3 bytes, it needs 8\"",
    ];
    assert_eq!(lines.len(), expected.len(), "{text}");
    for (line, expected) in lines.iter().zip(expected) {
        assert!(line.starts_with(expected), "{line}\n{expected}");
    }
    let said = String::from_utf8(output.stderr).unwrap();
    for part in ["2 channels", "3 messages decoded, 1 too short", "1 not in the table", "11-bit"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(said.contains("2 transported, 1 of them broken off; skipped 1 frames"), "{said}");
}

#[test]
fn objects_have_states_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let file = log(folder.path(), LOG);
    let output = server(&["decode", &file, "--format", "jsonl", "--signals", "EEC1"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let objects: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(objects.len(), 3);
    assert_eq!(objects[1]["channel"], "can1");
    assert_eq!(objects[1]["signals"]["engine_speed_rad_s"], "error");
    assert_eq!(objects[1]["signals"]["starter_mode"], "not available");
    assert_eq!(objects[0]["signals"]["torque_frac"], 0.0);
    assert!(objects[2]["error"].as_str().unwrap().contains("has 3 bytes"));
}

#[test]
fn what_is_no_log_and_names_that_do_not_exist_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    assert!(refused_by("decode", &path("none.log")).contains("none.log"));
    std::fs::write(path("long.log"), "a".repeat(1 << 20)).unwrap();
    std::fs::write(path("binary.log"), [0, 159, 146, 150]).unwrap();
    std::fs::write(path("fd.log"), "(1.0) can0 18F00400##1001122\n").unwrap();
    for (file, why) in [("long.log", "longer than"), ("binary.log", "line 1"), ("fd.log", "CAN FD")]
    {
        let line = refused_by("decode", &path(file));
        assert!(line.contains(file) && line.contains(why), "{line}");
    }
    let file = log(folder.path(), LOG);
    let line = refused(&["decode", &file, "--signals", "engine_sped_rad_s"]);
    assert!(line.contains("engine_speed_rad_s"), "{line}");
    let line = refused(&["decode", &file, "--signals", "EEC1.yaw_rate_rad_s"]);
    assert!(line.contains("EEC1.yaw_rate_rad_s"), "{line}");
}

/// A log that is wrong from its first line: exit code 2 and one line; of the output only the header
/// may be there.
fn refused_by(command: &str, file: &str) -> String {
    let output = server(&[command, file]);
    let line = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{line}");
    assert!(output.stdout.len() < 100);
    line
}
