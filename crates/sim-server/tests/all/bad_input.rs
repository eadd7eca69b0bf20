//! Bad input gets one clear line on stderr, exit code 2, nothing on stdout, and nothing is lost.

use std::net::TcpListener;
use std::path::Path;

use crate::support::{program, refused, scenario_with, server};

#[test]
fn an_unknown_flag_is_named() {
    assert!(refused(&["run", "--sede", "3"]).contains("--sede"));
    assert!(refused(&["fly"]).contains("fly"));
}

#[test]
fn numbers_that_are_no_numbers_are_refused_with_their_flag() {
    for (flag, value) in
        [("--duration", "NaN"), ("--duration", "-5"), ("--pace", "fast"), ("--payload-kg", "inf")]
    {
        let flag_value = format!("{flag}={value}");
        let line = refused(&["run", "--headless", &flag_value]);
        assert!(line.contains(flag) && line.contains(value), "{line}");
        let line = refused(&["run", "--headless", flag, value]);
        assert!(line.contains(flag) && line.contains(value), "{line}");
    }
    assert!(refused(&["run", "--headless", "--port", "99999"]).contains("99999"));
}

#[test]
fn a_sheet_is_not_made_of_a_wrong_truck_or_over_another_file() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("sheet.toml");
    let out = out.to_str().unwrap();
    let sheet = |truck: &str, payload: &str| {
        refused(&["truck", "sheet", truck, "--payload-kg", payload, "--out", out])
    };
    assert!(sheet("no-such-truck", "0").contains("no-such-truck"));
    assert!(sheet("reference", "-1").contains("--payload-kg"));
    assert!(sheet("reference", "1e9").contains("mass_kg"));
    std::fs::write(out, "mine").unwrap();
    assert!(sheet("reference", "0").contains("--overwrite"));
    assert_eq!(std::fs::read_to_string(out).unwrap(), "mine");
    let nowhere = folder.path().join("none/sheet.toml");
    let nowhere = nowhere.to_str().unwrap();
    let words = ["truck", "sheet", "reference", "--payload-kg", "0", "--out", nowhere];
    assert!(refused(&words).contains("none/sheet.toml"));
}

#[test]
fn a_bus_that_cannot_be_used_is_named() {
    for (bus, says) in [
        ("can:no-such-iface", "no-such-iface"),
        ("can:", "interface"),
        ("socketcand:127.0.0.1:1/vcan0", "127.0.0.1:1"),
        ("socketcand:127.0.0.1", "socketcand:HOST:PORT/IFACE"),
        ("slcan:/dev/ttyS0", "socketcand:HOST:PORT/IFACE"),
    ] {
        let line = refused(&["run", "flat", "--headless", "--vehicle", bus]);
        assert!(line.contains("--vehicle") && line.contains(says), "{bus}: {line}");
        let line = refused(&["ecu", "flat", "--bus", bus]);
        assert!(line.contains("--bus") && line.contains(says), "{bus}: {line}");
    }
    assert!(refused(&["run", "--headless", "--vehicle", "tram"]).contains("tram"));
    assert!(refused(&["ecu"]).contains("--bus"));
}

#[test]
fn a_port_or_a_decider_that_cannot_be_is_named() {
    assert!(refused(&["run", "--headless", "--foxglove", "70000"]).contains("70000"));
    assert!(refused(&["run", "--headless", "--decider", "dqn:none.safetensors"]).contains("none"));
    assert!(refused(&["run", "--headless", "--decider", "dqn:"]).contains("dqn:FILE"));
    assert!(refused(&["run", "--headless", "--decider", "rules:near"]).contains("rules:near"));
    assert!(refused(&["run", "--headless", "--decider", "rules:-3"]).contains("-3"));
}

#[test]
fn a_ros_domain_that_cannot_be_is_named() {
    for wrong in ["300", "-1", "one"] {
        let words = ["run", "flat", "--headless", "--ros2"];
        let output = program().args(words).env("ROS_DOMAIN_ID", wrong).output().unwrap();
        let line = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), line.lines().count()), (Some(2), 1), "{line}");
        assert!(line.contains(&format!("ROS_DOMAIN_ID={wrong}: expected")), "{line}");
    }
}

#[test]
fn a_wrong_key_in_a_scenario_is_named_with_its_file() {
    let folder = tempfile::tempdir().unwrap();
    for (text, named) in [
        ("speed_limit_kmh = 80\n", "speed_limit_kmh"),
        ("[ego]\nspeed_km_h = 72.0\n", "unknown key \"speed_km_h\"; the nearest are speed_m_s, "),
        ("[ego]\nspeed_m_s = nan\n", "ego.speed_m_s"),
        ("[run]\ntick_s = 0.0\n", "run.tick_s"),
        ("[stack]\ndecider = \"psychic\"\n", "psychic"),
        ("[weather\n", "line"),
    ] {
        let file = scenario_with(folder.path(), text);
        let line = refused(&["run", &file, "--headless"]);
        assert!(line.contains(named) && line.contains("scenario.toml"), "{text}: {line}");
    }
}

/// A number of 1e308 was written with all of its 309 digits.
#[test]
fn a_number_is_never_longer_than_it_has_digits() {
    let folder = tempfile::tempdir().unwrap();
    let digits = format!("{}", 1e308);
    let line = refused(&["run", "--headless", "--payload-kg", &digits]);
    assert!(line.contains("1e308") && line.len() < 300, "{line}");
    let file = scenario_with(folder.path(), &format!("[ego]\nspeed_m_s = {digits}.0\n"));
    let line = refused(&["run", "--headless", &file]);
    assert!(line.contains("ego.speed_m_s") && line.contains("1e308"), "{line}");
    assert!(line.len() < 300, "{line}");
}

#[test]
fn missing_and_malformed_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    assert!(refused(&["run", &path("none.toml")]).contains("none.toml"));
    let line = refused(&["run", "higway"]);
    assert!(line.contains("the nearest are highway, "), "{line}");
    assert!(refused(&["run", "--headless", "--truck", "no-such-truck"]).contains("no-such-truck"));
    assert!(refused(&["recover", &path("none.mcap")]).contains("none.mcap"));
    assert!(refused(&["scenario", "show", "nowhere"]).contains("nowhere"));

    std::fs::write(path("torn.xodr"), "<OpenDRIVE><road length=\"abc\"").unwrap();
    for command in [&["map", "check"][..], &["run", "--headless", "--road"]] {
        let line = refused(&[command, &[&*path("torn.xodr")]].concat());
        assert!(line.contains("torn.xodr"), "{line}");
    }
    std::fs::write(path("road.csv"), "s_m,height\n0,1\n").unwrap();
    assert!(refused(&["map", "check", &path("road.csv")]).contains("road.csv"));
    std::fs::write(path("text.mcap"), "not a recording").unwrap();
    assert!(refused(&["recover", &path("text.mcap")]).contains("text.mcap"));
}

#[test]
fn a_plan_needs_a_truck_of_at_least_its_empty_mass_and_a_sensible_band() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("plan").display().to_string();
    let plan = |mass: &'static str, lowest: &'static str| {
        let fixed = ["plan", "--truck", "sinotruk", "--road", "builtin:flat", "--out", &out];
        let speeds = ["--set-speed-m-s", "20", "--speed-max-m-s", "22", "--speed-min-m-s", lowest];
        refused(&[&fixed[..], &speeds[..], &["--mass-kg", mass]].concat())
    };
    assert!(plan("5000", "15").contains("without payload"));
    assert!(plan("NaN", "15").contains("--mass-kg"));
    assert!(plan("40000", "21").contains("speed_min_m_s"));
    assert!(!Path::new(&out).exists(), "nothing is written for a plan that cannot be made");
}

#[test]
fn a_port_in_use_is_reported_before_anything_is_written() {
    #[expect(clippy::disallowed_methods, reason = "the test occupies a port")]
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let line = refused(&["run", "--port", &port, "--out", &out.display().to_string()]);
    assert!(line.contains(&port) && line.contains("in use"), "{line}");
    assert!(!out.exists());
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let out = file.join("out").display().to_string();
    assert!(refused(&["run", "--headless", "--out", &out]).contains(&out));
}

#[test]
fn recover_does_not_overwrite() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let run = server(&["run", "--headless", "--duration", "1", "--out", &out]);
    assert!(run.status.success());
    let file = folder.path().join("run.mcap").display().to_string();
    assert!(server(&["recover", &file]).status.success());
    assert!(refused(&["recover", &file]).contains("run.recovered.mcap"));
}
